//! Where queries read objects: SQL's scans by address, and our functions the weights that they sum with.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use bytes::Bytes;
use contract::chunk::{BAND_CELLS, bands};
use contract::digest::Digest;
use contract::key::ObjectKey;
use contract::manifest::ManifestId;
use datafusion::error::DataFusionError;
use datafusion::execution::runtime_env::RuntimeEnv;
use object_store::path::Path as ObjectPath;
use object_store::{ObjectStore, ObjectStoreExt as _};
use quick_cache::Weighter;
use quick_cache::sync::Cache;
use storage::fields::Reader;
use storage::rows::{RowIndex, Stored};
use storage::weights::SharedAreas;
use storage::{StorageError, Store, manifests, spool};
use tokio::sync::Semaphore;
use url::{Position, Url};

use crate::ComputeError;
use crate::awaited::{Awaited, SharedWork, Work};
use crate::open_versions::OpenVersions;
use crate::reduce::held_shares::HeldShares;
use crate::reduce::remembered::Remembered;
use crate::region::computed::ComputedWeights;
use crate::region::extent::Extent;
use crate::region::loaded::{LoadedWeights, RegionWeights};
use crate::region::shares::Weighing;
use crate::retry_store::RetryStore;
use crate::tail_store::TailStore;

/// The root that URLs of a store begin with, and what answers for it. Clones share what was read.
#[derive(Debug, Clone)]
pub struct Objects {
    root: Url,
    store: Arc<dyn ObjectStore>,
    weights: Arc<LoadedWeights>,
    /// Weights that are being computed, by what they will be held under.
    weighing: Arc<SharedWork<Chunks>>,
    /// Where rows lie in files that were read, by their path.
    row_indexes: Arc<Cache<ObjectPath, Option<Arc<RowIndex>>, ByRows>>,
    extents: Arc<Cache<Digest, Extent>>,
    measuring: Arc<SharedWork<Extent>>,
    sums: Arc<Remembered>,
    shares: Arc<HeldShares>,
    open_versions: Arc<OpenVersions>,
    /// Where functions that compute products store them.
    storing: Option<Storing>,
}

/// Areas of a region's share of every cell, m², by chunk.
type Chunks = Vec<(u32, SharedAreas)>;

/// Files whose rows are known: series of 16 years of a few products.
const HELD_INDEXES: usize = 256;
/// Rows of them all together, at some 40 bytes each.
const HELD_ROWS: u64 = 1 << 20;
/// Regions whose extent is known.
const HELD_EXTENTS: usize = 1000;

/// Counts rows of files.
#[derive(Debug, Clone)]
struct ByRows;

impl Weighter<ObjectPath, Option<Arc<RowIndex>>> for ByRows {
    fn weight(&self, _at: &ObjectPath, index: &Option<Arc<RowIndex>>) -> u64 {
        index.as_ref().map_or(1, |index| index.row_count().max(1))
    }
}

/// A store that functions write to, and how many of them may work at a time.
#[derive(Clone)]
pub(crate) struct Storing {
    pub(crate) store: Store,
    pub(crate) turns: Arc<Semaphore>,
    /// Where fields lie that are too large to be held on their way to the store.
    pub(crate) spool: PathBuf,
}

impl std::fmt::Debug for Storing {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.store.url())
    }
}

impl Objects {
    /// Those of a store; reads that fail for a passing reason are tried again.
    pub fn of(store: &Store) -> Self {
        let (root, objects) = store.sql_root();
        Self::new(root, objects).storing(store)
    }

    /// The same, whose functions store what they compute.
    #[must_use]
    pub fn storing(self, store: &Store) -> Self {
        let turns = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
        let storing = Storing {
            store: store.clone(),
            turns: Arc::new(Semaphore::new(turns)),
            spool: spool::FOLDER.clone(),
        };
        Self {
            storing: Some(storing),
            ..self
        }
    }

