//! Pages of values out of the bytes that were fetched: decompressed by the Parquet library, their plain numbers taken as they
//! lie there.

use std::io::Cursor;
use std::ops::Range;
use std::sync::Arc;

use bytes::{Buf as _, Bytes};
use contract::key::ObjectKey;
use parquet::basic::Encoding;
use parquet::column::page::{Page, PageReader as _};
use parquet::errors::{ParquetError, Result};
use parquet::file::metadata::ColumnChunkMetaData;
use parquet::file::reader::{ChunkReader, Length};
use parquet::file::serialized_reader::SerializedPageReader;

use super::{Expected, RowIndex, decompressed, not_its_check};
use crate::StorageError;
use crate::sound::damage;

/// Ranges of a file's bytes, in increasing order.
#[derive(Debug, Clone)]
pub(super) struct Parts(Arc<Inner>);

#[derive(Debug)]
struct Inner {
    parts: Vec<(Range<u64>, Bytes)>,
    size_bytes: u64,
}

impl Parts {
    pub(super) fn new(parts: Vec<(Range<u64>, Bytes)>, size_bytes: u64) -> Self {
        Self(Arc::new(Inner { parts, size_bytes }))
    }

    /// All that was fetched from a place on.
    fn from(&self, start: u64) -> Result<Bytes> {
        let parts = &self.0.parts;
        let after = parts.partition_point(|(range, _)| range.start <= start);
        let found = after.checked_sub(1).map(|at| &parts[at]);
        let Some((range, content)) = found.filter(|(range, _)| start < range.end) else {
            return Err(ParquetError::EOF(format!("byte {start} was not fetched")));
        };
        let offset = usize::try_from(start - range.start)?;
        if offset > content.len() {
            return Err(ParquetError::EOF(format!("byte {start} did not come")));
        }
        Ok(content.slice(offset..))
    }
}

impl Length for Parts {
    fn len(&self) -> u64 {
        self.0.size_bytes
    }
}

impl ChunkReader for Parts {
    type T = Cursor<Bytes>;

    fn get_read(&self, start: u64) -> Result<Self::T> {
        Ok(Cursor::new(self.from(start)?))
    }

    fn get_bytes(&self, start: u64, length: usize) -> Result<Bytes> {
        let found = self.from(start)?;
        if found.len() < length {
            let reason = format!("{length} bytes from {start} were not all fetched");
            return Err(ParquetError::EOF(reason));
        }
        Ok(found.slice(..length))
    }
}

/// Pages of a file.
pub(super) struct Pages<'a> {
    pub(super) key: &'a ObjectKey,
    pub(super) index: &'a RowIndex,
    pub(super) parts: &'a Parts,
}

