//! Blocks of the time-major copy, and records of sums of them, which lie in shards as they do: each is read by its own bytes,
//! which the index at the end of its shard tells.
//!
//! The library's reader of shards holds every index that it ever saw, and reads one at a time; a region of a large grid
//! touches thousands of them.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use glam::{Mat4, Vec4};
use icechunk::format::Path;
use quick_cache::Weighter;
use quick_cache::sync::Cache;
use zarrs::array::{Array, ElementOwned};
use zarrs::storage::byte_range::ByteRange;
use zarrs_icechunk::AsyncIcechunkStore;

use crate::error::first_lines;
use crate::layout::{BLOCK_CELLS, RUN_STEPS};
use crate::object_storage::ObjectStorage;
use crate::shards::{Shard, Shards};
use crate::stored_chunks::{InPart, Part, Source, StoredChunks, TOO_SHORT};
use crate::unreadable::Object;
use crate::{CubeError, Description, Layout, arrays};

/// Indexes that are held, bytes: those of 720 x 1440 cells at 6,000 steps are 6 MB.
const INDEX_BYTES: u64 = 16 << 20;
/// Bytes of an entry: where a block begins in its shard, and its length.
const ENTRY_BYTES: usize = 16;
/// Bytes of the checksum of an index, or of a block.
const CRC_BYTES: usize = 4;
/// Blocks of a shard that so few bytes lie between are read together: that is quicker than to read another part.
const GAP_BYTES: u64 = 8 << 10;
/// Values of a block in a run.
const BLOCK_VALUES: usize = (BLOCK_CELLS * BLOCK_CELLS) as usize * RUN_STEPS;

/// Where the blocks of a shard begin in it, and their lengths, which are nothing for those without data; a shard holds 128 MiB
/// of values at most.
type Index = Vec<[u32; 2]>;

/// A block in its shard: its first byte, how many it has, and which it is of those asked for.
type Place = (u64, u64, usize);

/// What lies from the first of some places to the last.
fn range_of(near: &[Place]) -> Range<u64> {
    let start = near.first().map_or(0, |(offset, ..)| *offset);
    let ends = near.iter().map(|(offset, length, _)| offset + length);
    start..ends.max().unwrap_or(start)
}

#[derive(Clone)]
struct IndexWeight;

impl Weighter<[u64; 3], Arc<Index>> for IndexWeight {
    fn weight(&self, _shard: &[u64; 3], index: &Arc<Index>) -> u64 {
        (index.len() * size_of::<[u32; 2]>()) as u64
    }
}

/// Which of an array's axes goes along runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum RunAxis {
    /// That of values along time.
    First,
    /// That of records of sums.
    Last,
}

impl RunAxis {
    /// Where a shard or a block of a run lies among those of its array.
    pub(crate) fn index(self, [row, col]: [u32; 2], run: usize) -> [u32; 3] {
        match self {
            Self::First => [run as u32, row, col],
            Self::Last => [row, col, run as u32],
        }
    }

    fn key(self, at: [u32; 2], run: usize) -> [u64; 3] {
        self.index(at, run).map(u64::from)
    }
}

/// Reads blocks of one state of a cube.
pub(crate) struct Blocks {
    array: Array<AsyncIcechunkStore>,
    axis: RunAxis,
    /// Rows and columns of blocks in a shard.
    shard: [u32; 2],
    indexes: Cache<[u64; 3], Arc<Index>, IndexWeight>,
    path: Path,
    /// Where its objects are.
    objects: ObjectStorage,
    /// For messages.
    place: String,
}

