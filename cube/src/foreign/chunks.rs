//! Values of a part of an array in, of whole chunks that are kept for the next part: each is unpacked once.

use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

use futures::stream::{self, StreamExt as _, TryStreamExt as _};
use quick_cache::sync::{Cache, DefaultLifecycle};
use quick_cache::{DefaultHashBuilder, OptionsBuilder, Weighter};
use zarrs::array::{ArrayShardedExt as _, ArrayToBytesCodecTraits as _, CodecOptions, FillValue};

use super::array::{Absent, ArrayKind, Chunk, ForeignArray, Unpacked, number};
use super::error::ForeignError;

/// Chunks that are kept unpacked, bytes: a year of days in one chunk along time is read a step at a time.
const KEPT_BYTES: u64 = 256 << 20;
/// Chunks that are expected to be kept.
const KEPT_CHUNKS: usize = 4096;
/// Chunks of one part that are read at a time.
const CHUNKS_AT_ONCE: usize = 4;
/// What a chunk may have packed beyond its unpacked bytes: shards have indexes, and codecs headers.
const PACKED_EXTRA_BYTES: u64 = 1 << 20;

/// Array and index of a chunk, and whether what it lacks was looked for.
type Key = (String, Vec<u64>, bool);

#[derive(Clone)]
struct BySize;

impl Weighter<Key, Unpacked> for BySize {
    fn weight(&self, _key: &Key, chunk: &Unpacked) -> u64 {
        let bytes = |chunk: &Arc<Chunk>| (chunk.bytes.len() + chunk.lacking.len()) as u64;
        chunk.as_ref().map_or(64, |chunk| bytes(chunk) + 64)
    }
}

/// Unpacked chunks of the arrays of a store.
pub(super) struct Chunks(Cache<Key, Unpacked, BySize>);

impl Default for Chunks {
    fn default() -> Self {
        // One shard: in several, of which there are more the more processors there are, each would have a part of the room that a chunk
        // may not fit into.
        let options = OptionsBuilder::new()
            .shards(1)
            .estimated_items_capacity(KEPT_CHUNKS)
            .weight_capacity(KEPT_BYTES)
            .build()
            .expect("both capacities are given");
        let (hasher, lifecycle) = (DefaultHashBuilder::default(), DefaultLifecycle::default());
        Self(Cache::with_options(options, BySize, hasher, lifecycle))
    }
}

impl Chunks {
    /// Values of a part of an array, row-major, as float64.
    pub(super) async fn read(
        &self,
        array: &ForeignArray,
        part: &[Range<u64>],
        absent: Absent,
    ) -> Result<Vec<f64>, ForeignError> {
        let chunks = array.chunks_of(part)?;
        let is_looked_through = absent != Absent::Fill && array.inner.is_sharded();
        let count: u64 = part.iter().map(|part| part.end - part.start).product();
        let mut values = vec![f64::NAN; count as usize];
        let read = chunks.into_iter().map(|(index, cells)| async move {
            let chunk = self.chunk(array, (&index, &cells), is_looked_through);
            let chunk = chunk.await?;
            Ok::<_, ForeignError>((index, cells, chunk))
        });
        let mut read = stream::iter(read).buffered(CHUNKS_AT_ONCE);
        while let Some((index, cells, chunk)) = read.try_next().await? {
            if absent != Absent::Fill {
                check_there(array, (&index, &cells), (part, chunk.as_deref()), absent)?;
            }
            let fill = array.fill.unwrap_or(f64::NAN);
            copy(
                array.kind,
                (chunk.as_ref().map(|chunk| &chunk.bytes[..]), fill),
                &cells,
                part,
                &mut values,
            );
        }
        Ok(values)
    }

    async fn chunk(
        &self,
        array: &ForeignArray,
        (index, cells): (&[u64], &[Range<u64>]),
        is_looked_through: bool,
    ) -> Result<Unpacked, ForeignError> {
        let key = (array.name.clone(), index.to_vec(), is_looked_through);
        let unpacked = unpacked(array, (index, cells), is_looked_through);
        self.0.get_or_insert_async(&key, unpacked).await
    }
}

