//! Objects of others as Icechunk reads a repository: nothing is ever written, listed or removed.

use std::fmt::{Debug, Display, Formatter};
use std::ops::Range;
use std::pin::Pin;
use std::sync::Arc;

use async_trait::async_trait;
use bytes::Bytes;
use chrono::{DateTime, Utc};
use futures::stream::{self, BoxStream, Stream, StreamExt as _};
use icechunk::storage::{
    DeleteObjectsResult, GetModifiedResult, ListInfo, Settings, Storage, StorageContext,
    StorageError, StorageErrorKind, StorageInfo, StorageResult, VersionInfo, VersionedUpdateResult,
};
use icechunk_storage::sealed::Sealed;
use object_store::GetRange;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use storage::sound;

use super::adapter::MAX_OBJECT_BYTES;
use super::objects::Objects;

type Pieces = Pin<Box<dyn Stream<Item = Result<Bytes, StorageError>> + Send>>;

/// A repository of others.
#[derive(Clone)]
pub(super) struct ReadOnly(pub(super) Arc<dyn Objects>);

fn other(reason: String) -> StorageError {
    StorageError::capture(StorageErrorKind::Other(reason))
}

fn read_only<T>() -> StorageResult<T> {
    Err(other("an attached store is only read".to_owned()))
}

/// What a repository of version 1 says of how it is written, and where virtual chunks lie: nothing that a reader of its chunks needs,
/// and it may name what the library was built without here.
const CONFIGURATION: &str = "config.yaml";

/// What one state names is there as long as the state is.
fn missing(name: &str) -> StorageError {
    let folder = name.split_once('/').map(|(folder, _)| folder);
    match folder {
        Some("snapshots" | "manifests" | "chunks") => other(format!(
            "{name} is not there: the state that needs it was let go (expired), or the repository is not whole"
        )),
        _ => StorageError::capture(StorageErrorKind::ObjectNotFound),
    }
}

impl ReadOnly {
    async fn read(&self, name: &str, range: Option<&Range<u64>>) -> StorageResult<Bytes> {
        if name == CONFIGURATION {
            return Err(missing(name));
        }
        // What this program wrote has seals, which are of the whole; others write none.
        let may_be_sealed = sound::cube::sealed(name, &[]).is_some();
        let part = range
            .filter(|_| !may_be_sealed)
            .cloned()
            .map(GetRange::Bounded);
        let found = self.0.get(name, part, MAX_OBJECT_BYTES).await;
        let found = found.map_err(|e| other(e.to_string()))?;
        let content = found.ok_or_else(|| missing(name))?;
        if !may_be_sealed {
            return Ok(content);
        }
        let whole = sound::cube::check(name, &content);
        whole.map_err(|reason| other(format!("{name} is damaged: {reason}")))?;
        let length = content.len() as u64;
        let (start, end) = range.map_or((0, length), |it| (it.start, it.end.min(length)));
        Ok(content.slice(start.min(end) as usize..end as usize))
    }
}

impl Debug for ReadOnly {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        Display::fmt(self, f)
    }
}

impl Display for ReadOnly {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0.place())
    }
}

/// Connections stay in their process.
const STAYS: &str = "an attached store is not sent to another process: open it there";

impl Serialize for ReadOnly {
    fn serialize<S: Serializer>(&self, _serializer: S) -> Result<S::Ok, S::Error> {
        Err(serde::ser::Error::custom(STAYS))
    }
}

impl<'de> Deserialize<'de> for ReadOnly {
    fn deserialize<D: Deserializer<'de>>(_deserializer: D) -> Result<Self, D::Error> {
        Err(serde::de::Error::custom(STAYS))
    }
}

impl Sealed for ReadOnly {}

#[async_trait]
#[typetag::serde(name = "fluxglobe_attached_store")]
impl Storage for ReadOnly {
    fn storage_info(&self) -> StorageInfo {
        StorageInfo {
            backend_type: "attached store",
            fields: vec![("url", self.to_string())],
        }
    }

    async fn default_settings(&self) -> StorageResult<Settings> {
        Ok(Settings::default())
    }

    async fn can_write(&self) -> StorageResult<bool> {
        Ok(false)
    }

    async fn get_object_range(
        &self,
        _ctx: &StorageContext<'_>,
        path: &str,
        range: Option<&Range<u64>>,
    ) -> StorageResult<(Pieces, VersionInfo)> {
        let content = self.read(path, range).await?;
        let pieces = stream::once(async { Ok(content) }).boxed();
        Ok((pieces, VersionInfo::for_creation()))
    }

    async fn put_object(
        &self,
        _ctx: &StorageContext<'_>,
        _path: &str,
        _bytes: Bytes,
        _content_type: Option<&str>,
        _metadata: Vec<(String, String)>,
        _previous_version: Option<&VersionInfo>,
    ) -> StorageResult<VersionedUpdateResult> {
        read_only()
    }

    async fn copy_object(
        &self,
        _ctx: &StorageContext<'_>,
        _from: &str,
        _to: &str,
        _content_type: Option<&str>,
        _version: &VersionInfo,
    ) -> StorageResult<VersionedUpdateResult> {
        read_only()
    }

    async fn list_objects<'a>(
        &'a self,
        _ctx: &StorageContext<'_>,
        _prefix: &str,
    ) -> StorageResult<BoxStream<'a, StorageResult<ListInfo<String>>>> {
        read_only()
    }

    async fn delete_batch(
        &self,
        _ctx: &StorageContext<'_>,
        _prefix: &str,
        _batch: Vec<(String, u64)>,
    ) -> StorageResult<DeleteObjectsResult> {
        read_only()
    }

    async fn get_object_last_modified(
        &self,
        _ctx: &StorageContext<'_>,
        _path: &str,
    ) -> StorageResult<DateTime<Utc>> {
        read_only()
    }

    async fn get_object_conditional(
        &self,
        _ctx: &StorageContext<'_>,
        path: &str,
        _previous_version: Option<&VersionInfo>,
    ) -> StorageResult<GetModifiedResult> {
        let content = self.read(path, None).await?;
        Ok(GetModifiedResult::Modified {
            data: Box::pin(std::io::Cursor::new(content)),
            new_version: VersionInfo::for_creation(),
        })
    }
}
