//! The batches of a query to a cluster as they come; its job is cancelled where they are dropped before their end.
//!
//! Ballista's client leaves a job to itself when nobody waits for it any more: executors would go on with it.

use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};

use ballista_core::JobId;
use ballista_core::execution_plans::DistributedQueryExec;
use datafusion::arrow::array::RecordBatch;
use datafusion::arrow::datatypes::SchemaRef;
use datafusion::error::DataFusionError;
use datafusion::execution::{RecordBatchStream, SendableRecordBatchStream};
use datafusion::physical_plan::ExecutionPlan;
use datafusion_proto::protobuf::LogicalPlanNode;
use futures::Stream;

use crate::cluster::SchedulerUrl;

/// Batches of a job that somebody waits for.
pub(crate) struct AwaitedJob {
    batches: SendableRecordBatchStream,
    /// What asked the scheduler, which knows the job as soon as that has taken it.
    plan: Arc<dyn ExecutionPlan>,
    scheduler: SchedulerUrl,
    is_over: bool,
}

impl AwaitedJob {
    /// What the plan's scheduler gives.
    pub(crate) fn new(
        batches: SendableRecordBatchStream,
        plan: Arc<dyn ExecutionPlan>,
        scheduler: SchedulerUrl,
    ) -> Self {
        Self {
            batches,
            plan,
            scheduler,
            is_over: false,
        }
    }

    /// The job; none before the scheduler has taken it.
    fn job(&self) -> Option<JobId> {
        let plan = self
            .plan
            .downcast_ref::<DistributedQueryExec<LogicalPlanNode>>()?;
        plan.job_id()
    }
}

impl Stream for AwaitedJob {
    type Item = Result<RecordBatch, DataFusionError>;

    fn poll_next(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        let polled = self.batches.as_mut().poll_next(context);
        // A job whose client had an error is over, or its scheduler is gone.
        self.is_over |= matches!(polled, Poll::Ready(None | Some(Err(_))));
        polled
    }
}

impl RecordBatchStream for AwaitedJob {
    fn schema(&self) -> SchemaRef {
        self.batches.schema()
    }
}

impl Drop for AwaitedJob {
    fn drop(&mut self) {
        if self.is_over {
            return;
        }
        // Without a runtime the process is ending.
        let (Some(job), Ok(runtime)) = (self.job(), tokio::runtime::Handle::try_current()) else {
            return;
        };
        let scheduler = self.scheduler.clone();
        runtime.spawn(async move {
            let job = job.as_str();
            match scheduler.cancel(job).await {
                Ok(()) => tracing::info!(job, "nobody waits for a query: cancelled"),
                Err(error) => tracing::warn!(job, %error, "a query that nobody waits for goes on"),
            }
        });
    }
}
