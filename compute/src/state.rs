//! The one session state of client, scheduler and executor: functions, settings and where objects are read from.

use std::num::NonZeroUsize;
use std::sync::Arc;

use ballista::extension::SessionConfigExt as _;
use datafusion::error::DataFusionError;
use datafusion::execution::FunctionRegistry as _;
use datafusion::execution::runtime_env::{RuntimeEnv, RuntimeEnvBuilder};
use datafusion::execution::session_state::{SessionState, SessionStateBuilder};
use datafusion::prelude::SessionConfig;
use object_store::ObjectStore;
use storage::Store;
use url::Url;

use crate::functions;
use crate::steady_store::SteadyStore;

/// Largest message between client, scheduler and executor: a plan that names the frames of 100 years of days fits well.
/// Geometry never travels in one, it goes through the object store.
pub(crate) const MESSAGE_BYTES: usize = 64 << 20;
/// A connection that takes longer than this is as good as none.
const CONNECT_SECONDS: u64 = 3;
/// How often an idle connection is asked whether the other side is still there.
const KEEPALIVE_SECONDS: u64 = 10;
/// Between two tries to fetch an intermediate result; three tries, then the scheduler has it made again.
const FETCH_RETRY_MS: u64 = 200;

/// Where SQL reads objects: the root that URLs of this store begin with, and what answers for it.
#[derive(Debug, Clone)]
pub struct Objects {
    root: Url,
    store: Arc<dyn ObjectStore>,
}

impl Objects {
    /// Those of a store; reads that fail for a passing reason are tried again.
    pub fn of(store: &Store) -> Self {
        let (root, objects) = store.sql_root();
        Self::new(root, objects)
    }

    /// Those of any object store under a root.
    pub fn new(root: Url, store: Arc<dyn ObjectStore>) -> Self {
        let store = Arc::new(SteadyStore::new(store));
        Self { root, store }
    }

    /// A runtime that reads from here.
    pub(crate) fn register(&self, runtime: &RuntimeEnv) {
        runtime.register_object_store(&self.root, Arc::clone(&self.store));
    }

    pub(crate) fn runtime(&self) -> Result<Arc<RuntimeEnv>, DataFusionError> {
        let runtime = RuntimeEnvBuilder::new().build_arc()?;
        self.register(&runtime);
        Ok(runtime)
    }
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
        .with_information_schema(false)
}

/// Settings of a session whose queries DataFusion works on in this process.
pub(crate) fn local_config() -> SessionConfig {
    SessionConfig::new()
        // One block of a series file is wanted: decode nothing of the others.
        .set_bool("datafusion.execution.parquet.pushdown_filters", true)
        .with_target_partitions(1)
        .with_information_schema(false)
}

/// A session's state: the settings, the runtime, and our functions beside the built-in ones.
pub(crate) fn session_state(
    config: SessionConfig,
    runtime: Arc<RuntimeEnv>,
) -> Result<SessionState, DataFusionError> {
    let mut state = SessionStateBuilder::new()
        .with_default_features()
        .with_config(config)
        .with_runtime_env(runtime)
        .build();
    register_functions(&mut state)?;
    Ok(state)
}

/// Adds our functions, once more after anything that resets a state to the built-in ones.
pub(crate) fn register_functions(state: &mut SessionState) -> Result<(), DataFusionError> {
    for function in functions::scalar_functions() {
        state.register_udf(function)?;
    }
    for function in functions::aggregate_functions() {
        state.register_udaf(function)?;
    }
    Ok(())
}
