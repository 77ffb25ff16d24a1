//! The object store: keys in, bytes out; objects are created once and never change, but for those of `swap`.
//!
//! One handle for a folder, memory, and the buckets and file systems of other machines. What differs between them is
//! how an object is created once (`create`), who tries again after a failure that may pass (the clouds' clients
//! themselves, `retry_store` for HDFS), and nothing else.

mod answers;
mod check;
mod checked;
mod clouds;
mod create;
#[cfg(test)]
mod faulty;
mod flushed;
mod folder;
mod hdfs;
mod held_pages;
mod leftovers;
mod location;
mod newest;
mod outage;
mod read;
mod retry_store;
mod settings;
mod shared_parts;
mod swap;
mod traffic;
#[cfg(test)]
mod warnings;

use std::fmt::{Debug, Formatter};
use std::path::{Path as FilePath, PathBuf};
use std::sync::Arc;

use contract::key::ObjectKey;
use contract::kind::Kind;
use object_store::ObjectStore;
use object_store::local::LocalFileSystem;
use object_store::memory::InMemory;
use object_store::path::Path;
use object_store::prefix::PrefixStore;
use url::Url;

use self::checked::Checked;
use self::held_pages::HeldPages;
use self::location::Location;
use self::newest::Newest;
use self::outage::Outage;
use self::shared_parts::SharedParts;
use crate::StorageError;

pub(crate) use self::check::PROBES;
pub use self::leftovers::Leftover;
pub use self::settings::{RetryLimits, Settings};
pub use self::swap::Seen;
pub use self::traffic::{Counts, Traffic};

/// Largest object that is held in memory: a field of 2^28 cells is 1 GiB uncompressed.
pub(crate) const MAX_OBJECT_BYTES: u64 = 2 << 30;
/// Largest object at all, which is stored from a file and read in parts: a field of the largest grid is 8 GiB uncompressed, and
/// parts of 16 MiB are at most 10,000 to a bucket.
const MAX_SPOOLED_BYTES: u64 = 16 << 30;
/// Large objects are read and sent in parts of this size.
const PART_BYTES: u64 = 16 << 20;
/// Parts under way at a time.
const PARTS_AT_ONCE: usize = 4;

/// A handle on one object store; clones share it.
#[derive(Clone)]
pub struct Store {
    /// The objects by their keys.
    objects: Arc<dyn ObjectStore>,
    /// The same objects by bucket and path, as SQL scans name them.
    root: Arc<dyn ObjectStore>,
    root_url: Url,
    /// Where keys begin, ending in `/`.
    url: String,
    place: Place,
    retry_limits: RetryLimits,
    /// Objects that wait until the store takes them.
    outage: Arc<Outage>,
    checked: Arc<Checked>,
    /// Where requests are counted, if they are.
    traffic: Option<Arc<Traffic>>,
    /// Does a layer of somebody's see its requests?
    is_layered: bool,
    /// Pages of manifests that were read.
    pub(crate) pages: Arc<HeldPages>,
    /// Parts of objects that never change.
    parts: Arc<SharedParts>,
    /// The newest numbers of manifests that were seen.
    pub(crate) newest: Arc<Newest>,
    /// The same store without the fields of attached products, if it has them.
    pub(crate) bare: Option<Box<Self>>,
}

/// What kind of store it is, where that matters.
#[derive(Clone)]
enum Place {
    Memory,
    /// The folder, with all links resolved.
    Folder(PathBuf),
    Cloud,
    Hdfs,
}

impl Store {
    /// Opens `memory:`, a folder (also as `file:FOLDER`; made if absent), `s3://BUCKET/PREFIX`, `gs://BUCKET/PREFIX`,
    /// `az://CONTAINER/PREFIX` or `hdfs://HOST:PORT/PREFIX`. Credentials and endpoints come from the variables of the
    /// environment that each of them is known by.
    ///
    /// Nothing is sent: whether the store answers is for [`Store::check_writable`] to find out.
    ///
    /// # Errors
    /// `Location`, with what to give or set.
    pub fn open(location: &str) -> Result<Self, StorageError> {
        Self::open_with(location, &Settings::from_environment())
    }

