//! Blocks of a run in, a shard of the time-major copy out, as [`crate::field::SeriesEncoder`] writes it: a block after the other is
//! compressed, and none is made of cells without data.

use bytes::Bytes;

use crate::arrays::QUICK_ZSTD_LEVEL;
use crate::{CubeError, RunValues};

/// A place in the index of a shard that nothing lies at.
const NOTHING: [u64; 2] = [u64::MAX; 2];

/// A shard, by its row and column, of so many rows and columns of blocks; none where no cell has data.
pub(crate) fn shard(
    run: &RunValues,
    shard: [u32; 2],
    [rows, cols]: [u32; 2],
) -> Result<Option<Bytes>, CubeError> {
    let failed = |e: std::io::Error| CubeError::library("a shard of a series", "encoding", e);
    let mut compressor = zstd::bulk::Compressor::new(QUICK_ZSTD_LEVEL).map_err(failed)?;
    let mut index = vec![NOTHING; rows as usize * cols as usize];
    let mut content: Vec<u8> = vec![];
    for ([row, col], values) in run.each() {
        if [row / rows, col / cols] != shard || values.iter().all(|value| value.is_nan()) {
            continue;
        }
        let compressed = if cfg!(target_endian = "big") {
            let bytes: Vec<u8> = values.iter().flat_map(|it| it.to_le_bytes()).collect();
            compressor.compress(&bytes)
        } else {
            compressor.compress(bytemuck::cast_slice(values))
        };
        let compressed = compressed.map_err(failed)?;
        let begin = content.len();
        content.extend_from_slice(&compressed);
        content.extend(crc32c::crc32c(&compressed).to_le_bytes());
        let place = row % rows * cols + col % cols;
        index[place as usize] = [begin, content.len() - begin].map(|it| it as u64);
    }
    if content.is_empty() {
        return Ok(None);
    }
    let index: Vec<u8> = index
        .iter()
        .flatten()
        .flat_map(|it| it.to_le_bytes())
        .collect();
    content.extend_from_slice(&index);
    content.extend(crc32c::crc32c(&index).to_le_bytes());
    Ok(Some(content.into()))
}
