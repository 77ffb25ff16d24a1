//! Pages decompressed by what a thread holds for all of them.
//!
//! The Parquet library makes a codec for every column that is read, and zstd asks the processor what it can do whenever a context is made
//! (`cpuid`), which under a hypervisor takes longer than to decompress a page: so the library is told that a column is not compressed, and
//! hands out its pages as they are stored.

use std::cell::Cell;

use bytes::Bytes;
use parquet::basic::Compression;
use parquet::errors::{ParquetError, Result};
use parquet::file::metadata::ColumnChunkMetaData;
use zstd::bulk::Decompressor;
use zstd::zstd_safe::get_frame_content_size;

thread_local! {
    static OF_THREAD: Cell<Option<Decompressor<'static>>> = const { Cell::new(None) };
}

/// Most bytes of a page, whatever the end of its file says: a row of an array is one, of some 7,000 numbers.
const MOST_BYTES: usize = 16 << 20;

/// A column whose pages are handed out as they are stored, and are to be decompressed by [`page`]; none if another codec compressed it.
pub(super) fn as_stored(column: &ColumnChunkMetaData) -> Option<ColumnChunkMetaData> {
    let Compression::ZSTD(_) = column.compression() else {
        return None;
    };
    let told = column.clone().into_builder();
    told.set_compression(Compression::UNCOMPRESSED).build().ok()
}

/// A page of a column, decompressed.
///
/// # Errors
/// It is damaged, or larger than its whole column says it is, or than any page.
pub(super) fn page(content: &[u8], column: &ColumnChunkMetaData) -> Result<Bytes> {
    let other = |e: std::io::Error| ParquetError::General(e.to_string());
    let most = usize::try_from(column.uncompressed_size())?.min(MOST_BYTES);
    let told = get_frame_content_size(content).ok().flatten();
    let size = told.map_or(Ok(most), usize::try_from)?;
    if size > most {
        let reason = format!("a page of {size} bytes is larger than its column of {most}");
        return Err(ParquetError::General(reason));
    }
    let mut own = match OF_THREAD.take() {
        Some(own) => own,
        None => Decompressor::new().map_err(other)?,
    };
    let decompressed = own.decompress(content, size);
    OF_THREAD.set(Some(own));
    decompressed.map(Bytes::from).map_err(other)
}
