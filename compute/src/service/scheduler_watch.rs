//! What a scheduler sees of its executors and of the tasks that wait for one.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;

use ballista_core::JobId;
use ballista_scheduler::cluster::{ClusterStateEvent, ClusterStateEventStream};
use ballista_scheduler::state::executor_manager::ExecutorManager;
use ballista_scheduler::state::task_manager::JobInfoCache;
use futures::StreamExt as _;
use prometheus::{IntCounter, IntGauge, Registry};

use super::room::Room;

/// How often waiting tasks are counted.
const COUNT_INTERVAL: Duration = Duration::from_secs(1);

/// What is shown of it; clones share it.
#[derive(Debug, Clone)]
pub(super) struct Seen {
    pub(super) executors: IntGauge,
    lost: IntCounter,
    waiting_tasks: IntGauge,
    /// Tasks that the executors work on at once.
    pub(super) room: Room,
}

impl Seen {
    pub(super) fn register(registry: &Registry) -> Result<Self, prometheus::Error> {
        let executors = IntGauge::new(
            "fluxglobe_scheduler_executors",
            "Executors that give signs of life.",
        )?;
        let lost = IntCounter::new(
            "fluxglobe_scheduler_executors_lost_total",
            "Executors that were lost or left.",
        )?;
        let waiting_tasks = IntGauge::new(
            "fluxglobe_scheduler_waiting_tasks",
            "Tasks that could be worked on and that no executor has taken yet.",
        )?;
        registry.register(Box::new(executors.clone()))?;
        registry.register(Box::new(lost.clone()))?;
        registry.register(Box::new(waiting_tasks.clone()))?;
        Ok(Self {
            executors,
            lost,
            waiting_tasks,
            room: Room::default(),
        })
    }

    /// Counts executors whenever one comes or goes.
    pub(super) async fn watch(
        self,
        mut changes: ClusterStateEventStream,
        manager: ExecutorManager,
    ) {
        while let Some(change) = changes.next().await {
            let alive = manager.get_executors_state().await;
            let alive = alive.unwrap_or_default();
            let tasks = alive
                .iter()
                .map(|(executor, ..)| executor.specification.vcores);
            self.room.set(tasks.sum());
            self.executors.set(alive.len() as i64);
            match change {
                ClusterStateEvent::RegisteredExecutor { executor_id } => {
                    tracing::info!(executor = executor_id, "an executor is there");
                }
                ClusterStateEvent::RemovedExecutor { executor_id } => {
                    self.lost.inc();
                    tracing::warn!(
                        executor = executor_id,
                        "an executor is gone; its tasks are given to others"
                    );
                }
            }
        }
    }

    /// Counts waiting tasks for ever.
    pub(super) async fn count(self, jobs: impl Fn() -> Arc<HashMap<JobId, JobInfoCache>> + Send) {
        loop {
            let running = jobs();
            let graphs: Vec<_> = running.values().map(|job| &job.execution_graph).collect();
            let mut waiting = 0;
            for graph in graphs {
                waiting += graph.read().await.available_tasks();
            }
            self.waiting_tasks.set(waiting as i64);
            tokio::time::sleep(COUNT_INTERVAL).await;
        }
    }
}