    /// Opens a store of others, to be read: as [`Store::open`] does, and where the environment holds no credentials of its kind,
    /// as anybody may.
    pub fn open_of_others(location: &str) -> Result<Self, StorageError> {
        Self::open_with(location, &Settings::from_environment().as_anybody())
    }

    /// Opens a store with settings other than this process' environment.
    pub fn open_with(location: &str, settings: &Settings) -> Result<Self, StorageError> {
        let bad = |reason: String| StorageError::Location {
            location: location::shown(location),
            reason,
        };
        let retry_limits = settings.retry_limits;
        match location::parse(location).map_err(bad)? {
            Location::Memory => Ok(Self::memory()),
            Location::Folder(folder) => Self::folder(&folder).map_err(bad),
            Location::Bucket {
                cloud,
                name,
                prefix,
            } => {
                let root = clouds::open(cloud, &name, settings).map_err(bad)?;
                let root_url = format!("{}://{name}/", cloud.scheme());
                Self::remote(root, &root_url, &prefix, Place::Cloud, retry_limits).map_err(bad)
            }
            Location::Hdfs { node, prefix } => {
                let root = hdfs::open(&node, settings).map_err(bad)?;
                let root_url = format!("hdfs://{node}/");
                Self::remote(root, &root_url, &prefix, Place::Hdfs, retry_limits).map_err(bad)
            }
        }
    }

    /// A store that is gone with the process.
    pub fn memory() -> Self {
        let root: Arc<dyn ObjectStore> = Arc::new(InMemory::new());
        Self {
            objects: Arc::clone(&root),
            root,
            root_url: Url::parse("memory:///").expect("this text is a URL"),
            url: "memory:///".to_owned(),
            place: Place::Memory,
            retry_limits: RetryLimits::default(),
            outage: Arc::new(Outage::of("objects")),
            checked: Arc::default(),
            traffic: None,
            is_layered: false,
            pages: Arc::default(),
            parts: Arc::default(),
            newest: Arc::default(),
            bare: None,
        }
    }

    fn folder(folder: &FilePath) -> Result<Self, String> {
        std::fs::create_dir_all(folder).map_err(|e| e.to_string())?;
        let root = std::fs::canonicalize(folder).map_err(|e| e.to_string())?;
        let text = root.to_str().ok_or("its path is not UTF-8")?;
        let objects = LocalFileSystem::new_with_prefix(&root)
            .map_err(|e| e.to_string())?
            // A folder is there as long as an object is in it, as in every other store.
            .with_automatic_cleanup(true);
        Ok(Self {
            objects: Arc::new(objects),
            root: Arc::new(LocalFileSystem::new()),
            root_url: Url::parse("file:///").expect("this text is a URL"),
            url: format!("file://{}/", text.trim_end_matches('/')),
            place: Place::Folder(root),
            retry_limits: RetryLimits::default(),
            outage: Arc::new(Outage::of("objects")),
            checked: Arc::default(),
            traffic: None,
            is_layered: false,
            pages: Arc::default(),
            parts: Arc::default(),
            newest: Arc::default(),
            bare: None,
        })
    }

    fn remote(
        root: Arc<dyn ObjectStore>,
        root_url: &str,
        prefix: &Path,
        place: Place,
        retry_limits: RetryLimits,
    ) -> Result<Self, String> {
        let slash = if prefix.as_ref().is_empty() { "" } else { "/" };
        Ok(Self {
            objects: Arc::new(PrefixStore::new(Arc::clone(&root), prefix.clone())),
            root,
            root_url: Url::parse(root_url).map_err(|e| e.to_string())?,
            url: format!("{root_url}{prefix}{slash}"),
            place,
            retry_limits,
            outage: Arc::new(Outage::of("objects")),
            checked: Arc::default(),
            traffic: None,
            is_layered: false,
            pages: Arc::default(),
            parts: Arc::default(),
            newest: Arc::default(),
            bare: None,
        })
    }

