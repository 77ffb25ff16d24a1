//! The one session state of client, scheduler and executor: functions and settings.

use std::num::NonZeroUsize;
use std::sync::Arc;

use ballista::extension::SessionConfigExt as _;
use datafusion::error::DataFusionError;
use datafusion::execution::FunctionRegistry as _;
use datafusion::execution::memory_pool::FairSpillPool;
use datafusion::execution::runtime_env::{RuntimeEnv, RuntimeEnvBuilder};
use datafusion::execution::session_state::{SessionState, SessionStateBuilder};
use datafusion::prelude::SessionConfig;

use crate::functions;
use crate::objects::Objects;

/// Largest message between client, scheduler and executor: a plan that names the fields of 100 years of days fits well.
/// Geometry never travels in one, it goes through the object store.
pub(crate) const MESSAGE_BYTES: usize = 64 << 20;
/// A connection that takes longer than this is as good as none.
const CONNECT_SECONDS: u64 = 3;
/// How often an idle connection is asked whether the other side is still there.
const KEEPALIVE_SECONDS: u64 = 10;
/// Between two tries to fetch an intermediate result; three tries, then the scheduler has it made again.
const FETCH_RETRY_MS: u64 = 200;

/// Rows of a batch. A row is a chunk of up to 28 KiB, or a block of a series of up to 94 KiB a year of days: a batch is a
/// few MiB, where the engine's own 8192 rows would be hundreds.
const BATCH_ROWS: usize = 64;
/// Memory that all queries of one process may take for what cannot be streamed, bytes.
pub(crate) const MEMORY_BYTES: usize = 1 << 30;

/// A runtime that reads from some objects and takes no more memory than this for what queries must hold.
pub(crate) fn runtime(
    objects: &Objects,
    memory_bytes: usize,
) -> Result<Arc<RuntimeEnv>, DataFusionError> {
    let runtime = RuntimeEnvBuilder::new()
        .with_memory_pool(Arc::new(FairSpillPool::new(memory_bytes)))
        .build_arc()?;
    objects.register(&runtime);
    Ok(runtime)
}

/// Settings of a session whose queries are worked on in `partitions` parts by Ballista.
pub(crate) fn ballista_config(partitions: NonZeroUsize) -> SessionConfig {
    SessionConfig::new_with_ballista()
        .with_ballista_standalone_parallelism(partitions.get())
        // Adaptive planning is on by default in Ballista 55 and incomplete.
        .with_ballista_adaptive_query_planner(false)
        .with_ballista_grpc_client_max_message_size(MESSAGE_BYTES)
        // The default packs all partitions of a stage into one task.
        .set_usize("ballista.scheduler.max_partitions_per_task", 1)
        .set_u64(
            "ballista.client.grpc_connect_timeout_seconds",
            CONNECT_SECONDS,
        )
        .set_u64(
            "ballista.client.grpc_http2_keepalive_interval_seconds",
            KEEPALIVE_SECONDS,
        )
        .set_u64("ballista.client.io_retry_wait_time_ms", FETCH_RETRY_MS)
        .with_target_partitions(partitions.get())
        .of_chunks()
}

/// Settings of a session whose queries DataFusion works on in this process, in `partitions` parts.
pub(crate) fn local_config(partitions: NonZeroUsize) -> SessionConfig {
    SessionConfig::new()
        .with_target_partitions(partitions.get())
        .of_chunks()
}

/// What every session needs whose rows are chunks.
trait OfChunks {
    fn of_chunks(self) -> Self;
}

impl OfChunks for SessionConfig {
    fn of_chunks(self) -> Self {
        self.with_information_schema(false)
            .with_batch_size(BATCH_ROWS)
            // A few of a file's rows are wanted: decode nothing of the others.
            .set_bool("datafusion.execution.parquet.pushdown_filters", true)
            // The fields of a function's answer are not parts of a stored column: taken apart below the filter, the
            // function would be called twice, and for chunks that nobody asked for.
            .set_bool(
                "datafusion.optimizer.enable_leaf_expression_pushdown",
                false,
            )
            // No plan of ours depends on them, and planning would read the footer of every file.
            .with_collect_statistics(false)
            // Chunks stay in the part that read them: only sums go from one part to another.
            .with_round_robin_repartition(false)
    }
}

/// A session's state: the settings, the runtime, and our functions beside the built-in ones.
pub(crate) fn session_state(
    config: SessionConfig,
    runtime: Arc<RuntimeEnv>,
    objects: &Objects,
) -> Result<SessionState, DataFusionError> {
    let mut state = SessionStateBuilder::new()
        .with_default_features()
        .with_config(config)
        .with_runtime_env(runtime)
        .build();
    register_functions(&mut state, objects)?;
    Ok(state)
}

/// Adds our functions, once more after anything that resets a state to the built-in ones.
pub(crate) fn register_functions(
    state: &mut SessionState,
    objects: &Objects,
) -> Result<(), DataFusionError> {
    for function in functions::scalar_functions(objects) {
        state.register_udf(function)?;
    }
    for function in functions::aggregate_functions() {
        state.register_udaf(function)?;
    }
    Ok(())
}
