//! Blocks of the time-major copy: each is read by its own bytes, which the index at the end of its shard tells.
//!
//! The library's reader of shards holds every index that it ever saw, and reads one at a time; a region of a large grid
//! touches thousands of them.

use std::sync::Arc;

use quick_cache::Weighter;
use quick_cache::sync::Cache;
use zarrs::array::Array;
use zarrs::storage::AsyncReadableStorageTraits as _;
use zarrs::storage::byte_range::ByteRange;
use zarrs_icechunk::AsyncIcechunkStore;

use crate::error::first_lines;
use crate::field::Decoder;
use crate::layout::BLOCK_CELLS;
use crate::unreadable::Object;
use crate::{CubeError, Description, Layout, arrays};

/// Indexes that are held, bytes: those of 720 x 1440 cells at 6,000 steps are 6 MB.
const INDEX_BYTES: u64 = 16 << 20;
/// Bytes of an entry: where a block begins in its shard, and its length.
const ENTRY_BYTES: usize = 16;
/// Bytes of the checksum of an index.
const CRC_BYTES: usize = 4;

/// Where the blocks of a shard begin in it, and their lengths, which are nothing for those without data; a shard holds 128 MiB
/// of values at most.
type Index = Vec<[u32; 2]>;

#[derive(Clone)]
struct IndexWeight;

impl Weighter<[u64; 3], Arc<Index>> for IndexWeight {
    fn weight(&self, _shard: &[u64; 3], index: &Arc<Index>) -> u64 {
        (index.len() * size_of::<[u32; 2]>()) as u64
    }
}

/// Reads blocks of one state of a cube.
pub(crate) struct Blocks {
    array: Array<AsyncIcechunkStore>,
    /// Rows and columns of blocks in a shard.
    shard: [u32; 2],
    indexes: Cache<[u64; 3], Arc<Index>, IndexWeight>,
    decoder: Decoder,
    /// For messages.
    place: String,
}

impl Blocks {
    pub(crate) fn new(
        array: Array<AsyncIcechunkStore>,
        description: &Description,
        place: &str,
    ) -> Result<Self, CubeError> {
        let [rows, cols] = Layout::of(&description.grid).series_object();
        let shard = [rows / BLOCK_CELLS, cols / BLOCK_CELLS];
        let entries = u64::from(shard[0] * shard[1]);
        let index_bytes = entries * size_of::<[u32; 2]>() as u64;
        Ok(Self {
            array,
            shard,
            indexes: Cache::with_weighter(
                (INDEX_BYTES / index_bytes.max(1)) as usize,
                INDEX_BYTES,
                IndexWeight,
            ),
            decoder: Decoder::of_blocks(description)?,
            place: place.to_owned(),
        })
    }

    /// Name of the array.
    pub(crate) fn name(&self) -> String {
        arrays::name(&self.array)
    }

    /// Values of a block in a run, `[cell, step]`, 8 x 8 cells wherever the grid ends; none where no cell has data.
    pub(crate) async fn read(
        &self,
        run: usize,
        block: [u32; 2],
    ) -> Result<Option<Vec<f32>>, CubeError> {
        let shard = [block[0] / self.shard[0], block[1] / self.shard[1]];
        let key = [shard[0].into(), shard[1].into(), run as u64];
        match self.decoded(key, block).await {
            Ok(values) => Ok(values),
            Err(reason) => {
                let chunk = [block[0].into(), block[1].into(), run as u64];
                Err(self.object(key).unreadable(chunk, &reason).await)
            }
        }
    }

