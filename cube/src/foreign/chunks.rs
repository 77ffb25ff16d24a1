//! Values of a part of an array in, of whole chunks that are kept for the next part: each is unpacked once.

use std::ops::Range;
use std::sync::Arc;

use futures::stream::{self, StreamExt as _, TryStreamExt as _};
use quick_cache::sync::{Cache, DefaultLifecycle};
use quick_cache::{DefaultHashBuilder, OptionsBuilder, Weighter};
use zarrs::array::{
    ArrayShardedExt as _, ArrayToBytesCodecTraits as _, AsyncArrayShardedReadableExt as _,
    CodecOptions,
};
use zarrs::storage::byte_range::ByteRange;

use super::array::{Absent, ArrayKind, ForeignArray, Unpacked, number};
use super::error::ForeignError;

/// Chunks that are kept unpacked, bytes: a year of days in one chunk along time is read a step at a time.
const KEPT_BYTES: u64 = 256 << 20;
/// Chunks that are expected to be kept.
const KEPT_CHUNKS: usize = 4096;
/// Chunks of one part that are read at a time.
const CHUNKS_AT_ONCE: usize = 4;
/// What a chunk may have packed beyond its unpacked bytes: shards have indexes, and codecs headers.
const PACKED_EXTRA_BYTES: u64 = 1 << 20;

type Key = (String, Vec<u64>);

#[derive(Clone)]
struct BySize;

impl Weighter<Key, Unpacked> for BySize {
    fn weight(&self, _key: &Key, chunk: &Unpacked) -> u64 {
        chunk.as_ref().map_or(64, |bytes| bytes.len() as u64 + 64)
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
        let count: u64 = part.iter().map(|part| part.end - part.start).product();
        let mut values = vec![f64::NAN; count as usize];
        let read = chunks.into_iter().map(|(index, cells)| async move {
            let chunk = self.chunk(array, &index, &cells).await?;
            Ok::<_, ForeignError>((index, cells, chunk))
        });
        let mut read = stream::iter(read).buffered(CHUNKS_AT_ONCE);
        while let Some((index, cells, chunk)) = read.try_next().await? {
            if absent != Absent::Fill {
                let missing = |place: &str| missing(array, place, absent);
                check_there(array, (&index, &cells), (part, chunk.is_some()), &missing).await?;
            }
            let fill = array.fill.unwrap_or(f64::NAN);
            copy(
                array.kind,
                (chunk.as_deref(), fill),
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
        index: &[u64],
        cells: &[Range<u64>],
    ) -> Result<Unpacked, ForeignError> {
        let key = (array.name.clone(), index.to_vec());
        let unpacked = unpacked(array, index, cells);
        self.0.get_or_insert_async(&key, unpacked).await
    }
}

/// A chunk as it is stored, unpacked whole with all checks of its codecs; none if it is not there.
async fn unpacked(
    array: &ForeignArray,
    index: &[u64],
    cells: &[Range<u64>],
) -> Result<Unpacked, ForeignError> {
    let bytes = array.chunk_bytes(cells)?;
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
        let decoded = codecs.decode(
            Vec::from(packed).into(),
            &shape,
            &data_type,
            &fill,
            &options,
        );
        let decoded = decoded.and_then(|own| Ok(own.into_fixed()?.into_owned()));
        decoded.map_err(|e| e.to_string())
    });
    let decoded = decoded
        .await
        .map_err(|e| ForeignError::refused(place(), e.to_string()))?;
    let damaged = |reason: String| {
        ForeignError::refused(place(), format!("is damaged or of another kind: {reason}"))
    };
    let decoded = decoded.map_err(damaged)?;
    if decoded.len() as u64 != bytes {
        return Err(damaged(format!(
            "{} bytes where {bytes} belong",
            decoded.len()
        )));
    }
    Ok(Some(Arc::new(decoded)))
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
async fn check_there(
    array: &ForeignArray,
    (index, cells): (&[u64], &[Range<u64>]),
    (part, is_there): (&[Range<u64>], bool),
    missing: &(dyn Fn(&str) -> ForeignError + Sync),
) -> Result<(), ForeignError> {
    if !is_there {
        let is_shard = array.inner.subchunk_shape().is_some();
        let what = if is_shard { "shard" } else { "chunk" };
        return Err(missing(&format!("{what} {index:?}")));
    }
    let Some(inner) = array.inner.subchunk_shape() else {
        return Ok(());
    };
    // A shard that is there may lack chunks all the same.
    let of = |(part, cells): (&Range<u64>, &Range<u64>), inner: u64| {
        let (start, end) = (part.start.max(cells.start), part.end.min(cells.end));
        start / inner..end.div_ceil(inner)
    };
    let both = part.iter().zip(cells);
    let ranges: Vec<Range<u64>> = both
        .zip(inner.iter())
        .map(|(both, inner)| of(both, inner.get()))
        .collect();
    for index in indexes(&ranges) {
        let range = array.inner.async_subchunk_byte_range(&array.shards, &index);
        let place = format!("{} chunk {index:?}", array.place);
        let failed = |e| array.failures.told(&place, "looking for it", &e);
        let range = range.await.map_err(failed)?;
        // The library gives what the index has, where one that is not there has no place but all bits set.
        let is_there = range.is_some_and(|it| !matches!(it, ByteRange::FromStart(u64::MAX, _)));
        if !is_there {
            return Err(missing(&format!("chunk {index:?}")));
        }
    }
    Ok(())
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

/// Copies the cells that a chunk and a part share; of a chunk that is not there all are its fill value.
fn copy(
    kind: ArrayKind,
    (chunk, fill): (Option<&Vec<u8>>, f64),
    cells: &[Range<u64>],
    part: &[Range<u64>],
    values: &mut [f64],
) {
    let shared: Vec<Range<u64>> = part
        .iter()
        .zip(cells)
        .map(|(part, cells)| part.start.max(cells.start)..part.end.min(cells.end))
        .collect();
    let place = |within: &[Range<u64>], index: &[u64]| {
        let both = within.iter().zip(index);
        both.fold(0, |place, (range, at)| {
            place * (range.end - range.start) + (at - range.start)
        }) as usize
    };
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
        let key = |col| ("sst".to_owned(), vec![0, col]);
        for col in 0..2 {
            let chunk = Arc::new(vec![0; 100 << 20]);
            chunks.0.insert(key(col), Some(chunk));
        }
        assert!((0..2).all(|col| chunks.0.get(&key(col)).is_some()));
        assert!(chunks.0.get(&key(2)).is_none());
    }
}
