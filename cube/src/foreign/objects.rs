//! Objects of a store of others, to read: by name, whole or in part.

use std::fmt::Debug;
use std::path::Path as FilePath;
use std::sync::Arc;

use async_trait::async_trait;
use bytes::Bytes;
use object_store::path::Path;
use object_store::{Error, GetOptions, GetRange, ObjectStore, ObjectStoreExt as _};
use storage::attached::Cause;
use storage::refusal::Refusal;
use storage::{StorageError, Store};

use super::error::ForeignError;

/// What holds objects; nothing of it can be written.
#[async_trait]
pub trait Objects: Debug + Send + Sync {
    /// Where it is, for people: without anything secret.
    fn place(&self) -> String;

    /// An object, or a part of it; none if it is not there.
    ///
    /// # Errors
    /// More than `most_bytes` would come: they are not fetched. The store does not answer, or not to us.
    async fn get(
        &self,
        name: &str,
        part: Option<GetRange>,
        most_bytes: u64,
    ) -> Result<Option<Bytes>, ForeignError>;

    /// The size of an object, bytes; none if it is not there.
    async fn size(&self, name: &str) -> Result<Option<u64>, ForeignError>;

    /// Names of what lies directly in a folder (`""`: the whole); none where nothing can be listed.
    async fn folders(&self, folder: &str) -> Result<Option<Vec<String>>, ForeignError>;
}

/// Objects in a folder or a bucket.
#[derive(Debug)]
pub struct StoredObjects {
    objects: Arc<dyn ObjectStore>,
    place: String,
}

impl StoredObjects {
    /// Opens a folder that is there, or the part of a bucket below a prefix: `s3://BUCKET/PREFIX` and the like, with credentials
    /// from the variables of the environment that their clouds know; where there are none, as anybody.
    ///
    /// # Errors
    /// There is no such folder, or it is no such address.
    pub fn open(location: &str) -> Result<Self, ForeignError> {
        let shown = |e: StorageError| match e {
            StorageError::Location { location, reason } => ForeignError::refused(location, reason),
            other => ForeignError::refused("the store", other.to_string()),
        };
        let folder = location.strip_prefix("file://").unwrap_or(location);
        let is_folder = !folder.contains("://");
        // Opening a folder would make it.
        if is_folder && FilePath::new(folder).is_file() {
            let reason = "it is a file and no folder of a Zarr or Icechunk store; files are landed with `fluxglobe ingest`";
            return Err(ForeignError::refused(location, reason));
        }
        if is_folder && !FilePath::new(folder).is_dir() {
            return Err(ForeignError::absent(location, "there is no such folder"));
        }
        let store =
            Store::open_of_others(if is_folder { folder } else { location }).map_err(shown)?;
        let place = store.url().trim_end_matches('/');
        let place = place.strip_prefix("file://").unwrap_or(place).to_owned();
        Ok(Self {
            objects: store.object_store(),
            place,
        })
    }

    fn path(&self, name: &str) -> Result<Path, ForeignError> {
        Path::parse(name).map_err(|e| ForeignError::refused(&self.place, e.to_string()))
    }

    /// Why an object did not come; none if it is not there.
    fn failed(&self, name: &str, error: Error) -> Option<ForeignError> {
        let place = format!("{}/{name}", self.place);
        let place = place.trim_end_matches('/');
        let Some(refusal) = Refusal::of(&error) else {
            let key = name.to_owned();
            let error = StorageError::Object { key, source: error };
            let reason = error.to_string();
            return Some(if error.is_retryable() {
                ForeignError::away(place, reason)
            } else {
                ForeignError::refused(place, reason)
            });
        };
        let is_absent = matches!(refusal, Refusal::Bucket(_));
        let reason = match refusal {
            Refusal::Absent => return None,
            Refusal::Credentials(said) => format!(
                "the store does not let it be read ({said}): the credentials of the environment (docs/operations.md) are missing, \
                 wrong or have ended; set such as may read it and start again. Without any, what is open to everybody is read"
            ),
            Refusal::Bucket(said) => format!(
                "there is no such bucket ({said}): look at its name, and at the endpoint that the environment names"
            ),
            Refusal::Region(said) => format!(
                "the bucket is in another region ({said}): set AWS_REGION to that of the bucket, or AWS_ENDPOINT_URL to its server"
            ),
            Refusal::Request(said) => format!(
                "the store takes no such request ({said}): look at region, endpoint and token in the environment (docs/operations.md)"
            ),
        };
        Some(ForeignError {
            is_absent,
            ..ForeignError::denied(place, reason)
        })
    }
}

#[async_trait]
impl Objects for StoredObjects {
    fn place(&self) -> String {
        self.place.clone()
    }

    async fn get(
        &self,
        name: &str,
        part: Option<GetRange>,
        most_bytes: u64,
    ) -> Result<Option<Bytes>, ForeignError> {
        let options = GetOptions {
            range: part,
            ..GetOptions::default()
        };
        let found = match self.objects.get_opts(&self.path(name)?, options).await {
            Ok(found) => found,
            Err(e) => return self.failed(name, e).map_or(Ok(None), Err),
        };
        let size_bytes = found.range.end - found.range.start;
        if size_bytes > most_bytes {
            return Err(too_large(
                &format!("{}/{name}", self.place),
                size_bytes,
                most_bytes,
            ));
        }
        match found.bytes().await {
            Ok(content) => Ok(Some(content)),
            Err(e) => self.failed(name, e).map_or(Ok(None), Err),
        }
    }

    async fn size(&self, name: &str) -> Result<Option<u64>, ForeignError> {
        let path = self.path(name)?;
        match self.objects.head(&path).await {
            Ok(meta) => return Ok(Some(meta.size)),
            Err(e) if Refusal::of(&e).is_none() => {
                return self.failed(name, e).map_or(Ok(None), Err);
            }
            Err(_refused) => {}
        }
        // The answer to HEAD has no body: whether it is the object that is not there, or its bucket, only that of GET tells.
        let options = GetOptions {
            range: Some(GetRange::Bounded(0..1)),
            ..GetOptions::default()
        };
        match self.objects.get_opts(&path, options).await {
            Ok(found) => Ok(Some(found.meta.size)),
            Err(e) => self.failed(name, e).map_or(Ok(None), Err),
        }
    }

    async fn folders(&self, folder: &str) -> Result<Option<Vec<String>>, ForeignError> {
        let path = self.path(folder)?;
        let found = match self.objects.list_with_delimiter(Some(&path)).await {
            Ok(found) => found,
            // What may be read need not be what may be listed.
            Err(e) => match self.failed(folder, e) {
                None => return Ok(Some(vec![])),
                Some(e) if e.cause == Cause::Access => return Ok(None),
                Some(e) => return Err(e),
            },
        };
        let folders = found.common_prefixes.iter();
        let mut names: Vec<String> = folders
            .filter_map(|path| Some(path.filename()?.to_owned()))
            .collect();
        names.sort();
        Ok(Some(names))
    }
}

/// The refusal of an object that is larger than may be.
pub(super) fn too_large(place: &str, size_bytes: u64, most_bytes: u64) -> ForeignError {
    let reason = format!("has {size_bytes} bytes, at most {most_bytes} are read");
    ForeignError::refused(place, reason)
}