impl Blocks {
    pub(crate) fn new(
        (array, axis): (Array<AsyncIcechunkStore>, RunAxis),
        description: &Description,
        objects: &ObjectStorage,
    ) -> Result<Self, CubeError> {
        let place = objects.to_string();
        let path = Path::new(array.path().as_str());
        let path = path.map_err(|e| CubeError::library(&place, "naming an array", e))?;
        let [rows, cols] = Layout::of(&description.grid).series_object();
        let shard = [rows / BLOCK_CELLS, cols / BLOCK_CELLS];
        let entries = u64::from(shard[0] * shard[1]);
        let index_bytes = entries * size_of::<[u32; 2]>() as u64;
        Ok(Self {
            array,
            axis,
            path,
            objects: objects.clone(),
            shard,
            indexes: Cache::with_weighter(
                (INDEX_BYTES / index_bytes.max(1)) as usize,
                INDEX_BYTES,
                IndexWeight,
            ),
            place,
        })
    }

    /// Name of the array.
    pub(crate) fn name(&self) -> String {
        arrays::name(&self.array)
    }

    fn shards(&self) -> Shards<'_> {
        Shards {
            array: &self.array,
            path: &self.path,
            objects: &self.objects,
        }
    }

    fn object(&self, shard: [u64; 3]) -> Object<'_> {
        Object {
            array: &self.array,
            place: &self.place,
            index: shard,
        }
    }

    /// Blocks of a run as they are stored. Those that lie near one another in a shard are read together.
    pub(crate) async fn stored(
        &self,
        run: usize,
        blocks: &[[u32; 2]],
    ) -> Result<StoredChunks, CubeError> {
        let mut by_shard: BTreeMap<[u32; 2], Vec<usize>> = BTreeMap::new();
        for (number, block) in blocks.iter().enumerate() {
            let shard = [block[0] / self.shard[0], block[1] / self.shard[1]];
            by_shard.entry(shard).or_default().push(number);
        }
        let mut found = StoredChunks::default();
        for (shard, numbers) in by_shard {
            let key = self.axis.key(shard, run);
            match self.parts_with(key, &numbers, blocks).await {
                Ok(parts) => found.0.extend(parts),
                Err(reason) => return Err(self.object(key).unreadable(key, &reason).await),
            }
        }
        Ok(found)
    }

    /// Parts of one shard with the blocks that are asked for.
    async fn parts_with(
        &self,
        key: [u64; 3],
        numbers: &[usize],
        blocks: &[[u32; 2]],
    ) -> Result<Vec<Part>, String> {
        let index = self.index(key).await?;
        let place = |number: &usize| {
            let [offset, length] = self.place_in(&index, blocks[*number]);
            (u64::from(offset), u64::from(length), *number)
        };
        let mut places: Vec<Place> = numbers.iter().map(place).collect();
        places.retain(|(_offset, length, _number)| *length > 0);
        places.sort_unstable();
        let shard = self.shards().at(key).await?;
        // What questions share are blocks: each is a part of its own.
        let is_shared = matches!(shard, Shard::Object(..));
        let is_near = |a: &Place, b: &Place| !is_shared && b.0 <= a.0 + a.1 + GAP_BYTES;
        let near: Vec<&[Place]> = places.chunk_by(is_near).collect();
        let ranges: Vec<Range<u64>> = near.iter().map(|near| range_of(near)).collect();
        let sources = self.shards().sources(key, shard, &ranges).await?;
        let part = |((near, range), source): ((&&[Place], &Range<u64>), Source)| {
            let chunk = |(offset, length, number): &Place| {
                let start = (offset - range.start) as usize;
                let bytes = start..start + *length as usize;
                let number = *number;
                (bytes.end <= source.length()).then_some(InPart { number, bytes })
            };
            let chunks: Option<Vec<InPart>> = near.iter().map(chunk).collect();
            let chunks = chunks.ok_or(TOO_SHORT)?;
            Ok(Part { source, chunks })
        };
        near.iter().zip(&ranges).zip(sources).map(part).collect()
    }

    /// Where a block lies in its shard: first byte, and how many, none without data.
    fn place_in(&self, index: &Index, block: [u32; 2]) -> [u32; 2] {
        let inside = [block[0] % self.shard[0], block[1] % self.shard[1]];
        let number = (inside[0] * self.shard[1] + inside[1]) as usize;
        index.get(number).copied().unwrap_or_default()
    }

    /// The error of a block that cannot be decoded.
    pub(crate) async fn undecoded(&self, run: usize, block: [u32; 2], reason: &str) -> CubeError {
        let shard = [block[0] / self.shard[0], block[1] / self.shard[1]];
        let chunk = self.axis.key(block, run);
        self.object(self.axis.key(shard, run))
            .unreadable(chunk, reason)
            .await
    }

    /// A whole shard, `[step, row, col]` of values, or `[row, col, byte]` of records; none where no cell has data. The library compares the checksum of a
    /// block where it decodes all of it.
    pub(crate) async fn shard<T: ElementOwned>(
        &self,
        run: usize,
        shard: [u32; 2],
    ) -> Result<Option<Vec<T>>, CubeError> {
        let index = self.axis.key(shard, run);
        let found = self.array.async_retrieve_chunk_if_exists(&index).await;
        match found {
            Ok(values) => Ok(values),
            Err(error) => {
                let is_named = self.shards().is_named(index).await;
                if is_named.is_ok_and(|is_named| !is_named) {
                    return Ok(None);
                }
                let reason = first_lines(&error);
                Err(self.object(index).unreadable(index, &reason).await)
            }
        }
    }

    async fn index(&self, shard: [u64; 3]) -> Result<Arc<Index>, String> {
        if let Some(index) = self.indexes.get(&shard) {
            return Ok(index);
        }
        let entries = (self.shard[0] * self.shard[1]) as usize;
        let bytes = (entries * ENTRY_BYTES + CRC_BYTES) as u64;
        let index = match self.shards().part(shard, ByteRange::Suffix(bytes)).await? {
            Some(content) => parse(&content, entries)?,
            // No cell of it has data in any step.
            None => vec![],
        };
        let index = Arc::new(index);
        self.indexes.insert(shard, Arc::clone(&index));
        Ok(index)
    }
}

