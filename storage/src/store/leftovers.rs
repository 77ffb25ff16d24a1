//! Half-written files of killed writers: no object, in nobody's way, and in the end to be removed.

use std::path::Path as FilePath;
use std::time::{Duration, SystemTime};

use chrono::Utc;
use futures::TryStreamExt as _;
use object_store::ObjectStoreExt as _;

use super::{Place, Store, failed, folder, hdfs};
use crate::StorageError;

impl Store {
    /// Removes what killed writers left half-written longer than `age` ago, and tells how much that was.
    ///
    /// `age` must be longer than any write takes. Parts of uploads to a cloud that never ended cannot be listed here:
    /// a lifecycle rule of the bucket takes them away.
    pub async fn remove_leftovers(&self, age: Duration) -> Result<usize, StorageError> {
        match &self.place {
            Place::Memory | Place::Cloud => Ok(0),
            Place::Folder(root) => {
                let (root, shown) = (root.clone(), self.url.clone());
                let removed = tokio::task::spawn_blocking(move || sweep(&root, age)).await;
                let removed = removed.map_err(|e| failed(&shown, e.into()))?;
                removed.map_err(|e| {
                    let source = object_store::Error::Generic {
                        store: "folder",
                        source: e.into(),
                    };
                    failed(&shown, source)
                })
            }
            Place::Hdfs => self.sweep_hdfs(age).await,
        }
    }

    async fn sweep_hdfs(&self, age: Duration) -> Result<usize, StorageError> {
        let mut removed = 0;
        let mut found = self.objects.list(None);
        while let Some(meta) = found.try_next().await.map_err(|e| failed(&self.url, e))? {
            let name = meta.location.filename().unwrap_or_default();
            let is_old = (Utc::now() - meta.last_modified)
                .to_std()
                .is_ok_and(|since| since > age);
            if hdfs::is_half_written(name) && is_old {
                let gone = self.objects.delete(&meta.location).await;
                gone.map_err(|e| failed(&meta.location, e))?;
                removed += 1;
            }
        }
        Ok(removed)
    }
}

fn sweep(folder: &FilePath, age: Duration) -> std::io::Result<usize> {
    let mut removed = 0;
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        let kind = entry.file_type()?;
        let name = entry.file_name();
        if kind.is_dir() {
            removed += sweep(&entry.path(), age)?;
        } else if kind.is_file() && name.to_str().is_some_and(folder::is_half_written) {
            let since = SystemTime::now().duration_since(entry.metadata()?.modified()?);
            if since.is_ok_and(|since| since > age) {
                std::fs::remove_file(entry.path())?;
                removed += 1;
            }
        }
    }
    Ok(removed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytes::Bytes;

    #[tokio::test]
    async fn only_old_half_written_files_are_removed() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(folder.path().to_str().unwrap()).unwrap();
        let key = "a/b".parse().unwrap();
        store.put_new(&key, Bytes::from("x")).await.unwrap();
        let half = folder.path().join("a/c#123000001");
        std::fs::write(&half, "half").unwrap();
        let hour = Duration::from_hours(1);
        assert_eq!(store.remove_leftovers(hour).await.unwrap(), 0);
        assert!(half.exists());
        assert_eq!(store.remove_leftovers(Duration::ZERO).await.unwrap(), 1);
        assert!(!half.exists() && store.exists(&key).await.unwrap());
    }
}