/// A chunk as it is stored, unpacked whole with all checks of its codecs; none if it is not there.
async fn unpacked(
    array: &ForeignArray,
    (index, cells): (&[u64], &[Range<u64>]),
    is_looked_through: bool,
) -> Result<Unpacked, ForeignError> {
    let bytes = array.chunk_bytes(cells)?;
    let value_bytes = array.value_bytes()? as usize;
    let place = || format!("{} chunk {index:?}", array.place);
    let packed = array.inner.async_retrieve_encoded_chunk(index).await;
    let packed = match packed.map_err(|e| array.failures.told(&place(), "reading it", &e)) {
        Ok(packed) => packed,
        Err(told) => {
            let Some(location) = array.elsewhere(index).await else {
                return Err(told);
            };
            let reason = format!(
                "is not in the repository but refers to {location} (a virtual chunk), and such references are not followed: write its values into the repository, or land the files that it refers to"
            );
            return Err(ForeignError::refused(place(), reason));
        }
    };
    let Some(packed) = packed else {
        return Ok(None);
    };
    let most = bytes.saturating_mul(2).saturating_add(PACKED_EXTRA_BYTES);
    if packed.len() as u64 > most {
        let reason = format!("has {} bytes for {bytes} unpacked ones", packed.len());
        return Err(ForeignError::refused(place(), reason));
    }
    let (codecs, shape) = (array.inner.codecs(), array.inner.chunk_shape(index));
    let shape = shape.map_err(|e| ForeignError::refused(place(), e.to_string()))?;
    let (data_type, fill) = (
        array.inner.data_type().clone(),
        array.inner.fill_value().clone(),
    );
    let decoded = tokio::task::spawn_blocking(move || {
        let options = CodecOptions::default().with_validate_checksums(true);
        let decode = |packed: Cow<'_, [u8]>, fill: &FillValue| {
            let decoded = codecs.decode(packed, &shape, &data_type, fill, &options);
            let decoded = decoded.and_then(|own| Ok(own.into_fixed()?.into_owned()));
            decoded.map_err(|e| e.to_string())
        };
        let packed = Vec::from(packed);
        // What no chunk of a shard holds comes out as what it is filled with, in shards of shards and below other codecs too.
        let filled = is_looked_through
            .then(|| decode(Cow::Borrowed(&packed), &other_than(&fill)))
            .transpose()?;
        let bytes = decode(packed.into(), &fill)?;
        let lacking = filled.map(|filled| differing(&bytes, &filled, value_bytes));
        let lacking = lacking.unwrap_or_default();
        Ok::<_, String>(Chunk { bytes, lacking })
    });
    // At an index of a shard whose places reach beyond what can be counted the library panics.
    let decoded = decoded.await;
    let decoded = decoded.unwrap_or_else(|e| Err(format!("it cannot be unpacked ({e})")));
    let damaged = |reason: String| {
        ForeignError::refused(place(), format!("is damaged or of another kind: {reason}"))
    };
    let decoded = decoded.map_err(damaged)?;
    let count = decoded.bytes.len();
    if count as u64 != bytes {
        return Err(damaged(format!("{count} bytes where {bytes} belong")));
    }
    Ok(Some(Arc::new(decoded)))
}

/// A value that is another one in each of its bits.
fn other_than(fill: &FillValue) -> FillValue {
    FillValue::new(fill.as_ne_bytes().iter().map(|byte| !byte).collect())
}

/// Which values of two chunks differ; empty if none do.
fn differing(one: &[u8], other: &[u8], value_bytes: usize) -> Vec<bool> {
    if one == other {
        return vec![];
    }
    let both = one
        .chunks_exact(value_bytes)
        .zip(other.chunks_exact(value_bytes));
    both.map(|(one, other)| one != other).collect()
}

/// The refusal of a chunk that is not there, where that cannot be told from values.
fn missing(array: &ForeignArray, place: &str, absent: Absent) -> ForeignError {
    let name = &array.name;
    let reason = match (absent, array.fill) {
        (Absent::RefusedOfCoordinate, Some(fill)) if fill.is_finite() => format!(
            "is not there, so that each of its places or times would be the fill value {fill}: if that is right, have it written (xarray: encoding={{\"{name}\": {{\"write_empty_chunks\": True}}}}; docs/open-data.md has the way for a store that is there), else write it again, or state it in a profile"
        ),
        (Absent::RefusedOfCoordinate, _) => {
            "is not there, and a coordinate has a value everywhere: write it again".to_owned()
        }
        (_, None) => "is not there, and fill_value of its array (.zarray) is null, so that nothing tells what its cells hold: write it, or, if it is no data, give fill_value the number that stands for that".to_owned(),
        // What it is filled with is missing in version 2, where its attributes do not say otherwise.
        (_, Some(fill)) if array.is_zarr2 => format!(
            "is not there, so that its cells would be the fill value {fill} (fill_value of .zarray), which is no missing value here: _FillValue of its attributes, or a profile, names another. Nothing tells whether it was never written: write it, or, if it is no data, make the two one"
        ),
        (_, Some(fill)) => format!(
            "is not there, so that its cells would be the fill value {fill}, which is no missing value here: no _FillValue of its attributes names it. Nothing tells whether it was never written: write it, or, if it is no data, say \"_FillValue\": {fill} in the attributes"
        ),
    };
    ForeignError::absent(format!("{} {place}", array.place), reason)
}

