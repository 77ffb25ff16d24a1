//! Reading, listing and removing objects.

use bytes::{Bytes, BytesMut};
use contract::key::ObjectKey;
use contract::time::TimeMs;
use futures::{StreamExt as _, TryStreamExt as _, stream};
use object_store::path::Path;
use object_store::{Error, GetResultPayload, ObjectStoreExt as _};

use super::{MAX_OBJECT_BYTES, PART_BYTES, PARTS_AT_ONCE, Place, Store, failed, hdfs, path};
use crate::StorageError;
use crate::sound::{self, Soundness};

impl Store {
    /// The whole content of an object, compared with its name or its seal. Large ones come in parts, several at a time.
    ///
    /// # Errors
    /// `is_not_found` if there is no such object; `Damaged` if its bytes are not those that were stored.
    pub async fn get(&self, key: &ObjectKey) -> Result<Bytes, StorageError> {
        self.get_with_soundness(key)
            .await
            .map(|(content, _)| content)
    }

    /// The same, and whether there was anything to compare it with.
    pub async fn get_with_soundness(
        &self,
        key: &ObjectKey,
    ) -> Result<(Bytes, Soundness), StorageError> {
        let content = self.fetch(key).await?;
        let soundness = sound::of_large(key, &content).await?;
        Ok((content, soundness))
    }

    /// The bytes under a key, whatever they are.
    pub(crate) async fn fetch(&self, key: &ObjectKey) -> Result<Bytes, StorageError> {
        let found = self.fetch_up_to(key, MAX_OBJECT_BYTES).await?;
        let larger = "it is larger than the 2 GiB that are read at once";
        found.ok_or_else(|| StorageError::damaged(key.as_str(), larger))
    }

    /// The same of an object of at most so many bytes; none if it is larger.
    pub(crate) async fn fetch_up_to(
        &self,
        key: &ObjectKey,
        most_bytes: u64,
    ) -> Result<Option<Bytes>, StorageError> {
        let path = path(key);
        let found = self.objects.get(&path).await.map_err(|e| failed(key, e))?;
        let size_bytes = found.meta.size;
        if size_bytes > most_bytes {
            return Ok(None);
        }
        let is_file = matches!(found.payload, GetResultPayload::File(..));
        if is_file || size_bytes <= PART_BYTES {
            let content = found.bytes().await.map_err(|e| failed(key, e))?;
            return Ok(Some(content));
        }
        drop(found);
        let starts = (0..size_bytes).step_by(PART_BYTES as usize);
        let ranges = starts.map(|start| start..size_bytes.min(start + PART_BYTES));
        let mut parts = stream::iter(ranges)
            .map(|range| self.objects.get_range(&path, range))
            .buffered(PARTS_AT_ONCE);
        let mut content = BytesMut::with_capacity(size_bytes as usize);
        while let Some(part) = parts.try_next().await.map_err(|e| failed(key, e))? {
            content.extend_from_slice(&part);
        }
        if content.len() as u64 != size_bytes {
            let reason = format!("{} of {size_bytes} bytes came", content.len());
            return Err(StorageError::damaged(key.as_str(), reason));
        }
        Ok(Some(content.freeze()))
    }

    /// A part of an object, `range_bytes` from its beginning. It is not checked: whoever reads parts has a check of them.
    ///
    /// # Errors
    /// `Damaged` if the object is shorter.
    pub async fn get_range(
        &self,
        key: &ObjectKey,
        range_bytes: std::ops::Range<u64>,
    ) -> Result<Bytes, StorageError> {
        let length_bytes = range_bytes.end.saturating_sub(range_bytes.start);
        if length_bytes == 0 {
            return Ok(Bytes::new());
        }
        let size_bytes = self.size_bytes(key).await?;
        if range_bytes.end > size_bytes {
            let reason = format!("bytes {range_bytes:?} of {size_bytes} were asked for");
            return Err(StorageError::damaged(key.as_str(), reason));
        }
        let part = self.objects.get_range(&path(key), range_bytes).await;
        part.map_err(|e| failed(key, e))
    }

    /// The size of an object in bytes.
    pub async fn size_bytes(&self, key: &ObjectKey) -> Result<u64, StorageError> {
        let meta = self.objects.head(&path(key)).await;
        Ok(meta.map_err(|e| failed(key, e))?.size)
    }

    /// Is there such an object?
    pub async fn exists(&self, key: &ObjectKey) -> Result<bool, StorageError> {
        match self.objects.head(&path(key)).await {
            Ok(_) => Ok(true),
            Err(Error::NotFound { .. }) => Ok(false),
            Err(e) => Err(failed(key, e)),
        }
    }

    /// Keys under a folder, sorted. `""` is the whole store.
    pub async fn list(&self, folder: &str) -> Result<Vec<ObjectKey>, StorageError> {
        let mut found = self.objects.list(Some(&Path::from(folder)));
        let mut keys: Vec<ObjectKey> = vec![];
        while let Some(meta) = found.try_next().await.map_err(|e| failed(folder, e))? {
            // Names that are no keys of ours (a half-written file, say) are not ours to report.
            let name = meta.location.filename().unwrap_or_default();
            if !hdfs::is_half_written(name) {
                keys.extend(meta.location.as_ref().parse::<ObjectKey>().ok());
            }
        }
        keys.sort();
        Ok(keys)
    }

    /// The same with when each was written, as the store says.
    pub async fn list_written(
        &self,
        folder: &str,
    ) -> Result<Vec<(ObjectKey, TimeMs)>, StorageError> {
        let mut found = self.objects.list(Some(&Path::from(folder)));
        let mut keys = vec![];
        while let Some(meta) = found.try_next().await.map_err(|e| failed(folder, e))? {
            let written = TimeMs::new(meta.last_modified.timestamp_millis());
            let written = written.map_err(|e| StorageError::damaged(meta.location.as_ref(), e))?;
            if let Ok(key) = meta.location.as_ref().parse() {
                keys.push((key, written));
            }
        }
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

    /// Removes an object that nothing names any more; it is no error if it is gone already.
    ///
    /// Only clean-up may do this: readers trust that what a manifest names is there.
    pub async fn remove(&self, key: &ObjectKey) -> Result<(), StorageError> {
        match self.objects.delete(&path(key)).await {
            Ok(()) | Err(Error::NotFound { .. }) => {}
            Err(e) => return Err(failed(key, e)),
        }
        if matches!(self.place, Place::Hdfs) {
            self.remove_empty_folders(key).await;
        }
        Ok(())
    }

    /// Folders of an object that hold nothing any more. The file system refuses to remove the others, so that what it
    /// answers tells where to stop.
    async fn remove_empty_folders(&self, key: &ObjectKey) {
        let mut folder = key.as_str();
        while let Some((parent, _)) = folder.rsplit_once('/') {
            folder = parent;
            let Ok(()) = self.objects.delete(&Path::from(folder)).await else {
                return;
            };
        }
    }
}