impl Pages<'_> {
    /// Hands each of some rows, which are in increasing order, to `take`.
    pub(super) fn each<E: From<StorageError>>(
        &self,
        rows: &[u32],
        expected: &impl Fn(u32) -> Expected,
        take: &mut impl FnMut(u32, &[f32]) -> std::result::Result<(), E>,
    ) -> std::result::Result<(), E> {
        let mut left = rows;
        while let Some(&first) = left.first() {
            let group = self.index.group_of(first);
            let group = group.ok_or_else(|| damage::found(self.key, "it lacks a row"))?;
            let end = self.index.starts[group + 1];
            let count = left.partition_point(|row| u64::from(*row) < end);
            self.group(group, &left[..count], expected, take)?;
            left = &left[count..];
        }
        Ok(())
    }

    /// The same of rows of one group.
    fn group<E: From<StorageError>>(
        &self,
        group: usize,
        rows: &[u32],
        expected: &impl Fn(u32) -> Expected,
        take: &mut impl FnMut(u32, &[f32]) -> std::result::Result<(), E>,
    ) -> std::result::Result<(), E> {
        let damaged = |e: &dyn std::fmt::Display| damage::found(self.key, e);
        let first_row = self.index.starts[group] as u32;
        let checks = self.checks(group).map_err(|e| damaged(&e))?;
        let meta = self.index.meta.row_group(group);
        let row_count = meta.num_rows().unsigned_abs() as u32;
        let pages = self.index.meta.offset_index();
        let pages = pages.map_or(&[][..], |all| {
            all[group][self.index.values].page_locations()
        });
        let reader = Arc::new(self.parts.clone());
        let column = meta.column(self.index.values);
        let stored = decompressed::as_stored(column);
        let told = stored.as_ref().unwrap_or(column);
        let reader =
            SerializedPageReader::new(reader, told, row_count as usize, Some(pages.to_vec()));
        let mut reader = reader.map_err(|e| damaged(&e))?;
        let mut wanted = rows.iter().copied().peekable();
        let mut values = vec![];
        for (at, page) in pages.iter().enumerate() {
            let start = first_row + page.first_row_index as u32;
            let end = match pages.get(at + 1) {
                Some(next) => first_row + next.first_row_index as u32,
                None => first_row + row_count,
            };
            if wanted.peek().is_none_or(|row| *row >= end) {
                reader.skip_next_page().map_err(|e| damaged(&e))?;
                continue;
            }
            let page = reader.get_next_page().map_err(|e| damaged(&e))?;
            let page = page.ok_or_else(|| damaged(&"it lacks a page"))?;
            let content = content(&page, stored.as_ref().map(|_| column));
            plain_values(&page, &content.map_err(|e| damaged(&e))?, &mut values)
                .ok_or_else(|| damaged(&"a page is no list of numbers"))?;
            let mut from = 0;
            for row in start..end {
                let own = expected(row);
                let row_values = values.get(from..from + own.length);
                from += own.length;
                if wanted.next_if_eq(&row).is_none() {
                    continue;
                }
                let check = checks.get((row - first_row) as usize);
                let row_values =
                    row_values.filter(|values| Some(&own.check.f32s(values).finish()) == check);
                take(row, row_values.ok_or_else(|| not_its_check(self.key, row))?)?;
            }
        }
        Ok(())
    }

    /// Checks of the rows of a group.
    fn checks(&self, group: usize) -> Result<Vec<u32>> {
        let meta = self.index.meta.row_group(group);
        let rows = usize::try_from(meta.num_rows())?;
        let column = meta.column(self.index.check);
        let stored = decompressed::as_stored(column);
        let told = stored.as_ref().unwrap_or(column);
        let mut reader = SerializedPageReader::new(Arc::new(self.parts.clone()), told, rows, None)?;
        let mut checks = Vec::with_capacity(rows);
        while let Some(page) = reader.get_next_page()? {
            // Never null and never repeated: the page holds nothing but numbers.
            let is_plain = page.encoding() == Encoding::PLAIN;
            let mut content = content(&page, stored.as_ref().map(|_| column))?;
            if !is_plain || content.len() != page.num_values() as usize * 4 {
                return Err(ParquetError::General("checks are no numbers".to_owned()));
            }
            while content.has_remaining() {
                checks.push(content.get_u32_le());
            }
        }
        Ok(checks)
    }
}

/// What a page holds; `column` is what it is of, if it was handed out as it is stored.
fn content(page: &Page, column: Option<&ColumnChunkMetaData>) -> Result<Bytes> {
    match column {
        Some(column) => decompressed::page(page.buffer(), column),
        None => Ok(page.buffer().clone()),
    }
}

/// The numbers of a page of lists without nulls and without empty lists; none if it is another.
///
/// Such a page is the length of its repetition levels and they, the length of its definition levels and they, and the
/// numbers one behind the other. Which list a number belongs to is known without the levels.
fn plain_values(page: &Page, content: &[u8], values: &mut Vec<f32>) -> Option<()> {
    let Page::DataPage {
        num_values,
        encoding: Encoding::PLAIN,
        ..
    } = page
    else {
        return None;
    };
    let length = |at: usize| {
        let bytes = content.get(at..at.checked_add(4)?)?;
        Some(u32::from_le_bytes(bytes.try_into().ok()?) as usize)
    };
    let definitions = length(0)?.checked_add(4)?;
    let start = definitions
        .checked_add(length(definitions)?)?
        .checked_add(4)?;
    let numbers = content.get(start..)?;
    if numbers.len() != *num_values as usize * 4 {
        return None;
    }
    values.clear();
    let number = |bytes: &[u8]| f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
    values.extend(numbers.chunks_exact(4).map(number));
    Some(())
}
