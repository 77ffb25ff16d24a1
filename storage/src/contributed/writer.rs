//! Bands of counts in, the object of all of them out: no more of it is held than a band and a group of chunks.

use std::io::Write;
use std::path::Path;
use std::sync::Arc;

use arrow::array::{
    Int64Builder, ListBuilder, RecordBatch, TimestampMillisecondArray, UInt32Array, UInt32Builder,
};
use arrow::datatypes::DataType;
use contract::chunk::{CHUNK_ROWS, Window, field_chunks};
use contract::digest::Digest;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::product::ProductId;
use contract::time::{Period, TimeMs};

use super::{CHUNKS_PER_GROUP, Contributed, NumbersDigest, Reader, SCHEMA, item};
use crate::off_thread::off_thread;
use crate::parquet_table;
use crate::spool::{HELD_BYTES, Spool};
use crate::{StorageError, Store};

/// Counts that are being written, from the north to the south, with the same bytes in whatever bands they come.
pub(super) struct Writer<W: Write + Send> {
    grid: Grid,
    period: Period,
    of_steps: u32,
    rows_done: u32,
    chunks_done: u32,
    steps: ListBuilder<UInt32Builder>,
    milliseconds: ListBuilder<Int64Builder>,
    waiting: usize,
    table: parquet_table::Writer<W>,
}

impl<W: Write + Send> Writer<W> {
    /// What sums hold after so many steps, whose period is from the first one's start to the last one's end.
    pub(super) fn new(
        out: W,
        grid: &Grid,
        (period, of_steps): (Period, u32),
    ) -> Result<Self, StorageError> {
        let shape = [grid.rows, grid.cols];
        Ok(Self {
            grid: *grid,
            period,
            of_steps,
            rows_done: 0,
            chunks_done: 0,
            steps: ListBuilder::new(UInt32Builder::new()).with_field(item(DataType::UInt32)),
            milliseconds: ListBuilder::new(Int64Builder::new()).with_field(item(DataType::Int64)),
            waiting: 0,
            table: parquet_table::Writer::new(out, &SCHEMA, CHUNKS_PER_GROUP, &shape)?,
        })
    }

    /// Adds the counts of the next rows: whole rows of chunks, or all that are left.
    pub(super) fn band(&mut self, counts: &Contributed) -> Result<(), StorageError> {
        let refused = |reason: String| Err(StorageError::damaged("counts to write", reason));
        let (cells, cols) = (counts.steps.len(), self.grid.cols as usize);
        let rows = u32::try_from(cells / cols.max(1)).unwrap_or(u32::MAX);
        let end = self.rows_done.saturating_add(rows);
        let is_whole = end == self.grid.rows || rows.is_multiple_of(CHUNK_ROWS);
        let is_filled = rows as usize * cols == cells && counts.milliseconds.len() == cells;
        if !is_whole || !is_filled || end > self.grid.rows {
            let (rows, cols) = (self.grid.rows, self.grid.cols);
            return refused(format!(
                "{cells} cells from row {} on do not fit {rows} x {cols}",
                self.rows_done
            ));
        }
        if (counts.period, counts.of_steps) != (self.period, self.of_steps) {
            return refused("its bands are of several steps".to_owned());
        }
        let band = Grid { rows, ..self.grid };
        for window in field_chunks(&band) {
            self.push(window, &band, counts);
            if self.waiting == CHUNKS_PER_GROUP {
                self.write()?;
            }
        }
        self.rows_done = end;
        Ok(())
    }

    fn push(&mut self, window: Window, band: &Grid, counts: &Contributed) {
        for cell in window.cell_indices(band) {
            self.steps.values().append_value(counts.steps[cell]);
            let milliseconds = counts.milliseconds[cell];
            self.milliseconds.values().append_value(milliseconds);
        }
        self.steps.append(true);
        self.milliseconds.append(true);
        self.waiting += 1;
    }

    fn write(&mut self) -> Result<(), StorageError> {
        let count = std::mem::take(&mut self.waiting);
        let numbers = self.chunks_done..self.chunks_done + count as u32;
        self.chunks_done = numbers.end;
        let time = |t: TimeMs| {
            Arc::new(TimestampMillisecondArray::from(vec![t.ms(); count]).with_timezone("UTC"))
        };
        let batch = RecordBatch::try_new(
            Arc::clone(&SCHEMA),
            vec![
                Arc::new(UInt32Array::from_iter_values(numbers)),
                time(self.period.start),
                time(self.period.end),
                Arc::new(UInt32Array::from(vec![self.of_steps; count])),
                Arc::new(self.steps.finish()),
                Arc::new(self.milliseconds.finish()),
            ],
        )
        .map_err(|e| StorageError::damaged("counts to write", e))?;
        self.table.write(&batch)
    }

    pub(super) fn finish(mut self) -> Result<W, StorageError> {
        if self.rows_done != self.grid.rows {
            let (done, all) = (self.rows_done, self.grid.rows);
            let reason = format!("{done} of {all} rows were given");
            return Err(StorageError::damaged("counts to write", reason));
        }
        if self.waiting > 0 {
            self.write()?;
        }
        self.table.finish()
    }
}

/// Counts that are written before they are put into a store.
pub struct Spooled {
    spool: Spool,
    counts: Writer<Spool>,
    /// Of what came so far: all steps are hashed before the first milliseconds.
    digest: NumbersDigest,
    complete_cells: u64,
}

impl Spooled {
    /// Counts of one of several steps that are written at a time, still without rows. What is too large to be held, all of
    /// them together, goes to files in `folder`.
    ///
    /// # Errors
    /// Their first bytes cannot be written.
    pub fn one_of(
        count: usize,
        folder: &Path,
        grid: &Grid,
        head: (Period, u32),
    ) -> Result<Self, StorageError> {
        let spool = Spool::holding(folder, HELD_BYTES / count.max(1) as u64);
        let begun = Writer::new(spool.clone(), grid, head);
        Ok(Self {
            counts: begun.map_err(|e| spool.or_failure(e))?,
            spool,
            digest: NumbersDigest::new(head.0, head.1),
            complete_cells: 0,
        })
    }

    /// Adds the next rows: whole rows of chunks, or all that are left.
    ///
    /// # Errors
    /// They are no such rows, or cannot be written.
    pub fn band(&mut self, counts: &Contributed) -> Result<(), StorageError> {
        self.digest.steps(&counts.steps);
        self.complete_cells += counts.complete_cells();
        let added = self.counts.band(counts);
        added.map_err(|e| self.spool.or_failure(e))
    }

    /// Stores them under the digest of their numbers; their key, and how many cells had data in all of the time.
    ///
    /// # Errors
    /// Rows are missing, or they cannot be stored.
    pub async fn put(
        self,
        store: &Store,
        product: &ProductId,
    ) -> Result<(ObjectKey, u64), StorageError> {
        let Self {
            spool,
            counts,
            mut digest,
            complete_cells,
        } = self;
        // Its name is known when it was read once.
        let unnamed = ObjectKey::contributed(product, &Digest::of(b"counts to write"));
        let work = move || {
            counts.finish().map_err(|e| spool.or_failure(e))?;
            let content = spool.into_content()?;
            Reader::each_milliseconds(&unnamed, &content, |some| digest.milliseconds(some))?;
            Ok((digest.finish(), content))
        };
        let (digest, content) = off_thread(work).await?;
        let key = ObjectKey::contributed(product, &digest);
        store.put_new_content(&key, content).await?;
        Ok((key, complete_cells))
    }
}