    /// The same, whose large fields lie in a folder on their way to the store.
    #[must_use]
    pub fn spooling(mut self, folder: &Path) -> Self {
        if let Some(storing) = &mut self.storing {
            folder.clone_into(&mut storing.spool);
        }
        self
    }

    /// Where functions that compute products store them.
    pub(crate) fn to_store(&self) -> Result<&Storing, DataFusionError> {
        let none = || DataFusionError::Execution("nothing can be stored here".to_owned());
        self.storing.as_ref().ok_or_else(none)
    }

    /// Those of any object store under a root.
    pub fn new(root: Url, store: Arc<dyn ObjectStore>) -> Self {
        Self {
            root,
            store: Arc::new(TailStore::new(Arc::new(RetryStore::new(store)))),
            weights: Arc::default(),
            weighing: Arc::default(),
            row_indexes: Arc::new(Cache::with_weighter(HELD_INDEXES, HELD_ROWS, ByRows)),
            extents: Arc::new(Cache::new(HELD_EXTENTS)),
            measuring: Arc::default(),
            sums: Arc::default(),
            shares: Arc::default(),
            open_versions: Arc::new(OpenVersions::new()),
            storing: None,
        }
    }

    /// Makes scans of a runtime read from here.
    pub(crate) fn register(&self, runtime: &RuntimeEnv) {
        runtime.register_object_store(&self.root, Arc::clone(&self.store));
    }

    /// A region's weights by their address, or by the question that they answer: read or computed once, whoever asks and
    /// however often. What is computed ends early when all who asked have left.
    pub(crate) async fn weights(
        &self,
        address: &str,
    ) -> Result<Arc<RegionWeights>, DataFusionError> {
        let name = ComputedWeights::name(address);
        // The question of a region of very many corners is long: what is held is found without reading it.
        if let Some(held) = name.as_deref().and_then(|name| self.weights.held(name)) {
            return Ok(held);
        }
        let question = ComputedWeights::of_text(address).map_err(external)?;
        if let (Some(name), Some(question)) = (name, question) {
            // Held until there is an answer: it is what keeps the work alive.
            let work = self.weighing.join(&name);
            return self
                .weights
                .get(&name, self.computed(question, &work))
                .await;
        }
        self.weights
            .get(address, async {
                let content = self.content(address).await?;
                let key = key_at(address)?;
                let chunks = storage::weights::decode_shared(&key, content)
                    .map_err(|e| DataFusionError::External(e.into()))?;
                Ok(RegionWeights::new(chunks))
            })
            .await
    }

    async fn computed(
        &self,
        question: ComputedWeights,
        work: &Work<Chunks>,
    ) -> Result<RegionWeights, DataFusionError> {
        if question.grid.cell_count() as u64 > BAND_CELLS {
            return self.computed_in_bands(question, work).await;
        }
        let shares = match (question.surface.shares(), &question.shares_at) {
            (Some(shares), Some(address)) => {
                let content = self.content(address).await?;
                let values = storage::fields::of_bytes(&shares.field, content, &question.grid);
                Some(values.map_err(|e| DataFusionError::External(e.into()))?)
            }
            _ => None,
        };
        let computing = move |awaited: &Awaited| question.chunks(shares.as_deref(), awaited);
        let chunks = work.done(computing).await;
        chunks.map(RegionWeights::new).map_err(external)
    }

