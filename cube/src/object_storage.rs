//! Icechunk's objects in our store: one layer of requests, retries and metrics for all that is stored.
//!
//! All objects are created once but `repo`, which says what the newest state is; it goes through the store's exchange
//! ([`storage::Store::swap`]), which two processes cannot both win. Icechunk asks to keep every `repo` that was replaced;
//! that is not done: nobody reads them, and they would come to grow with the square of the commits.
//!
//! All but chunks are sealed when they are written and compared with their seal when they are read: chunks have checksums,
//! and what names them would be taken for whole with any bit flipped.

use std::fmt::{Debug, Display, Formatter};
use std::ops::Range;
use std::path::PathBuf;
use std::pin::Pin;

use async_trait::async_trait;
use bytes::Bytes;
use chrono::{DateTime, Utc};
use contract::key::ObjectKey;
use contract::kind::Kind;
use futures::stream::{self, BoxStream, Stream, StreamExt as _, TryStreamExt as _};
use icechunk::format::snapshot::Snapshot;
use icechunk::format::{CONFIG_FILE_PATH, REPO_INFO_FILE_PATH};
use icechunk::storage::{
    DeleteObjectsResult, ETag, Generation, GetModifiedResult, ListInfo, RetriesSettings, Settings,
    Storage, StorageContext, StorageError, StorageErrorKind, StorageInfo, StorageResult,
    VersionInfo, VersionedUpdateResult,
};
use icechunk_storage::sealed::Sealed;
use object_store::path::Path;
use object_store::{GetOptions, GetRange, ObjectStoreExt as _};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use storage::store::Seen;
use storage::{Store, sound};

use crate::error::MAY_PASS;

type Pieces = Pin<Box<dyn Stream<Item = Result<Bytes, StorageError>> + Send>>;

/// A folder of a store as a place for a repository.
#[derive(Clone)]
pub(crate) struct ObjectStorage {
    store: Store,
    /// Without a slash at its end; empty for the whole store.
    folder: String,
}

impl ObjectStorage {
    pub(crate) fn new(store: Store, folder: &str) -> Self {
        Self {
            store,
            folder: folder.trim_matches('/').to_owned(),
        }
    }

    fn path(&self, name: &str) -> String {
        match (self.folder.as_str(), name.trim_matches('/')) {
            ("", name) => name.to_owned(),
            (folder, "") => folder.to_owned(),
            (folder, name) => format!("{folder}/{name}"),
        }
    }

    fn key(&self, name: &str) -> StorageResult<ObjectKey> {
        let key = self.path(name).parse();
        key.map_err(|e: contract::ContractError| other(&e))
    }

    /// The file of a chunk that the repository names so, where there is one to read from.
    pub(crate) fn file(&self, chunk: &str) -> Option<PathBuf> {
        let key = self.path(&format!("chunks/{chunk}")).parse().ok()?;
        self.store.file(&key)
    }

    /// Parts of a chunk that the repository names so, in the order of their ranges; questions share them.
    pub(crate) async fn parts(
        &self,
        chunk: &str,
        ranges: &[Range<u64>],
    ) -> Result<Vec<Bytes>, String> {
        let path = Path::from(self.path(&format!("chunks/{chunk}")));
        let found = self.store.shared_parts(&path, ranges).await;
        found.map_err(|source| told(&of_object(&path, source)))
    }

    async fn read_changing(&self, name: &str) -> StorageResult<(Bytes, VersionInfo)> {
        let found = self.store.read_changing(&self.key(name)?).await;
        match found.map_err(|e| failed(&e))? {
            Some((content, seen)) => Ok((content, version(seen))),
            None => Err(not_found()),
        }
    }

    async fn read(
        &self,
        name: &str,
        range: Option<&Range<u64>>,
    ) -> StorageResult<(Bytes, VersionInfo)> {
        if changes(name) {
            let (content, version) = self.read_changing(name).await?;
            self.check(name, &content)?;
            return Ok((part(&content, range), version));
        }
        // A seal is one of the whole.
        let is_sealed = sound::cube::sealed(name, &[]).is_some();
        let options = GetOptions {
            range: range.filter(|_| !is_sealed).cloned().map(GetRange::Bounded),
            ..GetOptions::default()
        };
        let path = Path::from(self.path(name));
        let found = self.store.object_store().get_opts(&path, options).await;
        let answered = |e| answered(&path, e);
        let found = found.map_err(answered)?;
        let version = VersionInfo {
            etag: found.meta.e_tag.clone().map(ETag),
            generation: found.meta.version.clone().map(Generation),
        };
        let content = found.bytes().await.map_err(answered)?;
        if is_sealed {
            self.check(name, &content)?;
            return Ok((part(&content, range), version));
        }
        Ok((content, version))
    }

