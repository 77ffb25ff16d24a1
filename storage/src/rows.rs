//! Some rows of a stored field: of its file the pages that hold them, decompressed and compared with their checks.
//! Nothing else of the file is read once its footer is known.
//!
//! Files of before rows had checks or pages of their own are read whole.

mod decompressed;
mod page;
mod whole;

use std::ops::Range;
use std::sync::Arc;

use bytes::Bytes;
use contract::key::ObjectKey;
use contract::kind::Vouched;
use futures::future::BoxFuture;
use object_store::path::Path;
use object_store::{ObjectStore, ObjectStoreExt as _};
use parquet::arrow::async_reader::MetadataFetch;
use parquet::errors::ParquetError;
use parquet::file::metadata::{PageIndexPolicy, ParquetMetaData, ParquetMetaDataReader};

use crate::StorageError;
use crate::off_thread::off_thread;
use crate::row_check::RowCheck;
use crate::sound::damage;

/// What is read of a file's end at first: the footer and the index of pages of a field of a hundred chunks.
pub(crate) const TAIL_BYTES: usize = 16 << 10;

/// A stored object, and where queries read it.
#[derive(Debug, Clone)]
pub struct Stored {
    /// What holds it.
    pub objects: Arc<dyn ObjectStore>,
    /// Where in there.
    pub path: Path,
    /// Its name in the store; it is checked as what this vouches for.
    pub key: ObjectKey,
}

/// What a row must be.
#[derive(Debug, Clone)]
pub struct Expected {
    /// Its number of values.
    pub length: usize,
    /// The check of what says which row it is, its values still to be added.
    pub check: RowCheck,
}

/// Where the rows of a file lie. It takes some 20 bytes a row: keep it for files that are read often.
#[derive(Debug)]
pub struct RowIndex {
    meta: ParquetMetaData,
    /// First row of each group, and the end of the last one.
    starts: Vec<u64>,
    values: usize,
    check: usize,
}

impl RowIndex {
    /// Reads the footer of a file; none if it has no checks or does not say where its pages are.
    ///
    /// # Errors
    /// It cannot be read, or is no such file.
    pub async fn read(stored: &Stored) -> Result<Option<Self>, StorageError> {
        if !matches!(stored.key.vouches(), Vouched::Values(_)) {
            return Ok(None);
        }
        let head = stored.objects.head(&stored.path).await;
        let size_bytes = head.map_err(|e| crate::store::failed(&stored.key, e))?.size;
        let footer = footer().with_prefetch_hint(Some(TAIL_BYTES));
        let meta = footer.load_and_finish(Footer(stored), size_bytes).await;
        let meta = meta.map_err(|e| unreadable(&stored.key, e))?;
        Ok(Self::of(meta))
    }

    /// The same of the last bytes of a file; none too if these are too few.
    pub(crate) fn of_end(tail: &Bytes, size_bytes: u64) -> Option<Self> {
        let mut footer = footer();
        footer.try_parse_sized(tail, size_bytes).ok()?;
        Self::of(footer.finish().ok()?)
    }

    fn of(meta: ParquetMetaData) -> Option<Self> {
        let schema = meta.file_metadata().schema_descr();
        let column = |name: &str| {
            let mut columns = (0..schema.num_columns()).map(|at| schema.column(at));
            columns.position(|column| column.path().parts().first().is_some_and(|p| p == name))
        };
        let (values, check) = (column("values")?, column("check")?);
        let is_indexed = meta.offset_index().is_some_and(|groups| {
            groups.len() == meta.num_row_groups()
                && groups
                    .iter()
                    .all(|group| !group[values].page_locations().is_empty())
        });
        let mut starts = vec![0];
        for group in meta.row_groups() {
            starts.push(starts[starts.len() - 1] + group.num_rows().unsigned_abs());
        }
        is_indexed.then_some(Self {
            meta,
            starts,
            values,
            check,
        })
    }

    /// What the file says of itself.
    pub(crate) fn metadata(&self) -> &ParquetMetaData {
        &self.meta
    }

    /// Rows of the file.
    pub fn row_count(&self) -> u64 {
        self.starts.last().copied().unwrap_or_default()
    }

    /// The group that holds a row.
    fn group_of(&self, row: u32) -> Option<usize> {
        let after = self
            .starts
            .partition_point(|start| *start <= u64::from(row));
        (after < self.starts.len()).then(|| after - 1)
    }

    /// Bytes of the file that hold some rows, in increasing order.
    pub(crate) fn ranges(&self, rows: &[u32]) -> Option<Vec<Range<u64>>> {
        let mut parts = Vec::with_capacity(rows.len() + 1);
        let mut last_group = None;
        for &row in rows {
            let group = self.group_of(row)?;
            if last_group != Some(group) {
                let (start, length) = self.meta.row_group(group).column(self.check).byte_range();
                parts.push(start..start + length);
                last_group = Some(group);
            }
            parts.push(self.page_of(group, row)?);
        }
        parts.sort_unstable_by_key(|part| part.start);
        let mut ranges: Vec<Range<u64>> = vec![];
        for part in parts {
            match ranges.last_mut() {
                Some(last) if part.start <= last.end => last.end = last.end.max(part.end),
                _ => ranges.push(part),
            }
        }
        Some(ranges)
    }

