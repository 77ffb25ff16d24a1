//! One state of a cube by the keys of Zarr version 2: what lies in the store as version 3, one chunk at a time.

use bytes::Bytes;
use futures::future::BoxFuture;

use crate::stored_chunks::TOO_SHORT;
use crate::zarr_2::{CHECKSUM_BYTES, InShard, Named, checked};
use crate::{CubeError, Keys};

impl Keys {
    /// Length of the value of a key of version 2; none if there is no such key, or a chunk without data.
    ///
    /// # Errors
    /// The cube cannot be read, or not so be described.
    pub fn length_2<'a>(&'a self, key: &'a str) -> BoxFuture<'a, Result<Option<u64>, CubeError>> {
        Box::pin(async move {
            let (array, object, shard) = match self.zarr_2()?.named(key) {
                None => return Ok(None),
                Some(Named::Metadata(content)) => return Ok(Some(content.len() as u64)),
                Some(Named::Chunk(array, object, shard)) => (array, object, shard),
            };
            let stored = match shard {
                None => self.length(&object).await?,
                Some(shard) => self
                    .in_shard(&object, shard)
                    .await?
                    .map(|[_, length]| length),
            };
            if let Some(length) = stored {
                return Ok(Some(length.saturating_sub(CHECKSUM_BYTES as u64)));
            }
            let blank = array.blank().map_err(|e| self.undescribed(key, &e))?;
            Ok(blank.map(|blank| blank.len() as u64))
        })
    }

    /// The value of a key of version 2; none if there is no such key, or a chunk without data. Chunks are compared with their checksums,
    /// which version 2 does not have.
    ///
    /// # Errors
    /// As [`Self::length_2`]; a chunk that its checksum does not fit.
    pub fn get_2<'a>(&'a self, key: &'a str) -> BoxFuture<'a, Result<Option<Bytes>, CubeError>> {
        Box::pin(async move {
            let (array, object, shard) = match self.zarr_2()?.named(key) {
                None => return Ok(None),
                Some(Named::Metadata(content)) => return Ok(Some(content.clone())),
                Some(Named::Chunk(array, object, shard)) => (array, object, shard),
            };
            let stored = match shard {
                None => self.get(&object, None).await?,
                Some(shard) => match self.in_shard(&object, shard).await? {
                    None => None,
                    Some([start, length]) => {
                        let range = start..start.saturating_add(length);
                        self.get(&object, Some(range)).await?
                    }
                },
            };
            let Some(stored) = stored else {
                return array.blank().map_err(|e| self.undescribed(key, &e));
            };
            match checked(&stored) {
                Some(content) => Ok(Some(stored.slice(..content.len()))),
                None => Err(self.damaged(&object, "it fails its checksum")),
            }
        })
    }

    /// Where a chunk lies in its shard; none if it is not stored.
    async fn in_shard(&self, object: &str, shard: InShard) -> Result<Option<[u64; 2]>, CubeError> {
        let Some(all) = self.length(object).await? else {
            return Ok(None);
        };
        let damaged = |reason: &str| self.damaged(object, reason);
        let start = all.checked_sub(shard.index_bytes() as u64);
        let start = start.ok_or_else(|| damaged(TOO_SHORT))?;
        let index = self.get(object, Some(start..all)).await?;
        let place = shard.place(&index.unwrap_or_default());
        let place = place.map_err(|reason| damaged(&reason))?;
        let is_inside =
            |[from, length]: [u64; 2]| from.checked_add(length).is_some_and(|end| end <= all);
        if place.is_some_and(|place| !is_inside(place)) {
            return Err(damaged(TOO_SHORT));
        }
        Ok(place)
    }

    fn undescribed(&self, key: &str, reason: &str) -> CubeError {
        CubeError::library(
            self.place(),
            "describing a chunk by Zarr version 2",
            format!("{key}: {reason}"),
        )
    }

    fn damaged(&self, object: &str, reason: &str) -> CubeError {
        CubeError::library(
            self.place(),
            "reading a chunk",
            format!("{object}: {reason}"),
        )
    }
}