    fn check(&self, name: &str, content: &[u8]) -> StorageResult<()> {
        let key = self.key(name)?;
        // Others may write to what was exported.
        let checked = if Kind::of(&key) == Some(Kind::Cube) {
            sound::cube::check_own(name, content)
        } else {
            sound::cube::check(name, content).map(|_soundness| ())
        };
        checked.map_err(|reason| other(&sound::damage::found(&key, reason)))
    }
}

fn part(content: &Bytes, range: Option<&Range<u64>>) -> Bytes {
    let length = content.len() as u64;
    let (start, end) = range.map_or((0, length), |it| (it.start, it.end.min(length)));
    content.slice(start.min(end) as usize..end as usize)
}

/// Is this the name of an object that is replaced?
fn changes(name: &str) -> bool {
    name == REPO_INFO_FILE_PATH || name == CONFIG_FILE_PATH
}

/// Is this the name of a part of the empty state that each repository begins with?
pub(crate) fn is_initial(name: &str) -> bool {
    name.ends_with(&Snapshot::INITIAL_SNAPSHOT_ID.to_string())
}

fn version(seen: Seen) -> VersionInfo {
    VersionInfo {
        etag: seen.tag.map(ETag),
        generation: seen.version.map(Generation),
    }
}

/// None for something that is not there yet.
fn seen(version: &VersionInfo) -> Option<Seen> {
    (!version.is_create()).then(|| Seen {
        tag: version.etag().cloned(),
        version: version.generation().cloned(),
    })
}

fn other(error: &dyn Display) -> StorageError {
    StorageError::capture(StorageErrorKind::Other(error.to_string()))
}

fn not_found() -> StorageError {
    StorageError::capture(StorageErrorKind::ObjectNotFound)
}

fn failed(error: &storage::StorageError) -> StorageError {
    if error.is_not_found() {
        not_found()
    } else {
        other(&told(error))
    }
}

fn answered(path: &Path, error: object_store::Error) -> StorageError {
    failed(&of_object(path, error))
}

fn of_object(path: &Path, source: object_store::Error) -> storage::StorageError {
    storage::StorageError::Object {
        key: path.to_string(),
        source,
    }
}

/// What libraries hand on of a failure of the store: nobody can ask it any more whether it may pass.
fn told(error: &storage::StorageError) -> String {
    if error.is_retryable() {
        format!("{MAY_PASS}: {error}")
    } else {
        error.to_string()
    }
}

impl Debug for ObjectStorage {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        Display::fmt(self, f)
    }
}

impl Display for ObjectStorage {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}{}", self.store.url(), self.folder)
    }
}

/// A store holds credentials and connections: it stays in its process, and so do sessions.
const STAYS: &str = "a store is not sent to another process: open it there by its URL";

impl Serialize for ObjectStorage {
    fn serialize<S: Serializer>(&self, _serializer: S) -> Result<S::Ok, S::Error> {
        Err(serde::ser::Error::custom(STAYS))
    }
}

impl<'de> Deserialize<'de> for ObjectStorage {
    fn deserialize<D: Deserializer<'de>>(_deserializer: D) -> Result<Self, D::Error> {
        Err(serde::de::Error::custom(STAYS))
    }
}

impl Sealed for ObjectStorage {}

#[async_trait]
#[typetag::serde(name = "fluxglobe_store")]
impl Storage for ObjectStorage {
    fn storage_info(&self) -> StorageInfo {
        StorageInfo {
            backend_type: "fluxglobe store",
            fields: vec![("url", self.to_string())],
        }
    }

    async fn default_settings(&self) -> StorageResult<Settings> {
        Ok(Settings {
            // The store itself tries again.
            retries: Some(RetriesSettings {
                max_tries: Some(std::num::NonZeroU16::MIN),
                ..RetriesSettings::default()
            }),
            unsafe_use_metadata: Some(false),
            ..Settings::default()
        })
    }

    async fn can_write(&self) -> StorageResult<bool> {
        Ok(true)
    }