    fn page_of(&self, group: usize, row: u32) -> Option<Range<u64>> {
        let inside = i64::try_from(u64::from(row) - self.starts[group]).ok()?;
        let pages = self.meta.offset_index()?[group][self.values].page_locations();
        let at = pages.partition_point(|page| page.first_row_index <= inside);
        let page = pages.get(at.checked_sub(1)?)?;
        let start = u64::try_from(page.offset).ok()?;
        Some(start..start + u64::try_from(page.compressed_page_size).ok()?)
    }
}

/// Reads the end of a file: where its pages are, and nothing of what they hold.
fn footer() -> ParquetMetaDataReader {
    ParquetMetaDataReader::new()
        .with_column_index_policy(PageIndexPolicy::Skip)
        .with_offset_index_policy(PageIndexPolicy::Optional)
}

/// Reads parts of a file for the Parquet library.
struct Footer<'a>(&'a Stored);

impl MetadataFetch for Footer<'_> {
    fn fetch(&mut self, range: Range<u64>) -> BoxFuture<'_, Result<Bytes, ParquetError>> {
        let read = self.0.objects.get_range(&self.0.path, range);
        let external = |e: object_store::Error| ParquetError::External(e.into());
        Box::pin(async move { read.await.map_err(external) })
    }
}

/// Bytes of a file that hold some rows, still to be decompressed.
#[derive(Debug)]
pub struct Fetched {
    key: ObjectKey,
    /// In increasing order.
    rows: Vec<u32>,
    content: Content,
}

#[derive(Debug)]
enum Content {
    Parts(Arc<RowIndex>, page::Parts),
    Whole(Bytes),
}

/// Fetches the bytes of some rows. Without an index the file is fetched whole.
///
/// # Errors
/// It cannot be read, or has no such row.
pub async fn fetch(
    stored: &Stored,
    index: Option<Arc<RowIndex>>,
    mut rows: Vec<u32>,
) -> Result<Fetched, StorageError> {
    rows.sort_unstable();
    rows.dedup();
    let key = stored.key.clone();
    let failed = |e| crate::store::failed(&stored.key, e);
    let content = if let Some(index) = index {
        let ranges = index.ranges(&rows);
        let ranges = ranges.ok_or_else(|| damage::found(&key, "it lacks a row"))?;
        let parts = stored.objects.get_ranges(&stored.path, &ranges).await;
        let size_bytes = ranges.last().map_or(0, |range| range.end);
        let parts = ranges.into_iter().zip(parts.map_err(failed)?).collect();
        Content::Parts(index, page::Parts::new(parts, size_bytes))
    } else {
        let found = stored.objects.get(&stored.path).await.map_err(failed)?;
        let content = found.bytes().await.map_err(failed)?;
        let checked = key.clone();
        Content::Whole(
            off_thread(move || {
                crate::sound::of_bytes(&checked, &content)?;
                Ok(content)
            })
            .await?,
        )
    };
    Ok(Fetched { key, rows, content })
}

impl Fetched {
    /// Bytes that somebody else fetched: those that the index says hold the rows, which are in increasing order.
    pub(crate) fn of_parts(
        key: &ObjectKey,
        index: Arc<RowIndex>,
        rows: Vec<u32>,
        parts: Vec<(Range<u64>, Bytes)>,
    ) -> Self {
        let size_bytes = parts.last().map_or(0, |(range, _)| range.end);
        Self {
            key: key.clone(),
            rows,
            content: Content::Parts(index, page::Parts::new(parts, size_bytes)),
        }
    }

    /// Hands each row and its values to `take`, in increasing order; it works long and belongs on a thread of its own.
    ///
    /// # Errors
    /// A row is not what its check says, or what was expected; whatever `take` says.
    pub fn each<E: From<StorageError>>(
        &self,
        expected: impl Fn(u32) -> Expected,
        mut take: impl FnMut(u32, &[f32]) -> Result<(), E>,
    ) -> Result<(), E> {
        match &self.content {
            Content::Parts(index, parts) => {
                let pages = page::Pages {
                    key: &self.key,
                    index,
                    parts,
                };
                pages.each(&self.rows, &expected, &mut take)
            }
            Content::Whole(content) => {
                let rows = whole::rows(&self.key, content.clone(), &self.rows)?;
                for (row, values, check) in rows {
                    let is_own = check.is_none_or(|check| {
                        expected(row).check.f32s(values.values()).finish() == check
                    });
                    if !is_own || values.len() != expected(row).length {
                        return Err(not_its_check(&self.key, row).into());
                    }
                    take(row, values.values())?;
                }
                Ok(())
            }
        }
    }
}

fn unreadable(key: &ObjectKey, error: ParquetError) -> StorageError {
    match error {
        // The store's own failures may pass.
        ParquetError::External(source) => match source.downcast::<object_store::Error>() {
            Ok(own) => crate::store::failed(key, *own),
            Err(other) => damage::found(key, other),
        },
        other => damage::found(key, other),
    }
}

fn not_its_check(key: &ObjectKey, row: u32) -> StorageError {
    damage::found(key, format!("row {row} differs from its check"))
}

#[cfg(test)]
mod tests;