    fn object(&self, shard: [u64; 3]) -> Object<'_> {
        Object {
            array: &self.array,
            place: &self.place,
            index: shard,
        }
    }

    async fn decoded(&self, key: [u64; 3], block: [u32; 2]) -> Result<Option<Vec<f32>>, String> {
        let index = self.index(key).await?;
        let inside = [block[0] % self.shard[0], block[1] % self.shard[1]];
        let number = (inside[0] * self.shard[1] + inside[1]) as usize;
        let [offset, length] = index.get(number).copied().unwrap_or_default();
        if length == 0 {
            return Ok(None);
        }
        let range = ByteRange::FromStart(offset.into(), Some(length.into()));
        let found = self.part(key, range).await?;
        let content = found.ok_or("its shard is not there")?;
        // A few ten microseconds: not worth another thread.
        self.decoder.decode(content).map(Some)
    }

    /// Values of a whole shard, `[row, col, step]`; none where no cell has data. The library compares the checksum of a
    /// block where it decodes all of it.
    pub(crate) async fn shard(
        &self,
        run: usize,
        shard: [u32; 2],
    ) -> Result<Option<Vec<f32>>, CubeError> {
        let index = [shard[0].into(), shard[1].into(), run as u64];
        let found = self.array.async_retrieve_chunk_if_exists(&index).await;
        match found {
            Ok(values) => Ok(values),
            Err(error) => Err(self
                .object(index)
                .unreadable(index, &first_lines(&error))
                .await),
        }
    }

    async fn part(&self, shard: [u64; 3], range: ByteRange) -> Result<Option<Vec<u8>>, String> {
        let key = self.array.chunk_key(&shard);
        let found = self.array.storage().get_partial(&key, range).await;
        let found = found.map_err(|e| first_lines(&e))?;
        Ok(found.map(Vec::from))
    }

    async fn index(&self, shard: [u64; 3]) -> Result<Arc<Index>, String> {
        if let Some(index) = self.indexes.get(&shard) {
            return Ok(index);
        }
        let entries = (self.shard[0] * self.shard[1]) as usize;
        let bytes = (entries * ENTRY_BYTES + CRC_BYTES) as u64;
        let index = match self.part(shard, ByteRange::Suffix(bytes)).await? {
            Some(content) => parse(&content, entries)?,
            // No cell of it has data in any step.
            None => vec![],
        };
        let index = Arc::new(index);
        self.indexes.insert(shard, Arc::clone(&index));
        Ok(index)
    }
}

/// The index of a shard of so many blocks; its checksum is compared first.
fn parse(content: &[u8], entries: usize) -> Result<Index, String> {
    let damaged = || "the index of its shard is not that of its checksum (crc32c)".to_owned();
    let (index, told) = content
        .split_last_chunk::<CRC_BYTES>()
        .filter(|(index, _)| index.len() == entries * ENTRY_BYTES)
        .ok_or_else(damaged)?;
    if crc32c::crc32c(index) != u32::from_le_bytes(*told) {
        return Err(damaged());
    }
    let number = |bytes: &[u8]| bytes.try_into().map_or(u64::MAX, u64::from_le_bytes);
    let entry = |entry: &[u8]| {
        let (offset, length) = entry.split_at(ENTRY_BYTES / 2);
        let place = [number(offset), number(length)];
        if place == [u64::MAX; 2] {
            return Ok([0; 2]);
        }
        match place.map(u32::try_from) {
            [Ok(offset), Ok(length)] => Ok([offset, length]),
            _ => Err("a block lies beyond its shard".to_owned()),
        }
    };
    index.chunks_exact(ENTRY_BYTES).map(entry).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_index_is_read_only_with_its_checksum() {
        let mut index: Vec<u8> = vec![];
        for number in [0, 17, u64::MAX, u64::MAX, 17, 5_u64] {
            index.extend(number.to_le_bytes());
        }
        let crc = crc32c::crc32c(&index).to_le_bytes();
        index.extend(crc);
        assert_eq!(parse(&index, 3).unwrap(), [[0, 17], [0, 0], [17, 5]]);
        assert!(parse(&index, 2).is_err() && parse(&index[1..], 3).is_err());
        for at in 0..index.len() * 8 {
            let mut flipped = index.clone();
            flipped[at / 8] ^= 1 << (at % 8);
            assert!(parse(&flipped, 3).is_err(), "bit {at}");
        }
    }
}