/// Refuses a part of which something is not there.
fn check_there(
    array: &ForeignArray,
    (index, cells): (&[u64], &[Range<u64>]),
    (part, chunk): (&[Range<u64>], Option<&Chunk>),
    absent: Absent,
) -> Result<(), ForeignError> {
    let of_shard = || format!("shard {index:?}");
    let place = match chunk {
        None if array.inner.is_sharded() => of_shard(),
        None => format!("chunk {index:?}"),
        // A shard that is there may lack chunks all the same.
        Some(chunk) => match lacked(chunk, cells, part) {
            None => return Ok(()),
            Some(cell) => array.inner.effective_subchunk_shape().map_or_else(
                || format!("a chunk of {}", of_shard()),
                |shape| {
                    let both = cell.iter().zip(&shape);
                    let index: Vec<u64> = both.map(|(cell, len)| cell / len.get()).collect();
                    format!("chunk {index:?}")
                },
            ),
        },
    };
    Err(missing(array, &place, absent))
}

/// The first cell of a part that no chunk of a shard holds.
fn lacked(chunk: &Chunk, cells: &[Range<u64>], part: &[Range<u64>]) -> Option<Vec<u64>> {
    if chunk.lacking.is_empty() {
        return None;
    }
    let shared = shared(part, cells);
    let Some((last, before)) = shared.split_last() else {
        return chunk.lacking[0].then(Vec::new);
    };
    let width = (last.end - last.start) as usize;
    indexes(before).into_iter().find_map(|mut index| {
        index.push(last.start);
        let first = place(cells, &index);
        let row = &chunk.lacking[first..first + width];
        let beyond = row.iter().position(|is_lacking| *is_lacking)? as u64;
        index.pop();
        index.push(last.start + beyond);
        Some(index)
    })
}

/// All indexes in some ranges, row-major.
fn indexes(ranges: &[Range<u64>]) -> Vec<Vec<u64>> {
    let mut all = vec![vec![]];
    for range in ranges {
        let longer = |index: &Vec<u64>| {
            let index = index.clone();
            range.clone().map(move |next| {
                let mut longer = index.clone();
                longer.push(next);
                longer
            })
        };
        all = all.iter().flat_map(longer).collect();
    }
    all
}

/// The cells that a part and a chunk have in common.
fn shared(part: &[Range<u64>], cells: &[Range<u64>]) -> Vec<Range<u64>> {
    let both = part.iter().zip(cells);
    both.map(|(part, cells)| part.start.max(cells.start)..part.end.min(cells.end))
        .collect()
}

/// The place of a cell among those of some ranges, row-major.
fn place(within: &[Range<u64>], index: &[u64]) -> usize {
    let both = within.iter().zip(index);
    both.fold(0, |place, (range, at)| {
        place * (range.end - range.start) + (at - range.start)
    }) as usize
}

/// Copies the cells that a chunk and a part share; of a chunk that is not there all are its fill value.
fn copy(
    kind: ArrayKind,
    (chunk, fill): (Option<&[u8]>, f64),
    cells: &[Range<u64>],
    part: &[Range<u64>],
    values: &mut [f64],
) {
    let shared = shared(part, cells);
    let Some((last, before)) = shared.split_last() else {
        // An array without dimensions holds one value.
        values[0] = chunk.and_then(|chunk| number(kind, chunk)).unwrap_or(fill);
        return;
    };
    let width = (last.end - last.start) as usize;
    for mut index in indexes(before) {
        index.push(last.start);
        let to = place(part, &index);
        let to = &mut values[to..to + width];
        let Some(chunk) = chunk else {
            to.fill(fill);
            continue;
        };
        let value_bytes = match kind {
            ArrayKind::Integer(bytes) | ArrayKind::Unsigned(bytes) | ArrayKind::Float(bytes) => {
                usize::from(bytes)
            }
            ArrayKind::Other => return,
        };
        let from = place(cells, &index) * value_bytes;
        let from = chunk[from..from + width * value_bytes].chunks_exact(value_bytes);
        for (to, from) in to.iter_mut().zip(from) {
            *to = number(kind, from).unwrap_or(f64::NAN);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_large_chunk_is_kept_whatever_the_number_of_processors() {
        let chunks = Chunks::default();
        let key = |col| ("sst".to_owned(), vec![0, col], false);
        for col in 0..2 {
            let chunk = Chunk {
                bytes: vec![0; 100 << 20],
                lacking: vec![],
            };
            chunks.0.insert(key(col), Some(Arc::new(chunk)));
        }
        assert!((0..2).all(|col| chunks.0.get(&key(col)).is_some()));
        assert!(chunks.0.get(&key(2)).is_none());
    }
}
