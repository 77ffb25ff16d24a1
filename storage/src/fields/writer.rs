//! Bands of rows in, a field out: no more of it is held than a band and a group of chunks.

use std::io::Write;
use std::sync::Arc;

use arrow::array::{
    Float32Builder, ListBuilder, RecordBatch, TimestampMillisecondArray, UInt32Array,
};
use contract::chunk::{CHUNK_ROWS, Window, bands};
use contract::digest::Digest;
use contract::grid::Grid;
use contract::time::{Period, TimeMs};

use super::{CHUNKS_PER_GROUP, SCHEMA, check_of_row, digest_begun};
use crate::StorageError;
use crate::parquet_table::{self, value_field};
use crate::values::{ValuesDigest, no_data_alike};

/// A field that is being written, from the north to the south.
///
/// Its bytes and its name are the same in whatever bands its rows come.
pub struct Writer<W: Write + Send> {
    grid: Grid,
    digest: ValuesDigest,
    rows_done: u32,
    group: Group,
    table: parquet_table::Writer<W>,
}

impl<W: Write + Send> Writer<W> {
    /// A field of a period on a grid, still without rows.
    ///
    /// # Errors
    /// Its first bytes cannot be written.
    pub fn new(out: W, grid: &Grid, period: Period) -> Result<Self, StorageError> {
        let shape = [grid.rows, grid.cols];
        Ok(Self {
            grid: *grid,
            digest: digest_begun(grid, period),
            rows_done: 0,
            group: Group::new(period),
            table: parquet_table::Writer::new(out, &SCHEMA, CHUNKS_PER_GROUP, &shape)?,
        })
    }

    /// Adds the next rows (`[row, col]`, stored unit, NaN no data): whole rows of chunks, or all that are left.
    ///
    /// # Errors
    /// They are no such rows, or cannot be written.
    pub fn band(&mut self, values: &[f32]) -> Result<(), StorageError> {
        let cols = self.grid.cols as usize;
        let rows = u32::try_from(values.len() / cols.max(1)).unwrap_or(u32::MAX);
        let end = self.rows_done.saturating_add(rows);
        let is_whole = end == self.grid.rows || rows.is_multiple_of(CHUNK_ROWS);
        if rows as usize * cols != values.len() || end > self.grid.rows || !is_whole {
            let reason = format!(
                "{} values from row {} on do not fit {} x {} cells",
                values.len(),
                self.rows_done,
                self.grid.rows,
                self.grid.cols
            );
            return Err(StorageError::damaged("field to write", reason));
        }
        self.digest.add(values);
        let band = Grid { rows, ..self.grid };
        for window in contract::chunk::field_chunks(&band) {
            self.group.push(&window, &band, values);
            if self.group.len() == CHUNKS_PER_GROUP {
                self.table.write(&self.group.take()?)?;
            }
        }
        self.rows_done = end;
        Ok(())
    }

    /// The digest of the values, and what the field was written to.
    ///
    /// # Errors
    /// Rows are missing, or its end cannot be written.
    pub fn finish(mut self) -> Result<(Digest, W), StorageError> {
        if self.rows_done != self.grid.rows {
            let (done, all) = (self.rows_done, self.grid.rows);
            let reason = format!("{done} of {all} rows were given");
            return Err(StorageError::damaged("field to write", reason));
        }
        if self.group.len() > 0 {
            self.table.write(&self.group.take()?)?;
        }
        Ok((self.digest.finish(), self.table.finish()?))
    }
}

/// Chunks that become rows of the table together.
struct Group {
    period: Period,
    /// The number of the first chunk.
    first: u32,
    lists: ListBuilder<Float32Builder>,
    checks: Vec<u32>,
    chunk: Vec<f32>,
}

impl Group {
    fn new(period: Period) -> Self {
        Self {
            period,
            first: 0,
            lists: ListBuilder::new(Float32Builder::new()).with_field(value_field()),
            checks: vec![],
            chunk: vec![],
        }
    }

    fn len(&self) -> usize {
        self.checks.len()
    }

    fn push(&mut self, window: &Window, band: &Grid, values: &[f32]) {
        self.chunk.clear();
        let [cols, width] = [band.cols as usize, window.cols as usize];
        for row in window.row..window.row + window.rows {
            let own = &values[row as usize * cols + window.col as usize..][..width];
            self.chunk.extend(own.iter().map(|v| no_data_alike(*v)));
        }
        self.lists.values().append_slice(&self.chunk);
        self.lists.append(true);
        let number = self.first + self.len() as u32;
        self.checks
            .push(check_of_row(number, self.period, &self.chunk));
    }

    fn take(&mut self) -> Result<RecordBatch, StorageError> {
        let count = self.len();
        let numbers = self.first..self.first + count as u32;
        self.first = numbers.end;
        let time = |t: TimeMs| {
            Arc::new(TimestampMillisecondArray::from(vec![t.ms(); count]).with_timezone("UTC"))
        };
        RecordBatch::try_new(
            Arc::clone(&SCHEMA),
            vec![
                Arc::new(UInt32Array::from_iter_values(numbers)),
                time(self.period.start),
                time(self.period.end),
                Arc::new(self.lists.finish()),
                Arc::new(UInt32Array::from(std::mem::take(&mut self.checks))),
            ],
        )
        .map_err(|e| StorageError::damaged("field to write", e))
    }
}

/// Rows of a map, band by band, as [`Writer::band`] takes them.
pub(super) fn in_bands<'a>(
    grid: &Grid,
    values: &'a [f32],
    most_cells: u64,
) -> impl Iterator<Item = &'a [f32]> {
    let cols = grid.cols as usize;
    bands(grid, most_cells).map(move |rows| {
        let [start, end] = [rows.start, rows.end].map(|row| row as usize * cols);
        &values[start..end]
    })
}