    /// The same on a grid of which no map is held whole.
    async fn computed_in_bands(
        &self,
        question: ComputedWeights,
        work: &Work<Chunks>,
    ) -> Result<RegionWeights, DataFusionError> {
        let question = Arc::new(question);
        let own = Arc::clone(&question);
        let computing = move |awaited: &Awaited| own.to_weigh(awaited);
        let chunks = work.done(computing).await.map_err(external)?;
        let (Some(shares), Some(address)) = (question.weighed_by(), &question.shares_at) else {
            return Ok(RegionWeights::new(chunks));
        };
        let unread = |e: StorageError| DataFusionError::External(e.into());
        let stored = self.stored(&shares.field, address).map_err(external)?;
        let reader = Reader::of_rows(stored, &question.grid)
            .await
            .map_err(unread)?;
        let mut weighing = Weighing::new(shares, &question.grid, &chunks);
        for rows in bands(&question.grid, BAND_CELLS) {
            if weighing.needs(&rows) {
                let values = reader.rows(rows.clone()).await.map_err(unread)?;
                weighing.band(rows, &values).map_err(external)?;
            }
        }
        weighing.finish().map(RegionWeights::new).map_err(external)
    }

    async fn content(&self, address: &str) -> Result<Bytes, DataFusionError> {
        let path = self.path(address)?;
        Ok(self.store.get(&path).await?.bytes().await?)
    }

    /// Where an address leads in the store.
    fn path(&self, address: &str) -> Result<ObjectPath, DataFusionError> {
        let elsewhere = || {
            let root = &self.root;
            DataFusionError::Execution(format!("{address} is not in the store at {root}"))
        };
        let url = Url::parse(address).map_err(|_no_address| elsewhere())?;
        if url[..Position::BeforePath] != self.root[..Position::BeforePath] {
            return Err(elsewhere());
        }
        ObjectPath::from_url_path(url.path()).map_err(|_no_path| elsewhere())
    }

    /// An object whose rows are read, by its address.
    pub(crate) fn stored(&self, key: &ObjectKey, address: &str) -> Result<Stored, ComputeError> {
        let path = self.path(address);
        Ok(Stored {
            objects: Arc::clone(&self.store),
            path: path.map_err(ComputeError::engine("naming stored objects"))?,
            key: key.clone(),
        })
    }

    /// Where its rows lie, read once; none where it must be read whole.
    pub(crate) async fn row_index(
        &self,
        stored: &Stored,
    ) -> Result<Option<Arc<RowIndex>>, StorageError> {
        let reading = async { Ok(RowIndex::read(stored).await?.map(Arc::new)) };
        let held = &self.row_indexes;
        held.get_or_insert_async(&stored.path, reading).await
    }

    /// What is known of an object no longer holds.
    pub(crate) fn forget(&self, stored: &Stored) {
        self.row_indexes.remove(&stored.path);
    }

    /// Sums that were found before.
    pub(crate) fn remembered(&self) -> &Remembered {
        &self.sums
    }

    /// Shares of cells that were worked out last.
    pub(crate) fn shares(&self) -> &HeldShares {
        &self.shares
    }

    /// Versions whose values along time are held.
    pub(crate) fn open_versions(&self) -> &OpenVersions {
        &self.open_versions
    }

    /// Values of a version along time, by its name: for who is sent a piece of a question about it. None where these objects
    /// have no store that versions are read from.
    ///
    /// # Errors
    /// A store that does not answer; a manifest or cube that cannot be read.
    pub(crate) async fn values(
        &self,
        id: &ManifestId,
    ) -> Result<Option<cube::Values>, ComputeError> {
        let Some(Storing { store, .. }) = &self.storing else {
            return Ok(None);
        };
        if let Some(held) = self.open_versions.held(id).await? {
            return Ok(Some(held));
        }
        let manifest = manifests::load(store, id).await?;
        let opened = self.open_versions.opened(store, &manifest, id).await?;
        Ok(Some(opened))
    }

    /// The extent of a region by the digest of the region and of how it is measured: measured once, whoever asks, and left when all who asked
    /// have.
    pub(crate) async fn extent(
        &self,
        name: &Digest,
        measure: impl FnOnce(&Awaited) -> Result<Extent, ComputeError> + Send + 'static,
    ) -> Result<Extent, ComputeError> {
        let work = self.measuring.join(&name.to_string());
        let measured = work.done(measure);
        self.extents.get_or_insert_async(name, measured).await
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
