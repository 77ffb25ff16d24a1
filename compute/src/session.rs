//! Query engines: Ballista in this process or as a cluster for budgets and derived products, plain DataFusion for one
//! place's series.

use std::future::Future;
use std::num::NonZeroUsize;
use std::sync::Arc;
use std::time::Duration;

use ballista::extension::SessionConfigExt as _;
use contract::digest::Digest;
use contract::manifest::{Manifest, ManifestId};
use datafusion::catalog::MemoryCatalogProviderList;
use datafusion::error::DataFusionError;
use datafusion::execution::context::SessionContext;
use datafusion::execution::session_state::{SessionState, SessionStateBuilder};
use futures::future::BoxFuture;
use retry::Backoff;
use storage::Store;
use tokio::sync::OnceCell;
use tokio::time::Instant;

use crate::cluster::{self, Cluster, SchedulerUrl};
use crate::standalone::{self, WorkFolder, WorkLease};
use crate::{ComputeError, Objects, state};

/// A query engine over one store; clones share it. It starts with its first query.
#[derive(Clone)]
pub struct Engine {
    inner: Arc<Inner>,
    /// May a question about a region leave its weights in the store?
    stores_weights: bool,
}

struct Inner {
    store: Store,
    objects: Objects,
    kind: Kind,
    partitions: NonZeroUsize,
    /// Memory that queries in this process may take for what they must hold, bytes.
    memory_bytes: usize,
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

#[derive(Clone)]
enum Kind {
    /// Ballista's scheduler and executor inside this process, spoken to over loopback.
    Standalone,
    /// DataFusion alone: no scheduler between the question and the answer.
    Local,
    /// Ballista's scheduler and executors as processes of their own.
    Cluster(Cluster),
}

impl Engine {
    /// Ballista in this process, working on `partitions` parts of a query at a time.
    pub fn standalone(store: Store, partitions: NonZeroUsize) -> Self {
        Self::new(store, Kind::Standalone, partitions)
    }

    /// DataFusion in this process, for questions that touch few rows.
    pub fn local(store: Store) -> Self {
        Self::in_process(store, NonZeroUsize::MIN)
    }

    /// DataFusion in this process, working on `partitions` parts of a query at a time: the answers of Ballista without
    /// its scheduler, its executor and its intermediate files.
    pub fn in_process(store: Store, partitions: NonZeroUsize) -> Self {
        Self::new(store, Kind::Local, partitions)
    }

    /// A Ballista cluster, its queries cut into `partitions` parts. Its executors must read the same store by the same
    /// address.
    ///
    /// A query whose scheduler or executors are lost is asked again, for at most [`cluster::RETRY_LIMIT`]: queries only read
    /// objects that never change, so that asking twice does no harm.
    pub fn cluster(store: Store, scheduler: SchedulerUrl, partitions: NonZeroUsize) -> Self {
        let cluster = Cluster {
            scheduler,
            retry_limit: cluster::RETRY_LIMIT,
            query_limit: cluster::QUERY_LIMIT,
        };
        Self::new(store, Kind::Cluster(cluster), partitions)
    }

    /// The same engine, waiting so long for a cluster that is away; other engines have nobody to wait for.
    #[must_use]
    pub fn with_retry_limit(&self, retry_limit: Duration) -> Self {
        self.with_cluster(|cluster| cluster.retry_limit = retry_limit)
    }

    /// The same engine, giving a query up that its cluster does not answer within so long, tries to ask again among it;
    /// other engines work themselves.
    #[must_use]
    pub fn with_query_limit(&self, query_limit: Duration) -> Self {
        self.with_cluster(|cluster| cluster.query_limit = query_limit)
    }

    fn with_cluster(&self, change: impl FnOnce(&mut Cluster)) -> Self {
        let Kind::Cluster(cluster) = &self.inner.kind else {
            return self.clone();
        };
        let mut cluster = cluster.clone();
        change(&mut cluster);
        let inner = &self.inner;
        self.with(Inner {
            kind: Kind::Cluster(cluster),
            session: OnceCell::new(),
            store: inner.store.clone(),
            objects: inner.objects.clone(),
            ..**inner
        })
    }

    /// The same engine, its work in this process taking no more memory than this for what it must hold: values in flight, cells over all
    /// time, sorted rows.
    #[must_use]
    pub fn with_memory_bytes(self, memory_bytes: usize) -> Self {
        let inner = &self.inner;
        self.with(Inner {
            memory_bytes,
            kind: inner.kind.clone(),
            session: OnceCell::new(),
            store: inner.store.clone(),
            objects: inner.objects.clone(),
            ..**inner
        })
    }

    /// The same engine, its queries reading objects from somewhere else.
    #[must_use]
    pub fn reading(self, objects: Objects) -> Self {
        let inner = &self.inner;
        self.with(Inner {
            objects,
            kind: inner.kind.clone(),
            session: OnceCell::new(),
            store: inner.store.clone(),
            ..**inner
        })
    }

