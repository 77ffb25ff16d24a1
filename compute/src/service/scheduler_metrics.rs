//! Ballista's events as request metrics: a query is an operation, from its submission to its end.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use ::service::{Outcome, Red, Running};
use ballista_core::JobId;
use ballista_scheduler::metrics::SchedulerMetricsCollector;
use prometheus::Registry;

/// Queries under way and their metrics.
pub(super) struct QueryMetrics {
    red: Red,
    running: Mutex<BTreeMap<String, Running>>,
}

impl QueryMetrics {
    pub(super) fn register(registry: &Registry) -> Result<Self, prometheus::Error> {
        Ok(Self {
            red: Red::register(registry, "scheduler")?,
            running: Mutex::default(),
        })
    }

    fn running(&self) -> MutexGuard<'_, BTreeMap<String, Running>> {
        self.running.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn ended(&self, job: &JobId, outcome: Outcome) {
        let running = self.running().remove(job.as_str());
        // A query that could not be planned ends without having begun.
        running
            .unwrap_or_else(|| self.red.start("query"))
            .done(outcome);
    }
}

impl SchedulerMetricsCollector for QueryMetrics {
    fn record_submitted(&self, job_id: &JobId, _queued_at: u64, _submitted_at: u64) {
        let begun = self.red.start("query");
        self.running().insert(job_id.as_str().to_owned(), begun);
    }

    fn record_completed(&self, job_id: &JobId, _queued_at: u64, _completed_at: u64) {
        self.ended(job_id, Outcome::Ok);
    }

    fn record_failed(&self, job_id: &JobId, _queued_at: u64, _failed_at: u64) {
        self.ended(job_id, Outcome::Failed);
    }

    fn record_cancelled(&self, job_id: &JobId) {
        self.ended(job_id, Outcome::Dropped);
    }

    /// Nobody calls it in Ballista 55: waiting tasks are counted by the scheduler service itself.
    fn set_pending_tasks_queue_size(&self, _value: u64) {}

    fn gather_metrics(&self) -> ballista_core::error::Result<Option<(Vec<u8>, String)>> {
        // They are shown with all others of this process.
        Ok(None)
    }
}
