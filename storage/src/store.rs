//! The object store: keys in, bytes out; objects are created once and never change.

use std::sync::Arc;

use bytes::Bytes;
use contract::key::ObjectKey;
use futures::TryStreamExt as _;
use object_store::local::LocalFileSystem;
use object_store::memory::InMemory;
use object_store::path::Path;
use object_store::{ObjectStore, ObjectStoreExt as _, PutMode, PutOptions, PutPayload};

use crate::StorageError;

/// Largest object that is read whole: a frame of the largest grid is 1 GiB uncompressed.
const MAX_OBJECT_BYTES: u64 = 2 << 30;

/// A handle on one object store; clones share it.
#[derive(Clone, Debug)]
pub struct Store {
    objects: Arc<dyn ObjectStore>,
    /// What SQL scans prefix keys with, ending in `/`.
    url: String,
}

impl Store {
    /// Opens `memory:` or a folder, which is made if absent.
    pub fn open(location: &str) -> Result<Self, StorageError> {
        if location == "memory:" {
            return Ok(Self::memory());
        }
        let bad = |reason: String| StorageError::Location {
            location: location.to_owned(),
            reason,
        };
        let folder = location.strip_prefix("file:").unwrap_or(location);
        if folder.contains("://") {
            return Err(bad("give a folder, file:FOLDER or memory:".to_owned()));
        }
        std::fs::create_dir_all(folder).map_err(|e| bad(e.to_string()))?;
        let root = std::fs::canonicalize(folder).map_err(|e| bad(e.to_string()))?;
        let objects = LocalFileSystem::new_with_prefix(&root).map_err(|e| bad(e.to_string()))?;
        let text = root
            .to_str()
            .ok_or_else(|| bad("its path is not UTF-8".to_owned()))?;
        Ok(Self {
            objects: Arc::new(objects),
            url: format!("file://{}/", text.trim_end_matches('/')),
        })
    }

    /// A store that is gone with the process.
    pub fn memory() -> Self {
        Self {
            objects: Arc::new(InMemory::new()),
            url: "memory:///".to_owned(),
        }
    }

    /// What SQL scans prefix keys with, ending in `/`.
    pub fn url(&self) -> &str {
        &self.url
    }

    /// Address of one object for SQL scans.
    pub fn url_of(&self, key: &ObjectKey) -> String {
        format!("{}{key}", self.url)
    }

    /// The store itself, for libraries that read by themselves.
    pub fn object_store(&self) -> Arc<dyn ObjectStore> {
        Arc::clone(&self.objects)
    }

    /// The whole content of an object.
    pub async fn get(&self, key: &ObjectKey) -> Result<Bytes, StorageError> {
        let found = self
            .objects
            .get(&path(key))
            .await
            .map_err(|e| failed(key, e))?;
        if found.meta.size > MAX_OBJECT_BYTES {
            return Err(StorageError::damaged(
                key.as_str(),
                "it is larger than 2 GiB",
            ));
        }
        found.bytes().await.map_err(|e| failed(key, e))
    }

    /// Is there such an object?
    pub async fn exists(&self, key: &ObjectKey) -> Result<bool, StorageError> {
        match self.objects.head(&path(key)).await {
            Ok(_) => Ok(true),
            Err(object_store::Error::NotFound { .. }) => Ok(false),
            Err(e) => Err(failed(key, e)),
        }
    }

    /// Creates an object: true if written now, false if the same content was there.
    ///
    /// A store can answer "already exists" to its own half-answered request, so on doubt the object is read back
    /// and compared.
    pub async fn put_new(&self, key: &ObjectKey, content: Bytes) -> Result<bool, StorageError> {
        let options = PutOptions {
            mode: PutMode::Create,
            ..PutOptions::default()
        };
        let payload = PutPayload::from_bytes(content.clone());
        match self.objects.put_opts(&path(key), payload, options).await {
            Ok(_) => Ok(true),
            Err(object_store::Error::AlreadyExists { .. }) => {
                if self.get(key).await? == content {
                    Ok(false)
                } else {
                    Err(StorageError::Conflict { key: key.clone() })
                }
            }
            Err(e) => Err(failed(key, e)),
        }
    }

    /// Keys under a folder, sorted.
    pub async fn list(&self, folder: &str) -> Result<Vec<ObjectKey>, StorageError> {
        let found: Vec<_> = self
            .objects
            .list(Some(&Path::from(folder)))
            .try_collect()
            .await
            .map_err(|e| failed(folder, e))?;
        // Names that are no keys of ours (a temporary file of the store, say) are not ours to report.
        let mut keys: Vec<ObjectKey> = found
            .iter()
            .filter_map(|meta| meta.location.as_ref().parse().ok())
            .collect();
        keys.sort();
        Ok(keys)
    }

    /// Names of the folders directly under a folder, sorted.
    pub async fn folders(&self, folder: &str) -> Result<Vec<String>, StorageError> {
        let found = self
            .objects
            .list_with_delimiter(Some(&Path::from(folder)))
            .await
            .map_err(|e| failed(folder, e))?;
        let mut names: Vec<String> = found
            .common_prefixes
            .iter()
            .filter_map(|prefix| {
                prefix
                    .parts()
                    .next_back()
                    .map(|part| part.as_ref().to_owned())
            })
            .collect();
        names.sort();
        Ok(names)
    }
}

fn path(key: &ObjectKey) -> Path {
    Path::from(key.as_str())
}

fn failed(key: impl std::fmt::Display, source: object_store::Error) -> StorageError {
    StorageError::Object {
        key: key.to_string(),
        source,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stores() -> (tempfile::TempDir, Vec<Store>) {
        let folder = tempfile::tempdir().unwrap();
        let local = Store::open(folder.path().to_str().unwrap()).unwrap();
        (folder, vec![local, Store::memory()])
    }

    #[tokio::test]
    async fn an_object_is_created_once_and_never_changes() {
        let (_folder, stores) = stores();
        let key: ObjectKey = "a/b.txt".parse().unwrap();
        for store in stores {
            assert!(!store.exists(&key).await.unwrap());
            assert!(store.put_new(&key, Bytes::from("one")).await.unwrap());
            assert!(!store.put_new(&key, Bytes::from("one")).await.unwrap());
            let other = store.put_new(&key, Bytes::from("two")).await;
            assert!(matches!(other, Err(StorageError::Conflict { .. })));
            assert_eq!(store.get(&key).await.unwrap(), "one");
        }
    }

    #[tokio::test]
    async fn listings_are_sorted_and_name_folders() {
        let (_folder, stores) = stores();
        for store in stores {
            for name in ["m/q/2", "m/p/1", "m/q/1"] {
                let key = name.parse().unwrap();
                store.put_new(&key, Bytes::from("x")).await.unwrap();
            }
            let keys: Vec<_> = store.list("m").await.unwrap();
            let names: Vec<_> = keys.iter().map(ObjectKey::as_str).collect();
            assert_eq!(names, ["m/p/1", "m/q/1", "m/q/2"]);
            assert_eq!(store.folders("m").await.unwrap(), ["p", "q"]);
            assert!(store.folders("nothing").await.unwrap().is_empty());
        }
    }

    #[tokio::test]
    async fn a_missing_object_is_told_from_a_broken_store() {
        let missing = Store::memory().get(&"a/b".parse().unwrap()).await;
        let error = missing.unwrap_err();
        assert!(error.is_not_found() && !error.is_retryable());
    }
}
