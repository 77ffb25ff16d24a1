//! Query engines: Ballista in this process for budgets and derived products, plain DataFusion for one place's series.
//!
//! One session state serves client, scheduler and executor, so that all three know the same functions and stores.

use std::num::NonZeroUsize;
use std::sync::Arc;

use ballista::prelude::{SessionConfigExt as _, SessionContextExt as _};
use datafusion::catalog::MemoryCatalogProviderList;
use datafusion::execution::FunctionRegistry as _;
use datafusion::execution::context::SessionContext;
use datafusion::execution::runtime_env::{RuntimeEnv, RuntimeEnvBuilder};
use datafusion::execution::session_state::{SessionState, SessionStateBuilder};
use datafusion::prelude::SessionConfig;
use storage::Store;
use tokio::sync::OnceCell;
use url::Url;

use crate::ComputeError;
use crate::functions;

/// A query engine over one store; clones share it. It starts with its first query.
#[derive(Clone)]
pub struct Engine {
    inner: Arc<Inner>,
}

struct Inner {
    store: Store,
    kind: Kind,
    partitions: NonZeroUsize,
    /// The session that all queries share; made once.
    session: OnceCell<SessionState>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// Ballista's scheduler and executor inside this process, spoken to over loopback.
    Standalone,
    /// DataFusion alone: no scheduler between the question and the answer.
    Local,
}

impl Engine {
    /// Ballista in this process, working on `partitions` parts of a query at a time.
    pub fn standalone(store: Store, partitions: NonZeroUsize) -> Self {
        Self::new(store, Kind::Standalone, partitions)
    }

    /// DataFusion in this process, for questions that touch few rows.
    pub fn local(store: Store) -> Self {
        Self::new(store, Kind::Local, NonZeroUsize::MIN)
    }

    fn new(store: Store, kind: Kind, partitions: NonZeroUsize) -> Self {
        Self {
            inner: Arc::new(Inner {
                store,
                kind,
                partitions,
                session: OnceCell::new(),
            }),
        }
    }

    /// The store that it reads and writes.
    pub fn store(&self) -> &Store {
        &self.inner.store
    }

    /// Does every query pass through Ballista's scheduler?
    pub fn is_distributed(&self) -> bool {
        self.inner.kind == Kind::Standalone
    }

    /// Starts the engine if it has not started; queries do so by themselves.
    pub async fn start(&self) -> Result<(), ComputeError> {
        self.session().await.map(|_session| ())
    }

    /// A context for one query: the shared session, tables of its own.
    pub(crate) async fn context(&self) -> Result<SessionContext, ComputeError> {
        let shared = self.session().await?.clone();
        let session_id = shared.session_id().to_owned();
        let config = shared
            .config()
            .clone()
            .with_create_default_catalog_and_schema(true);
        let state = SessionStateBuilder::new_from_existing(shared)
            .with_session_id(session_id)
            .with_catalog_list(Arc::new(MemoryCatalogProviderList::new()))
            .with_config(config)
            .build();
        Ok(SessionContext::new_with_state(state))
    }

    async fn session(&self) -> Result<&SessionState, ComputeError> {
        self.inner
            .session
            .get_or_try_init(|| self.inner.start())
            .await
    }
}

impl Inner {
    async fn start(&self) -> Result<SessionState, ComputeError> {
        let state = session_state(&self.store, self.kind, self.partitions)?;
        if self.kind == Kind::Local {
            return Ok(state);
        }
        tracing::info!(
            partitions = self.partitions,
            "starting Ballista in this process"
        );
        let context = SessionContext::standalone_with_state(state)
            .await
            .map_err(ComputeError::engine("starting Ballista"))?;
        // The upgrade to a Ballista session resets the functions to the built-in ones.
        for function in functions::scalar_functions() {
            context.register_udf(function.as_ref().clone());
        }
        for function in functions::aggregate_functions() {
            context.register_udaf(function.as_ref().clone());
        }
        Ok(context.state())
    }
}

/// The one session state of client, scheduler and executor.
fn session_state(
    store: &Store,
    kind: Kind,
    partitions: NonZeroUsize,
) -> Result<SessionState, ComputeError> {
    let config = match kind {
        Kind::Local => SessionConfig::new()
            // One block of a series file is wanted: decode nothing of the others.
            .set_bool("datafusion.execution.parquet.pushdown_filters", true),
        Kind::Standalone => SessionConfig::new_with_ballista()
            .with_ballista_standalone_parallelism(partitions.get())
            // Adaptive planning is on by default in Ballista 55 and incomplete.
            .with_ballista_adaptive_query_planner(false)
            // The default packs all partitions of a stage into one task.
            .set_usize("ballista.scheduler.max_partitions_per_task", 1),
    };
    let mut state = SessionStateBuilder::new()
        .with_default_features()
        .with_config(
            config
                .with_target_partitions(partitions.get())
                .with_information_schema(false),
        )
        .with_runtime_env(runtime(store)?)
        .build();
    for function in functions::scalar_functions() {
        register(state.register_udf(function))?;
    }
    for function in functions::aggregate_functions() {
        register(state.register_udaf(function))?;
    }
    Ok(state)
}

fn register<T>(result: datafusion::error::Result<T>) -> Result<(), ComputeError> {
    result
        .map(|_replaced| ())
        .map_err(ComputeError::engine("registering functions"))
}

/// What reads files: DataFusion knows local folders by itself, any other store is ours to name.
fn runtime(store: &Store) -> Result<Arc<RuntimeEnv>, ComputeError> {
    let runtime = RuntimeEnvBuilder::new()
        .build()
        .map_err(ComputeError::engine("making a runtime"))?;
    if !store.url().starts_with("file:") {
        let url =
            Url::parse(store.url()).map_err(|e| ComputeError::inconsistent(store.url(), e))?;
        runtime.register_object_store(&url, store.object_store());
    }
    Ok(Arc::new(runtime))
}