/// Decodes one chunk after the other. The library's chain of codecs makes its tables anew for every one, which takes longer
/// than to decode it.
pub(crate) struct ChunkDecoder(zstd::bulk::Decompressor<'static>);

impl ChunkDecoder {
    pub(crate) fn new() -> Result<Self, String> {
        let zstd = zstd::bulk::Decompressor::new();
        Ok(Self(zstd.map_err(|e| e.to_string())?))
    }

    /// Fills `bytes` with a chunk, whose checksum is compared with what is stored first.
    pub(crate) fn decode(&mut self, content: &[u8], bytes: &mut [u8]) -> Result<(), String> {
        let (compressed, _told) = content
            .split_last_chunk::<CRC_BYTES>()
            .filter(|(own, told)| crc32c::crc32c(own) == u32::from_le_bytes(**told))
            .ok_or("its bytes are not those of its checksum (crc32c)")?;
        // It holds as many bytes as a chunk has, or is refused.
        let count = self.0.decompress_to_buffer(compressed, bytes);
        if count.map_err(|e| e.to_string())? != bytes.len() {
            return Err("it holds less than a chunk".to_owned());
        }
        Ok(())
    }
}

/// Cells in a row of a block.
const ROW: usize = BLOCK_CELLS as usize;

/// Decodes one block of values after the other, and turns them along time.
pub(crate) struct BlockDecoder {
    chunks: ChunkDecoder,
    /// `[step, cell]`, as they are stored.
    stored: Vec<f32>,
    /// `[cell, step]`.
    values: Vec<f32>,
}

thread_local! {
    /// The decoder of this thread: to make one takes as long as to decode ten blocks.
    static OF_THREAD: Cell<Option<Box<BlockDecoder>>> = const { Cell::new(None) };
}

/// Works with the decoder of this thread.
///
/// # Errors
/// There is no memory for one.
pub(crate) fn with_decoder<R>(work: impl FnOnce(&mut BlockDecoder) -> R) -> Result<R, String> {
    let mut own = match OF_THREAD.take() {
        Some(own) => own,
        None => Box::new(BlockDecoder::new()?),
    };
    let done = work(&mut own);
    OF_THREAD.set(Some(own));
    Ok(done)
}

impl BlockDecoder {
    fn new() -> Result<Self, String> {
        Ok(Self {
            chunks: ChunkDecoder::new()?,
            stored: vec![f32::NAN; BLOCK_VALUES],
            values: vec![f32::NAN; BLOCK_VALUES],
        })
    }

    /// Decodes chunks of any kind.
    pub(crate) fn chunks(&mut self) -> &mut ChunkDecoder {
        &mut self.chunks
    }

    /// Values of a block, `[cell, step]`, of those of its rows of cells that are wanted: a bit each, the northernmost lowest. Of others the values are any.
    pub(crate) fn decode(&mut self, content: &[u8], rows: u8) -> Result<&[f32], String> {
        let bytes = bytemuck::cast_slice_mut(&mut self.stored);
        self.chunks.decode(content, bytes)?;
        if cfg!(target_endian = "big") {
            for value in &mut self.stored {
                *value = f32::from_bits(u32::from_le(value.to_bits()));
            }
        }
        for (row, values) in self.values.chunks_exact_mut(ROW * RUN_STEPS).enumerate() {
            if rows >> row & 1 == 1 {
                turn_row(&self.stored[row * ROW..], values);
            }
        }
        Ok(&self.values)
    }
}

/// Side of the squares of values that are turned at a time.
const SIDE: usize = 4;

/// Turns a row of cells, `[step, cell]` of a whole block from its first cell on, to `[cell, step]`: matrices of four steps of four cells,
/// whose bits stay what they are.
fn turn_row(stored: &[f32], values: &mut [f32]) {
    for left in (0..ROW).step_by(SIDE) {
        for first in (0..RUN_STEPS).step_by(SIDE) {
            let step = |step: usize| Vec4::from_slice(&stored[(first + step) * ROW * ROW + left..]);
            let turned = Mat4::from_cols(step(0), step(1), step(2), step(3)).transpose();
            let cells = [turned.x_axis, turned.y_axis, turned.z_axis, turned.w_axis];
            for (cell, own) in cells.into_iter().enumerate() {
                own.write_to_slice(&mut values[(left + cell) * RUN_STEPS + first..]);
            }
        }
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
    fn what_is_no_whole_block_is_refused() {
        let stored = |values: &[f32]| {
            let bytes: Vec<u8> = values
                .iter()
                .flat_map(|value| value.to_le_bytes())
                .collect();
            let mut content = zstd::bulk::compress(&bytes, 3).unwrap();
            content.extend(crc32c::crc32c(&content).to_le_bytes());
            content
        };
        let mut decoder = BlockDecoder::new().unwrap();
        let values: Vec<f32> = (0..BLOCK_VALUES).map(|at| at as f32).collect();
        let of_row = ROW * RUN_STEPS;
        let turned = |at: usize| values[at % RUN_STEPS * ROW * ROW + at / RUN_STEPS];
        let turned: Vec<f32> = (0..BLOCK_VALUES).map(turned).collect();
        // Rows that are not wanted keep what they were.
        let found = decoder.decode(&stored(&values), 0b1000_0001).unwrap();
        assert_eq!(found[..of_row], turned[..of_row]);
        assert_eq!(found[7 * of_row..], turned[7 * of_row..]);
        assert!(found[of_row..7 * of_row].iter().all(|value| value.is_nan()));
        let mut decode = |content: &[u8]| decoder.decode(content, u8::MAX).map(<[f32]>::to_vec);
        assert_eq!(decode(&stored(&values)).unwrap(), turned);
        let less = decode(&stored(&values[1..])).unwrap_err();
        assert!(less.contains("less than a chunk"), "{less}");
        let more = [&values[..], &[1.0]].concat();
        assert!(decode(&stored(&more)).is_err());
        let mut damaged = stored(&values);
        damaged[100] ^= 1;
        let reason = decode(&damaged).unwrap_err();
        assert!(reason.contains("checksum"), "{reason}");
        assert!(decode(&[]).is_err());
    }

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
