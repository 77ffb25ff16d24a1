//! Tasks as request metrics: Ballista's engine, with a clock around each task.

use std::fmt::{Display, Formatter};
use std::sync::Arc;

use ::service::{Outcome, Red};
use async_trait::async_trait;
use ballista_core::JobId;
use ballista_core::serde::protobuf::{
    RuntimeStatsReport, ShuffleWritePartition, TaskColumnStats, WindowStateReport,
};
use ballista_executor::execution_engine::{
    DefaultExecutionEngine, ExecutionEngine, QueryStageExecutor,
};
use datafusion::error::Result;
use datafusion::execution::context::TaskContext;
use datafusion::physical_plan::ExecutionPlan;
use datafusion::physical_plan::metrics::MetricsSet;
use datafusion::prelude::SessionConfig;

use crate::failure::{self, Failure};

/// The engine whose tasks are counted.
pub(super) struct CountedEngine {
    inner: DefaultExecutionEngine,
    red: Red,
}

impl CountedEngine {
    pub(super) fn new(inner: DefaultExecutionEngine, red: Red) -> Self {
        Self { inner, red }
    }
}

impl ExecutionEngine for CountedEngine {
    fn create_query_stage_exec(
        &self,
        job_id: JobId,
        stage_id: usize,
        task_id: usize,
        global_output_partition_ids: Vec<usize>,
        plan: Arc<dyn ExecutionPlan>,
        work_dir: &str,
        config: &SessionConfig,
    ) -> Result<Arc<dyn QueryStageExecutor>> {
        let inner = self.inner.create_query_stage_exec(
            job_id,
            stage_id,
            task_id,
            global_output_partition_ids,
            plan,
            work_dir,
            config,
        )?;
        let red = self.red.clone();
        Ok(Arc::new(CountedStage { inner, red }))
    }
}

#[derive(Debug)]
struct CountedStage {
    inner: Arc<dyn QueryStageExecutor>,
    red: Red,
}

impl Display for CountedStage {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        self.inner.fmt(f)
    }
}

#[async_trait]
impl QueryStageExecutor for CountedStage {
    async fn execute_query_stage(
        &self,
        task_id: usize,
        context: Arc<TaskContext>,
    ) -> Result<Vec<ShuffleWritePartition>> {
        let running = self.red.start("task");
        let worked = self.inner.execute_query_stage(task_id, context).await;
        running.done(match &worked {
            Ok(_) => Outcome::Ok,
            Err(error) if failure::of(error) == Failure::Passing => Outcome::Retryable,
            Err(_) => Outcome::Failed,
        });
        worked
    }

    fn collect_plan_metrics(&self) -> Vec<MetricsSet> {
        self.inner.collect_plan_metrics()
    }

    fn collect_runtime_stats_reports(&self) -> Vec<RuntimeStatsReport> {
        self.inner.collect_runtime_stats_reports()
    }

    fn collect_window_state_reports(&self) -> Result<Vec<WindowStateReport>> {
        self.inner.collect_window_state_reports()
    }

    fn collect_column_stats(&self) -> Vec<TaskColumnStats> {
        self.inner.collect_column_stats()
    }
}
