//! Query engines: Ballista in this process for budgets and derived products, plain DataFusion for one place's series.
//!
//! One session state serves client, scheduler and executor, so that all three know the same functions and stores.

use std::num::NonZeroUsize;
use std::sync::Arc;

use ballista::extension::SessionConfigExt as _;
use datafusion::catalog::MemoryCatalogProviderList;
use datafusion::error::DataFusionError;
use datafusion::execution::FunctionRegistry as _;
use datafusion::execution::context::SessionContext;
use datafusion::execution::runtime_env::{RuntimeEnv, RuntimeEnvBuilder};
use datafusion::execution::session_state::{SessionState, SessionStateBuilder};
use datafusion::prelude::SessionConfig;
use storage::Store;
use tokio::sync::OnceCell;
use url::Url;

use crate::standalone::{self, WorkFolder, WorkLease};
use crate::{ComputeError, functions};

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
    session: OnceCell<Session>,
}

struct Session {
    state: SessionState,
    /// Where Ballista's executor works; none without it.
    work: Option<Arc<WorkFolder>>,
}

/// A context for one query: the shared session, tables of its own, and a claim on intermediate files.
pub(crate) struct QueryContext {
    context: SessionContext,
    /// Dropped with the context: the files of a query outlive its last batch.
    _lease: Option<WorkLease>,
}

impl std::ops::Deref for QueryContext {
    type Target = SessionContext;

    fn deref(&self) -> &SessionContext {
        &self.context
    }
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

    /// A context for one query.
    pub(crate) async fn context(&self) -> Result<QueryContext, ComputeError> {
        let session = self.session().await?;
        let shared = session.state.clone();
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
        let lease = match &session.work {
            Some(work) => Some(work.lease().await),
            None => None,
        };
        Ok(QueryContext {
            context: SessionContext::new_with_state(state),
            _lease: lease,
        })
    }

    async fn session(&self) -> Result<&Session, ComputeError> {
        self.inner
            .session
            .get_or_try_init(|| self.inner.start())
            .await
    }
}

impl Inner {
    async fn start(&self) -> Result<Session, ComputeError> {
        let state = session_state(&self.store, self.kind, self.partitions)?;
        if self.kind == Kind::Local {
            return Ok(Session { state, work: None });
        }
        tracing::info!(
            partitions = self.partitions,
            "starting Ballista in this process"
        );
        let (mut state, work) = standalone::start(state, self.partitions.get())
            .await
            .map_err(|e| {
                ComputeError::engine("starting Ballista")(DataFusionError::External(e.into()))
            })?;
        // The upgrade to a Ballista session resets the functions to the built-in ones.
        register_functions(&mut state)?;
        Ok(Session {
            state,
            work: Some(work),
        })
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
    register_functions(&mut state)?;
    Ok(state)
}

fn register_functions(state: &mut SessionState) -> Result<(), ComputeError> {
    let failed = || ComputeError::engine("registering functions");
    for function in functions::scalar_functions() {
        state.register_udf(function).map_err(failed())?;
    }
    for function in functions::aggregate_functions() {
        state.register_udaf(function).map_err(failed())?;
    }
    Ok(())
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Name of the operator at the top of a query's plan.
    async fn top_of_plan(engine: &Engine) -> String {
        let context = engine.context().await.unwrap();
        let query = context
            .sql("SELECT SUM(a) FROM (VALUES (1), (2)) t(a)")
            .await
            .unwrap();
        query
            .create_physical_plan()
            .await
            .unwrap()
            .name()
            .to_owned()
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn a_standalone_engine_hands_its_queries_to_ballista_and_a_local_one_does_not() {
        let parts = NonZeroUsize::new(2).unwrap();
        let standalone = Engine::standalone(Store::memory(), parts);
        assert_eq!(top_of_plan(&standalone).await, "DistributedQueryExec");
        assert_ne!(
            top_of_plan(&Engine::local(Store::memory())).await,
            "DistributedQueryExec"
        );
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn intermediate_files_go_with_the_last_query_that_may_need_them() {
        let engine = Engine::standalone(Store::memory(), NonZeroUsize::MIN);
        let (first, second) = (
            engine.context().await.unwrap(),
            engine.context().await.unwrap(),
        );
        let query = first
            .sql("SELECT SUM(a) FROM (VALUES (1), (2)) t(a)")
            .await
            .unwrap();
        query.collect().await.unwrap();
        let session = engine.session().await.unwrap();
        let folder = session.work.as_ref().unwrap().path();
        let files = || std::fs::read_dir(folder).unwrap().count();
        assert!(
            files() > 0,
            "the query left nothing: this test tests nothing"
        );
        drop(first);
        assert!(files() > 0, "files went while a query was running");
        drop(second);
        let emptied = async {
            while files() > 0 {
                tokio::task::yield_now().await;
            }
        };
        tokio::time::timeout(std::time::Duration::from_secs(20), emptied)
            .await
            .unwrap();
    }
}
