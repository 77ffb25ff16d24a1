//! The object of counts in, those of some rows at a time out: it is compared with its name before the first.

use arrow::array::RecordBatch;
use arrow::datatypes::{Int64Type, TimestampMillisecondType, UInt32Type};
use contract::chunk::{CHUNK_ROWS, Window, field_chunk_count, field_chunks};
use contract::grid::{Grid, MAX_CELLS};
use contract::key::ObjectKey;
use contract::kind::Vouched;
use contract::time::{Period, TimeMs};
use parquet::arrow::arrow_reader::ParquetRecordBatchReader;

use super::{CHUNKS_PER_GROUP, Contributed, NumbersDigest, SCHEMA};
use crate::content::Content;
use crate::off_thread::off_thread;
use crate::parquet_table::{self, shape_only};
use crate::sound::damage;
use crate::{StorageError, Store};

const OTHER_CHUNKS: &str = "it has other chunks than its grid";

/// Counts that are read from the north to the south.
pub struct Reader {
    key: ObjectKey,
    grid: Grid,
    period: Period,
    of_steps: u32,
    rows_done: u32,
    /// Number of the chunk that comes next.
    chunk: u32,
    batches: ParquetRecordBatchReader,
    /// What was read last, and the row in it that comes next.
    batch: Option<(RecordBatch, usize)>,
}

impl Reader {
    /// Opens stored counts, which must be those that their name says.
    ///
    /// # Errors
    /// They are not, or of another grid, or cannot be read.
    pub async fn open(store: &Store, key: &ObjectKey, grid: &Grid) -> Result<Self, StorageError> {
        let content = Content::from(store.get(key).await?);
        let (key, grid) = (key.clone(), *grid);
        off_thread(move || Self::of(&key, &content, Some(&grid))).await
    }

    /// The same of what was read; on the grid that it says, which must be `grid` where that is known.
    pub(super) fn of(
        key: &ObjectKey,
        content: &Content,
        grid: Option<&Grid>,
    ) -> Result<Self, StorageError> {
        let first = Self::unchecked(key, content)?;
        let own = first.grid;
        if grid.is_some_and(|grid| (grid.rows, grid.cols) != (own.rows, own.cols)) {
            let reason = "it is of another grid than its product";
            return Err(damage::found(key, reason));
        }
        let mut digest = NumbersDigest::new(first.period, first.of_steps);
        first.each(|counts| digest.steps(&counts.steps))?;
        let again = Self::unchecked(key, content)?;
        again.each(|counts| digest.milliseconds(&counts.milliseconds))?;
        if key.vouches() != Vouched::Values(digest.finish()) {
            let reason = "its numbers are not those of its name";
            return Err(damage::found(key, reason));
        }
        Self::unchecked(key, content)
    }

    /// Milliseconds of all cells of what was just written, row by row.
    pub(super) fn each_milliseconds(
        key: &ObjectKey,
        content: &Content,
        mut take: impl FnMut(&[i64]),
    ) -> Result<(), StorageError> {
        Self::unchecked(key, content)?.each(|counts| take(&counts.milliseconds))
    }

    fn unchecked(key: &ObjectKey, content: &Content) -> Result<Self, StorageError> {
        let damaged = |reason: &str| damage::found(key, reason);
        let mut table = parquet_table::open_in(key, content.clone(), CHUNKS_PER_GROUP)?;
        let [rows, cols] = table.shape[..] else {
            return Err(damaged("it does not say how large its grid is"));
        };
        let grid = shape_only(rows, cols);
        // Before anything is allocated for a grid that the file made up.
        let cells = u64::from(rows) * u64::from(cols);
        if table.row_count != field_chunk_count(&grid) || !(1..=MAX_CELLS).contains(&cells) {
            return Err(damaged(OTHER_CHUNKS));
        }
        let first = next_batch(key, &mut table.batches)?.ok_or_else(|| damaged(OTHER_CHUNKS))?;
        let time = |column: usize| {
            let times = parquet_table::numbers::<TimestampMillisecondType>(&first, column);
            TimeMs::new(times.value(0)).map_err(|e| damage::found(key, e))
        };
        let period = Period::new(time(1)?, time(2)?).map_err(|e| damage::found(key, e))?;
        Ok(Self {
            key: key.clone(),
            grid,
            period,
            of_steps: parquet_table::numbers::<UInt32Type>(&first, 3).value(0),
            rows_done: 0,
            chunk: 0,
            batches: table.batches,
            batch: Some((first, 0)),
        })
    }