    async fn get_object_range(
        &self,
        _ctx: &StorageContext<'_>,
        path: &str,
        range: Option<&Range<u64>>,
    ) -> StorageResult<(Pieces, VersionInfo)> {
        let (content, version) = self.read(path, range).await?;
        Ok((stream::once(async { Ok(content) }).boxed(), version))
    }

    async fn put_object(
        &self,
        _ctx: &StorageContext<'_>,
        path: &str,
        bytes: Bytes,
        _content_type: Option<&str>,
        _metadata: Vec<(String, String)>,
        previous_version: Option<&VersionInfo>,
    ) -> StorageResult<VersionedUpdateResult> {
        let key = self.key(path)?;
        let bytes = sound::cube::sealed(path, &bytes).map_or(bytes, Bytes::from);
        let Some(previous) = previous_version else {
            match self.store.put_new(&key, bytes).await {
                // Two that make a repository at once both write its empty state, with a time in it.
                Err(storage::StorageError::Conflict { .. }) if is_initial(path) => {}
                put => drop(put.map_err(|e| failed(&e))?),
            }
            return Ok(VersionedUpdateResult::Updated {
                new_version: VersionInfo::for_creation(),
            });
        };
        let swapped = self.store.swap(&key, seen(previous).as_ref(), bytes).await;
        Ok(match swapped.map_err(|e| failed(&e))? {
            Some(seen) => VersionedUpdateResult::Updated {
                new_version: version(seen),
            },
            None => VersionedUpdateResult::NotOnLatestVersion,
        })
    }

    async fn copy_object(
        &self,
        _ctx: &StorageContext<'_>,
        _from: &str,
        _to: &str,
        _content_type: Option<&str>,
        version: &VersionInfo,
    ) -> StorageResult<VersionedUpdateResult> {
        // Asked for only to keep what is about to be replaced, and the exchange compares what it replaces.
        Ok(VersionedUpdateResult::Updated {
            new_version: version.clone(),
        })
    }

    async fn list_objects<'a>(
        &'a self,
        _ctx: &StorageContext<'_>,
        prefix: &str,
    ) -> StorageResult<BoxStream<'a, StorageResult<ListInfo<String>>>> {
        let folder = Path::from(self.path(prefix));
        let found = self.store.object_store().list(Some(&folder));
        let asked = folder.clone();
        let found = found.map_err(move |e| answered(&asked, e));
        let listed = found.try_filter_map(move |meta| {
            let name = meta.location.as_ref();
            let name = name.strip_prefix(folder.as_ref()).unwrap_or(name);
            let id = name.trim_start_matches('/').to_owned();
            // Names that are no keys are those of half-written objects.
            let info = id.parse::<ObjectKey>().ok().map(|_key| ListInfo {
                id,
                created_at: meta.last_modified,
                size_bytes: meta.size,
            });
            async move { Ok(info) }
        });
        Ok(listed.boxed())
    }

    async fn delete_batch(
        &self,
        _ctx: &StorageContext<'_>,
        prefix: &str,
        batch: Vec<(String, u64)>,
    ) -> StorageResult<DeleteObjectsResult> {
        let mut deleted = DeleteObjectsResult::default();
        for (id, size_bytes) in batch {
            let key = self.key(&format!("{prefix}/{id}"))?;
            self.store.remove(&key).await.map_err(|e| failed(&e))?;
            deleted.deleted_objects += 1;
            deleted.deleted_bytes += size_bytes;
        }
        Ok(deleted)
    }

    async fn get_object_last_modified(
        &self,
        _ctx: &StorageContext<'_>,
        path: &str,
    ) -> StorageResult<DateTime<Utc>> {
        let path = Path::from(self.path(path));
        let meta = self.store.object_store().head(&path).await;
        let meta = meta.map_err(|e| answered(&path, e))?;
        Ok(meta.last_modified)
    }

    async fn get_object_conditional(
        &self,
        _ctx: &StorageContext<'_>,
        path: &str,
        previous_version: Option<&VersionInfo>,
    ) -> StorageResult<GetModifiedResult> {
        let (content, new_version) = self.read(path, None).await?;
        if previous_version == Some(&new_version) {
            return Ok(GetModifiedResult::OnLatestVersion);
        }
        Ok(GetModifiedResult::Modified {
            data: Box::pin(std::io::Cursor::new(content)),
            new_version,
        })
    }
}