    /// Where keys begin, ending in `/`. [`Store::open`] of it is this store again, but for `memory:`.
    pub fn url(&self) -> &str {
        &self.url
    }

    /// Is it behind a network?
    pub fn is_remote(&self) -> bool {
        match self.place {
            Place::Memory | Place::Folder(_) => false,
            Place::Cloud | Place::Hdfs => true,
        }
    }

    /// Where an object is, for people and for `Store::open`'s kind of text; a folder's name is not escaped.
    pub fn url_of(&self, key: &ObjectKey) -> String {
        format!("{}{key}", self.url)
    }

    /// The same store, its requests passing through a layer of the caller's, which counts them, say, or delays them. A folder
    /// creates its objects beside it.
    #[must_use]
    pub fn through(&self, layer: impl Fn(Arc<dyn ObjectStore>) -> Arc<dyn ObjectStore>) -> Self {
        Self {
            objects: layer(Arc::clone(&self.objects)),
            root: layer(Arc::clone(&self.root)),
            is_layered: true,
            ..self.clone()
        }
    }

    /// The file that holds an object of a folder: a thread of its own that reads many small parts of many objects takes a tenth of what
    /// a request each takes. None of another store, where a layer is to see requests, and of fields that may lie elsewhere.
    pub fn file(&self, key: &ObjectKey) -> Option<PathBuf> {
        let is_elsewhere = self.bare.is_some() && Kind::of(key) == Some(Kind::Field);
        (!is_elsewhere).then(|| self.field_file(key)).flatten()
    }

    /// The same of a field, which lies there if it is not one of an attached product's: then the store is to be asked.
    pub fn field_file(&self, key: &ObjectKey) -> Option<PathBuf> {
        match &self.place {
            Place::Folder(root) if !self.is_layered => Some(root.join(key.as_str())),
            Place::Folder(_) | Place::Memory | Place::Cloud | Place::Hdfs => None,
        }
    }

    /// Do its requests pass through a layer that is to see them all?
    pub(crate) fn is_layered(&self) -> bool {
        self.is_layered
    }

    /// The same store, which lies over a bare one: what differs are fields alone.
    #[must_use]
    pub(crate) fn over(self, bare: Box<Self>, is_layered: bool) -> Self {
        Self {
            bare: Some(bare),
            is_layered,
            ..self
        }
    }

    /// What SQL scans register, once for all objects: a URL of a scheme and a host, and the store that answers for
    /// every path below it. [`Store::sql_url`] names an object in it.
    pub fn sql_root(&self) -> (Url, Arc<dyn ObjectStore>) {
        (self.root_url.clone(), Arc::clone(&self.root))
    }

    /// Address of one object for SQL scans, escaped as a URL must be.
    pub fn sql_url(&self, key: &ObjectKey) -> Url {
        match &self.place {
            Place::Folder(root) => Url::from_file_path(root.join(key.as_str()))
                .expect("the folder's path is absolute and UTF-8"),
            Place::Memory | Place::Cloud | Place::Hdfs => Url::parse(&self.url_of(key))
                .expect("prefix and key hold only signs that a URL may hold"),
        }
    }

    /// The store by its keys, for libraries that read by themselves.
    pub fn object_store(&self) -> Arc<dyn ObjectStore> {
        Arc::clone(&self.objects)
    }
}

/// Shows where it is and no more: clients hold credentials.
impl Debug for Store {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Store").field(&self.url).finish()
    }
}

fn path(key: &ObjectKey) -> Path {
    Path::from(key.as_str())
}

pub(crate) fn failed(key: impl std::fmt::Display, source: object_store::Error) -> StorageError {
    StorageError::Object {
        key: key.to_string(),
        source,
    }
}

#[cfg(test)]
mod tests;