    /// From the start of accumulation to the end of the last step.
    pub fn period(&self) -> Period {
        self.period
    }

    /// Steps in it.
    pub fn of_steps(&self) -> u32 {
        self.of_steps
    }

    /// Rows of its grid.
    pub(super) fn row_count(&self) -> u32 {
        self.grid.rows
    }

    /// The counts of the next rows: whole rows of chunks, or all that are left.
    ///
    /// # Errors
    /// There are not so many; a chunk does not fit its grid.
    pub fn rows(&mut self, count: u32) -> Result<Contributed, StorageError> {
        let end = self.rows_done.saturating_add(count);
        let is_whole = end == self.grid.rows || count.is_multiple_of(CHUNK_ROWS);
        if count == 0 || end > self.grid.rows || !is_whole {
            let reason = format!("{count} rows from {} on were asked for", self.rows_done);
            return Err(StorageError::damaged(self.key.as_str(), reason));
        }
        let band = Grid {
            rows: count,
            ..self.grid
        };
        let mut counts = Contributed {
            period: self.period,
            of_steps: self.of_steps,
            steps: vec![0; band.cell_count()],
            milliseconds: vec![0; band.cell_count()],
        };
        for window in field_chunks(&band) {
            self.chunk(window, &band, &mut counts)?;
        }
        self.rows_done = end;
        Ok(counts)
    }

    /// Takes the next chunk, which must be the one of a window.
    fn chunk(
        &mut self,
        window: Window,
        band: &Grid,
        counts: &mut Contributed,
    ) -> Result<(), StorageError> {
        let damaged = |reason: &str| damage::found(&self.key, reason);
        if self
            .batch
            .as_ref()
            .is_none_or(|(own, row)| *row == own.num_rows())
        {
            let next = next_batch(&self.key, &mut self.batches)?;
            self.batch = next.map(|batch| (batch, 0));
        }
        let (batch, row) = self.batch.as_mut().ok_or_else(|| damaged(OTHER_CHUNKS))?;
        if parquet_table::numbers::<UInt32Type>(batch, 0).value(*row) != self.chunk {
            return Err(damaged(OTHER_CHUNKS));
        }
        let steps = parquet_table::row_values::<UInt32Type>(batch, 4, *row);
        let milliseconds = parquet_table::row_values::<Int64Type>(batch, 5, *row);
        if [steps.len(), milliseconds.len()] != [window.cell_count(); 2] {
            return Err(damaged("a chunk does not fit its grid"));
        }
        let numbers = steps.values().iter().zip(milliseconds.values());
        for (cell, (steps, milliseconds)) in window.cell_indices(band).zip(numbers) {
            counts.steps[cell] = *steps;
            counts.milliseconds[cell] = *milliseconds;
        }
        *row += 1;
        self.chunk += 1;
        Ok(())
    }

    /// All of it, a row of chunks at a time.
    fn each(mut self, mut take: impl FnMut(&Contributed)) -> Result<(), StorageError> {
        while self.rows_done < self.grid.rows {
            take(&self.rows(CHUNK_ROWS.min(self.grid.rows - self.rows_done))?);
        }
        Ok(())
    }
}

fn next_batch(
    key: &ObjectKey,
    batches: &mut ParquetRecordBatchReader,
) -> Result<Option<RecordBatch>, StorageError> {
    let Some(batch) = batches.next() else {
        return Ok(None);
    };
    let batch = batch.map_err(|e| damage::found(key, e))?;
    if batch.schema().fields() != SCHEMA.fields() {
        return Err(damage::found(key, "its columns are others"));
    }
    Ok((batch.num_rows() > 0).then_some(batch))
}
