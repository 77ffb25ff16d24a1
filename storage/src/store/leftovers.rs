//! Half-written files of killed writers: no object, in nobody's way, and in the end to be removed.

use std::path::{Path as FilePath, PathBuf};
use std::time::{Duration, SystemTime};

use chrono::Utc;
use futures::TryStreamExt as _;
use object_store::ObjectStoreExt as _;

use super::{Place, Store, failed, folder, hdfs};
use crate::StorageError;

/// A half-written file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Leftover {
    /// Where it lies below the store's address.
    pub path: String,
    /// Its size.
    pub size_bytes: u64,
}

impl Store {
    /// What killed writers left half-written longer than `age` ago, sorted by path.
    ///
    /// `age` must be longer than any write takes. Parts of uploads to a cloud that never ended cannot be listed here:
    /// a lifecycle rule of the bucket takes them away.
    pub async fn leftovers(&self, age: Duration) -> Result<Vec<Leftover>, StorageError> {
        let mut found = match &self.place {
            Place::Memory | Place::Cloud => vec![],
            Place::Folder(root) => {
                let own = root.clone();
                let swept = move || {
                    let mut found = vec![];
                    sweep(&own, &own, age, &mut found).map(|()| found)
                };
                self.of_folder(tokio::task::spawn_blocking(swept).await)?
            }
            Place::Hdfs => self.sweep_hdfs(age).await?,
        };
        found.sort_by(|a, b| a.path.cmp(&b.path));
        Ok(found)
    }

    /// Removes what [`Store::leftovers`] finds, and tells how many files that were.
    pub async fn remove_leftovers(&self, age: Duration) -> Result<usize, StorageError> {
        let found = self.leftovers(age).await?;
        for leftover in &found {
            match &self.place {
                Place::Memory | Place::Cloud => {}
                Place::Folder(root) => {
                    let file: PathBuf = root.join(&leftover.path);
                    let removed = tokio::task::spawn_blocking(|| std::fs::remove_file(file));
                    self.of_folder(removed.await)?;
                }
                Place::Hdfs => {
                    let path = object_store::path::Path::parse(&leftover.path)
                        .map_err(|e| failed(&leftover.path, e.into()))?;
                    let gone = self.objects.delete(&path).await;
                    gone.map_err(|e| failed(&path, e))?;
                }
            }
        }
        Ok(found.len())
    }

    fn of_folder<T>(
        &self,
        done: Result<std::io::Result<T>, tokio::task::JoinError>,
    ) -> Result<T, StorageError> {
        let done = done.map_err(|e| failed(&self.url, e.into()))?;
        done.map_err(|e| {
            let source = object_store::Error::Generic {
                store: "folder",
                source: e.into(),
            };
            failed(&self.url, source)
        })
    }

    async fn sweep_hdfs(&self, age: Duration) -> Result<Vec<Leftover>, StorageError> {
        let mut leftovers = vec![];
        let mut found = self.objects.list(None);
        while let Some(meta) = found.try_next().await.map_err(|e| failed(&self.url, e))? {
            let name = meta.location.filename().unwrap_or_default();
            let is_old = (Utc::now() - meta.last_modified)
                .to_std()
                .is_ok_and(|since| since > age);
            if hdfs::is_half_written(name) && is_old {
                leftovers.push(Leftover {
                    path: meta.location.to_string(),
                    size_bytes: meta.size,
                });
            }
        }
        Ok(leftovers)
    }
}

fn sweep(
    root: &FilePath,
    folder: &FilePath,
    age: Duration,
    found: &mut Vec<Leftover>,
) -> std::io::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        let kind = entry.file_type()?;
        let name = entry.file_name();
        if kind.is_dir() {
            sweep(root, &entry.path(), age, found)?;
        } else if kind.is_file() && name.to_str().is_some_and(folder::is_half_written) {
            let metadata = entry.metadata()?;
            let since = SystemTime::now().duration_since(metadata.modified()?);
            // A name that is no text is none of ours.
            let path = entry.path();
            let below = path.strip_prefix(root).ok().and_then(FilePath::to_str);
            if let (true, Some(below)) = (since.is_ok_and(|since| since > age), below) {
                found.push(Leftover {
                    path: below.to_owned(),
                    size_bytes: metadata.len(),
                });
            }
        }
    }
    Ok(())
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
        let found = store.leftovers(Duration::ZERO).await.unwrap();
        assert_eq!(
            found,
            [Leftover {
                path: "a/c#123000001".to_owned(),
                size_bytes: 4
            }]
        );
        assert_eq!(store.remove_leftovers(Duration::ZERO).await.unwrap(), 1);
        assert!(!half.exists() && store.exists(&key).await.unwrap());
    }
}
