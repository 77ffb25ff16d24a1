//! Where queries read objects: SQL's scans by address, and our functions the weights that they sum with.

use std::sync::Arc;

use bytes::Bytes;
use contract::key::ObjectKey;
use datafusion::error::DataFusionError;
use datafusion::execution::runtime_env::RuntimeEnv;
use object_store::path::Path;
use object_store::{ObjectStore, ObjectStoreExt as _};
use storage::Store;
use url::{Position, Url};

use crate::ComputeError;
use crate::region::computed::ComputedWeights;
use crate::region::loaded::{LoadedWeights, RegionWeights};
use crate::retry_store::RetryStore;
use crate::tail_store::TailStore;

/// The root that URLs of a store begin with, and what answers for it. Clones share what was read.
#[derive(Debug, Clone)]
pub struct Objects {
    root: Url,
    store: Arc<dyn ObjectStore>,
    weights: Arc<LoadedWeights>,
}

impl Objects {
    /// Those of a store; reads that fail for a passing reason are tried again.
    pub fn of(store: &Store) -> Self {
        let (root, objects) = store.sql_root();
        Self::new(root, objects)
    }

    /// Those of any object store under a root.
    pub fn new(root: Url, store: Arc<dyn ObjectStore>) -> Self {
        Self {
            root,
            store: Arc::new(TailStore::new(Arc::new(RetryStore::new(store)))),
            weights: Arc::default(),
        }
    }

    /// Makes scans of a runtime read from here.
    pub(crate) fn register(&self, runtime: &RuntimeEnv) {
        runtime.register_object_store(&self.root, Arc::clone(&self.store));
    }

    /// A region's weights by their address, or by the question that they answer: read or computed once, whoever asks and
    /// however often.
    pub(crate) async fn weights(
        &self,
        address: &str,
    ) -> Result<Arc<RegionWeights>, DataFusionError> {
        if let Some(question) = ComputedWeights::of_text(address).map_err(external)? {
            let computing = self.computed(question);
            return self
                .weights
                .get(&ComputedWeights::name(address), computing)
                .await;
        }
        self.weights
            .get(address, async {
                let content = self.content(address).await?;
                let key = key_at(address)?;
                let chunks = storage::weights::decode(&key, content)
                    .map_err(|e| DataFusionError::External(e.into()))?;
                Ok(RegionWeights::new(chunks))
            })
            .await
    }

    async fn computed(&self, question: ComputedWeights) -> Result<RegionWeights, DataFusionError> {
        let shares = match (question.surface.shares(), &question.shares_at) {
            (Some(shares), Some(address)) => {
                let content = self.content(address).await?;
                let values = storage::fields::of_bytes(&shares.field, content, &question.grid);
                Some(values.map_err(|e| DataFusionError::External(e.into()))?)
            }
            _ => None,
        };
        let computing = move || question.chunks(shares.as_deref());
        let chunks = tokio::task::spawn_blocking(computing).await;
        let chunks = chunks.map_err(|e| DataFusionError::External(e.into()))?;
        chunks.map(RegionWeights::new).map_err(external)
    }

    async fn content(&self, address: &str) -> Result<Bytes, DataFusionError> {
        let elsewhere = || {
            let root = &self.root;
            DataFusionError::Execution(format!("{address} is not in the store at {root}"))
        };
        let url = Url::parse(address).map_err(|_no_address| elsewhere())?;
        if url[..Position::BeforePath] != self.root[..Position::BeforePath] {
            return Err(elsewhere());
        }
        let path = Path::from_url_path(url.path()).map_err(|_no_path| elsewhere())?;
        Ok(self.store.get(&path).await?.bytes().await?)
    }
}

fn external(error: ComputeError) -> DataFusionError {
    DataFusionError::External(error.into())
}

/// The key at the end of an address of weights: what they are checked as, and named by if they are damaged.
fn key_at(address: &str) -> Result<ObjectKey, DataFusionError> {
    let digits = address
        .rsplit('/')
        .next()
        .and_then(|name| name.strip_suffix(".parquet"));
    let job = digits.and_then(|digits| digits.parse().ok());
    job.map(|job| ObjectKey::weights(&job))
        .ok_or_else(|| DataFusionError::Execution(format!("{address} is no address of weights")))
}

/// Two that read from the same place answer the same.
impl PartialEq for Objects {
    fn eq(&self, other: &Self) -> bool {
        self.root == other.root
    }
}

impl Eq for Objects {}

impl std::hash::Hash for Objects {
    fn hash<H: std::hash::Hasher>(&self, state: &mut H) {
        self.root.hash(state);
    }
}