    /// The same engine for questions of strangers: weights of the regions that they think of are computed for each
    /// question and stored nowhere.
    #[must_use]
    pub fn storing_no_weights(&self) -> Self {
        Self {
            stores_weights: false,
            ..self.clone()
        }
    }

    pub(crate) fn stores_weights(&self) -> bool {
        self.stores_weights
    }

    fn new(store: Store, kind: Kind, partitions: NonZeroUsize) -> Self {
        Self::of(Inner {
            objects: Objects::of(&store),
            store,
            kind,
            partitions,
            memory_bytes: state::MEMORY_BYTES,
            session: OnceCell::new(),
        })
    }

    /// The same engine but for its inside.
    fn with(&self, inner: Inner) -> Self {
        Self {
            stores_weights: self.stores_weights,
            ..Self::of(inner)
        }
    }

    fn of(inner: Inner) -> Self {
        Self {
            inner: Arc::new(inner),
            stores_weights: true,
        }
    }

    /// The store that it reads and writes.
    pub fn store(&self) -> &Store {
        &self.inner.store
    }

    /// Values of a version of a product along time; `id` is its name, which is costly to compute. What was opened is held.
    ///
    /// # Errors
    /// A store that does not answer; a cube that cannot be read.
    pub fn values<'a>(
        &'a self,
        manifest: &'a Manifest,
        id: &'a ManifestId,
    ) -> BoxFuture<'a, Result<cube::Values, ComputeError>> {
        Box::pin(async move {
            let held = self.objects().open_versions();
            let opened = held.values(self.store(), manifest, id);
            Ok(opened.await?)
        })
    }

    /// Lets go of a version's values; false if they were not held.
    pub(crate) fn forget_values(&self, id: &ManifestId) -> bool {
        self.objects().open_versions().forget(id)
    }

    /// Where its queries read objects.
    pub(crate) fn objects(&self) -> &Objects {
        &self.inner.objects
    }

    /// Memory that its work in this process may take, bytes.
    pub(crate) fn memory_bytes(&self) -> usize {
        self.inner.memory_bytes
    }

    /// Parts that a question is cut into.
    pub(crate) fn partitions(&self) -> NonZeroUsize {
        self.inner.partitions
    }

    /// Does every query pass through Ballista's scheduler?
    pub fn is_distributed(&self) -> bool {
        !matches!(self.inner.kind, Kind::Local)
    }

    /// Does whoever plans its queries deal the pieces of a question out to executors?
    pub(crate) fn has_dealer(&self) -> bool {
        matches!(self.inner.kind, Kind::Cluster(_))
    }

    /// Starts the engine if it has not started; queries do so by themselves.
    pub fn start(&self) -> BoxFuture<'_, Result<(), ComputeError>> {
        Box::pin(async move { self.session().await.map(|_session| ()) })
    }

    /// Can a query be asked now? Of a cluster its scheduler is asked, within two seconds.
    pub fn ready(&self) -> BoxFuture<'_, Result<(), ComputeError>> {
        Box::pin(async move {
            match &self.inner.kind {
                Kind::Cluster(cluster) => {
                    let answers = cluster.scheduler.answers().await;
                    answers.map_err(|error| cluster.away(error))
                }
                Kind::Standalone | Kind::Local => Ok(()),
            }
        })
    }

    /// Works on a question; `job` is the hash of all that its answer depends on.
    ///
    /// On a cluster, `ask` is called again when it failed for a reason that passes, until the retry limit.
    pub(crate) async fn answer<T, F, Fut>(&self, job: Digest, ask: F) -> Result<T, ComputeError>
    where
        F: Fn(QueryContext) -> Fut,
        Fut: Future<Output = Result<T, ComputeError>>,
    {
        let name = job.to_string();
        let Kind::Cluster(cluster) = &self.inner.kind else {
            return ask(self.context(&name).await?).await;
        };
        let mut pauses = Backoff::within(cluster.retry_limit).pauses();
        let end = Instant::now() + cluster.query_limit;
        loop {
            let asked = ask(self.context(&name).await?);
            let error = match tokio::time::timeout_at(end, asked).await {
                Ok(Err(error)) if error.is_retryable() => error,
                Ok(ended) => return ended,
                Err(_elapsed) => {
                    return Err(ComputeError::Overdue {
                        scheduler: cluster.scheduler.to_string(),
                        limit_s: cluster.query_limit.as_secs(),
                    });
                }
            };
            let scheduler = &cluster.scheduler;
            let Some(pause) = pauses.next() else {
                return Err(cluster.away(error));
            };
            tracing::warn!(job = name, %scheduler, %error, "the cluster lost a query; asking again");
            tokio::time::sleep(pause).await;
        }
    }

    /// A context for one query, which a scheduler shows under this name.
    async fn context(&self, job: &str) -> Result<QueryContext, ComputeError> {
        let session = self.session().await?;
        let shared = session.state.clone();
        let session_id = shared.session_id().to_owned();
        let config = shared
            .config()
            .clone()
            .with_create_default_catalog_and_schema(true);
        let config = if self.is_distributed() {
            config.with_ballista_job_name(job)
        } else {
            config
        };
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
        let failed = || ComputeError::engine("starting the query engine");
        let objects = &self.objects;
        let runtime = state::runtime(objects, self.memory_bytes).map_err(failed())?;
        match &self.kind {
            Kind::Local => {
                let config = state::local_config(self.partitions);
                Ok(Session {
                    state: state::session_state(config, runtime, objects).map_err(failed())?,
                    work: None,
                })
            }
            Kind::Cluster(cluster) => Ok(Session {
                state: cluster
                    .session(objects, runtime, self.partitions)
                    .map_err(failed())?,
                work: None,
            }),
            Kind::Standalone => {
                tracing::info!(
                    partitions = self.partitions,
                    "starting Ballista in this process"
                );
                let config = state::ballista_config(self.partitions);
                let state = state::session_state(config, runtime, objects).map_err(failed())?;
                let (mut state, work) = standalone::start(state, self.partitions.get())
                    .await
                    .map_err(|e| failed()(DataFusionError::External(e.into())))?;
                // The upgrade to a Ballista session resets the functions to the built-in ones.
                state::register_functions(&mut state, objects).map_err(failed())?;
                Ok(Session {
                    state,
                    work: Some(work),
                })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use datafusion::execution::FunctionRegistry as _;
    use datafusion::logical_expr::ScalarUDF;

    use super::*;

    impl Engine {
        /// The same engine, which works in this process, with a function of a test in the place of its own of that name.
        pub(crate) async fn with_function(&self, function: ScalarUDF) -> Self {
            let mut session = self.inner.start().await.unwrap();
            session.state.register_udf(Arc::new(function)).unwrap();
            let inner = &self.inner;
            self.with(Inner {
                kind: inner.kind.clone(),
                session: OnceCell::from(session),
                store: inner.store.clone(),
                objects: inner.objects.clone(),
                ..**inner
            })
        }
    }

    /// Name of the operator at the top of a query's plan.
    async fn top_of_plan(engine: &Engine) -> String {
        let context = engine.context("test").await.unwrap();
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
    async fn all_engines_but_the_local_one_hand_their_queries_to_ballista() {
        let parts = NonZeroUsize::new(2).unwrap();
        let standalone = Engine::standalone(Store::memory(), parts);
        assert_eq!(top_of_plan(&standalone).await, "DistributedQueryExec");
        let nowhere = "http://127.0.0.1:1".parse().unwrap();
        let cluster = Engine::cluster(Store::memory(), nowhere, parts);
        assert_eq!(top_of_plan(&cluster).await, "DistributedQueryExec");
        assert_ne!(
            top_of_plan(&Engine::local(Store::memory())).await,
            "DistributedQueryExec"
        );
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn a_query_that_must_hold_more_than_its_memory_is_refused() {
        let hold = |engine: Engine| async move {
            let context = engine.context("test").await.unwrap();
            let sql = "SELECT array_agg(a) FROM (SELECT unnest(range(0, 20000)) a)";
            context.sql(sql).await.unwrap().collect().await
        };
        let engine = || Engine::in_process(Store::memory(), NonZeroUsize::MIN);
        assert!(hold(engine()).await.is_ok());
        let refused = hold(engine().with_memory_bytes(64 << 10))
            .await
            .unwrap_err();
        let root = refused.find_root();
        assert!(
            matches!(root, DataFusionError::ResourcesExhausted(_)),
            "{root}"
        );
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn a_cluster_that_stays_away_is_told_of_at_the_retry_limit() {
        let nowhere = "http://127.0.0.1:1".parse().unwrap();
        let engine = Engine::cluster(Store::memory(), nowhere, NonZeroUsize::MIN)
            .with_retry_limit(Duration::from_millis(500));
        let is_named = |error: &ComputeError| {
            let told = error.to_string();
            told.contains("http://127.0.0.1:1 ") && told.contains("FLUXGLOBE_CLUSTER")
        };
        let away = engine.ready().await.unwrap_err();
        assert!(is_named(&away), "{away}");
        let tries = std::sync::atomic::AtomicU32::new(0);
        let ask = |context: QueryContext| {
            tries.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            async move {
                let failed = || ComputeError::engine("testing");
                let query = context.sql("SELECT 1").await.map_err(failed())?;
                query.collect().await.map_err(failed())
            }
        };
        let error = engine.answer(Digest::of(b"test"), ask).await.unwrap_err();
        assert!(error.is_retryable() && is_named(&error), "{error}");
        assert!(tries.into_inner() > 1, "asked once only");
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn intermediate_files_go_with_the_last_query_that_may_need_them() {
        let engine = Engine::standalone(Store::memory(), NonZeroUsize::MIN);
        let (first, second) = (
            engine.context("first").await.unwrap(),
            engine.context("second").await.unwrap(),
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
        tokio::time::timeout(Duration::from_secs(20), emptied)
            .await
            .unwrap();
    }
}
