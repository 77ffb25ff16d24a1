//! How complete the sums of accumulated carbon are: steps and time that contributed to every cell, map-major, a row a
//! chunk, stored beside the field of the sums.

use std::sync::{Arc, LazyLock};

use arrow::array::{
    Int64Builder, ListBuilder, RecordBatch, TimestampMillisecondArray, UInt32Array, UInt32Builder,
};
use arrow::datatypes::{
    DataType, Field, Int64Type, Schema, SchemaRef, TimeUnit, TimestampMillisecondType, UInt32Type,
};
use bytes::Bytes;
use contract::chunk::{Window, field_chunks};
use contract::digest::Digest;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::kind::Vouched;
use contract::product::ProductId;
use contract::time::{Period, TimeMs};

use crate::parquet_table::{self, shape_only};
use crate::sound::damage;
use crate::{StorageError, Store};

const CHUNKS_PER_GROUP: usize = 64;

/// Columns: `chunk`, `period_start`, `period_end`, `of_steps`, `steps`, `milliseconds`.
static SCHEMA: LazyLock<SchemaRef> = LazyLock::new(|| {
    let time = || DataType::Timestamp(TimeUnit::Millisecond, Some("UTC".into()));
    Arc::new(Schema::new(vec![
        Field::new("chunk", DataType::UInt32, false),
        Field::new("period_start", time(), false),
        Field::new("period_end", time(), false),
        Field::new("of_steps", DataType::UInt32, false),
        Field::new("steps", DataType::List(item(DataType::UInt32)), false),
        Field::new("milliseconds", DataType::List(item(DataType::Int64)), false),
    ]))
});

fn item(data_type: DataType) -> Arc<Field> {
    Arc::new(Field::new("item", data_type, false))
}

/// What the sums of all cells hold.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Contributed {
    /// From the start of accumulation to the end of the last step.
    pub period: Period,
    /// Steps in it.
    pub of_steps: u32,
    /// Steps that had data, `[row, col]`.
    pub steps: Vec<u32>,
    /// Time that they cover, ms, `[row, col]`.
    pub milliseconds: Vec<i64>,
}

impl Contributed {
    /// Before the first step.
    pub fn nothing(grid: &Grid, start: TimeMs) -> Self {
        Self {
            period: Period { start, end: start },
            of_steps: 0,
            steps: vec![0; grid.cell_count()],
            milliseconds: vec![0; grid.cell_count()],
        }
    }

    /// Adds a step: `has_data` is `[row, col]`. Time between steps that no step covers lacks in every cell.
    pub fn add(&mut self, step: Period, has_data: &[bool]) {
        let step_ms = step.end.ms() - step.start.ms();
        let cells = self.steps.iter_mut().zip(&mut self.milliseconds);
        for ((steps, milliseconds), _) in cells.zip(has_data).filter(|(_, has_data)| **has_data) {
            *steps += 1;
            *milliseconds += step_ms;
        }
        self.of_steps += 1;
        self.period.end = step.end;
    }

    /// Whether a cell had data in all of the time.
    pub fn is_complete(&self, cell: usize) -> bool {
        self.milliseconds[cell] == self.period_ms()
    }

    /// Cells that had data in all of the time.
    pub fn complete_cells(&self) -> u64 {
        let cells = 0..self.milliseconds.len();
        cells.filter(|&cell| self.is_complete(cell)).count() as u64
    }

    /// Share of the time that every cell lacks, `[row, col]`: 0 where the sum is complete, 1 where it holds nothing.
    pub fn lacking(&self) -> Vec<f32> {
        let period_ms = self.period_ms();
        let share = |&milliseconds: &i64| (period_ms - milliseconds) as f64 / period_ms as f64;
        let cells = self.milliseconds.iter();
        cells
            .map(|milliseconds| share(milliseconds) as f32)
            .collect()
    }

    fn period_ms(&self) -> i64 {
        self.period.end.ms() - self.period.start.ms()
    }

    /// Digest of the numbers themselves, whatever an encoder makes of them.
    fn digest(&self) -> Digest {
        let Period { start, end } = self.period;
        let head = [start.ms(), end.ms(), i64::from(self.of_steps)];
        let mut bytes: Vec<u8> = head.iter().flat_map(|n| n.to_le_bytes()).collect();
        bytes.extend(self.steps.iter().flat_map(|n| n.to_le_bytes()));
        bytes.extend(self.milliseconds.iter().flat_map(|n| n.to_le_bytes()));
        Digest::of(&bytes)
    }
}

fn encode(grid: &Grid, counts: &Contributed) -> Result<Bytes, StorageError> {
    let windows = field_chunks(grid);
    let mut steps = ListBuilder::new(UInt32Builder::new()).with_field(item(DataType::UInt32));
    let mut milliseconds = ListBuilder::new(Int64Builder::new()).with_field(item(DataType::Int64));
    for window in &windows {
        for cell in window.cell_indices(grid) {
            steps.values().append_value(counts.steps[cell]);
            milliseconds
                .values()
                .append_value(counts.milliseconds[cell]);
        }
        steps.append(true);
        milliseconds.append(true);
    }
    let time = |t: TimeMs| {
        Arc::new(TimestampMillisecondArray::from(vec![t.ms(); windows.len()]).with_timezone("UTC"))
    };
    let batch = RecordBatch::try_new(
        Arc::clone(&SCHEMA),
        vec![
            Arc::new(UInt32Array::from_iter_values(0..windows.len() as u32)),
            time(counts.period.start),
            time(counts.period.end),
            Arc::new(UInt32Array::from(vec![counts.of_steps; windows.len()])),
            Arc::new(steps.finish()),
            Arc::new(milliseconds.finish()),
        ],
    )
    .map_err(|e| StorageError::damaged("counts to write", e))?;
    parquet_table::encode(&batch, CHUNKS_PER_GROUP, &[grid.rows, grid.cols])
}

/// Counts of what is named by its numbers; on the grid that they say, which must be `grid` where that is known.
fn decode(
    key: &ObjectKey,
    content: Bytes,
    grid: Option<&Grid>,
) -> Result<Contributed, StorageError> {
    let damaged = |reason: &str| damage::found(key, reason);
    let table = parquet_table::decode(key, content, &SCHEMA)?;
    let [rows, cols] = table.shape[..] else {
        return Err(damaged("it does not say how large its grid is"));
    };
    if grid.is_some_and(|grid| (grid.rows, grid.cols) != (rows, cols)) {
        return Err(damaged("it is of another grid than its product"));
    }
    let (batch, grid) = (&table.batch, shape_only(rows, cols));
    let windows = field_chunks(&grid);
    let row_count = batch.num_rows();
    if row_count != windows.len() || row_count == 0 {
        return Err(damaged("it has other chunks than its grid"));
    }
    let time = |column: usize| {
        let times = parquet_table::numbers::<TimestampMillisecondType>(batch, column);
        TimeMs::new(times.value(0)).map_err(|e| damage::found(key, e))
    };
    let period = Period::new(time(1)?, time(2)?).map_err(|e| damage::found(key, e))?;
    let mut counts = Contributed {
        of_steps: parquet_table::numbers::<UInt32Type>(batch, 3).value(0),
        ..Contributed::nothing(&grid, period.start)
    };
    counts.period = period;
    let chunks = parquet_table::numbers::<UInt32Type>(batch, 0);
    for row in 0..row_count {
        let steps = parquet_table::row_values::<UInt32Type>(batch, 4, row);
        let milliseconds = parquet_table::row_values::<Int64Type>(batch, 5, row);
        let fits = |window: &&Window| [steps.len(), milliseconds.len()] == [window.cell_count(); 2];
        let window = windows.get(chunks.value(row) as usize).filter(fits);
        let window = window.ok_or_else(|| damaged("a chunk does not fit its grid"))?;
        let numbers = steps.values().iter().zip(milliseconds.values());
        for (cell, (steps, milliseconds)) in window.cell_indices(&grid).zip(numbers) {
            counts.steps[cell] = *steps;
            counts.milliseconds[cell] = *milliseconds;
        }
    }
    if key.vouches() == Vouched::Values(counts.digest()) {
        Ok(counts)
    } else {
        Err(damaged("its numbers are not those of its name"))
    }
}

/// Has an object these numbers that its name says?
pub(crate) fn check(key: &ObjectKey, content: Bytes) -> Result<(), StorageError> {
    decode(key, content, None).map(|_counts| ())
}

/// Reads stored counts, which must be those that their name says.
pub async fn read(
    store: &Store,
    key: &ObjectKey,
    grid: &Grid,
) -> Result<Contributed, StorageError> {
    decode(key, store.get(key).await?, Some(grid))
}

/// Stores counts under the digest of their numbers.
pub async fn write(
    store: &Store,
    product: &ProductId,
    grid: &Grid,
    counts: &Contributed,
) -> Result<ObjectKey, StorageError> {
    let cell_count = grid.cell_count();
    if [counts.steps.len(), counts.milliseconds.len()] != [cell_count; 2] {
        let reason = format!("{} cells, its grid has {cell_count}", counts.steps.len());
        return Err(StorageError::damaged("counts to write", reason));
    }
    let key = ObjectKey::contributed(product, &counts.digest());
    store.put_new(&key, encode(grid, counts)?).await?;
    Ok(key)
}

#[cfg(test)]
mod tests {
    use super::*;
    use arrow::compute::concat_batches;

    const GRID: Grid = Grid {
        rows: 70,
        cols: 130,
        north_deg: 35.0,
        west_deg: 0.0,
        dlat_deg: 1.0,
        dlon_deg: 1.0,
    };

    /// January with data everywhere, March with data in every third cell; nothing covers February.
    fn counts() -> Contributed {
        let [january, march] = [1, 3].map(|month| Period::month(2001, month).unwrap());
        let mut counts = Contributed::nothing(&GRID, january.start);
        counts.add(january, &vec![true; GRID.cell_count()]);
        assert_eq!(counts.complete_cells(), GRID.cell_count() as u64);
        let every_third: Vec<bool> = (0..GRID.cell_count()).map(|i| i % 3 == 0).collect();
        counts.add(march, &every_third);
        counts
    }

    #[test]
    fn a_cell_is_complete_only_with_data_in_all_of_the_time() {
        let counts = counts();
        assert_eq!((counts.of_steps, counts.complete_cells()), (2, 0));
        assert_eq!(counts.steps[..4], [2, 1, 1, 2]);
        let lacking = counts.lacking();
        assert!((lacking[0] - 28.0 / 90.0).abs() < 1e-6, "{}", lacking[0]);
        assert!((lacking[1] - 59.0 / 90.0).abs() < 1e-6, "{}", lacking[1]);
    }

    #[tokio::test]
    async fn counts_round_trip_and_are_named_by_their_numbers() {
        let (store, product) = (Store::memory(), "p".parse().unwrap());
        let key = write(&store, &product, &GRID, &counts()).await.unwrap();
        assert_eq!(read(&store, &key, &GRID).await.unwrap(), counts());
        assert_eq!(
            write(&store, &product, &GRID, &counts()).await.unwrap(),
            key
        );
        let mut other = counts();
        other.steps[7] += 1;
        let other_key = write(&store, &product, &GRID, &other).await.unwrap();
        assert_ne!(other_key, key);
        // Whole numbers under another name are somebody else's.
        let wrong = ObjectKey::contributed(&product, &Digest::of(b"wrong"));
        store
            .put_new(&wrong, store.get(&key).await.unwrap())
            .await
            .unwrap();
        let refused = read(&store, &wrong, &GRID).await.unwrap_err().to_string();
        assert!(refused.contains(wrong.as_str()), "{refused}");
        let narrower = Grid { cols: 129, ..GRID };
        assert!(read(&store, &key, &narrower).await.is_err());
    }

    #[test]
    fn counts_that_lack_a_chunk_or_have_one_twice_are_damaged() {
        // The last chunk holds nothing: without it the numbers are the same.
        let january = Period::month(2001, 1).unwrap();
        let last = field_chunks(&GRID).pop().unwrap();
        let mut has_data = vec![true; GRID.cell_count()];
        for cell in last.cell_indices(&GRID) {
            has_data[cell] = false;
        }
        let mut counts = Contributed::nothing(&GRID, january.start);
        counts.add(january, &has_data);
        let key = ObjectKey::contributed(&"p".parse().unwrap(), &counts.digest());
        let content = encode(&GRID, &counts).unwrap();
        let whole = parquet_table::decode(&key, content, &SCHEMA).unwrap().batch;
        let without = whole.slice(0, whole.num_rows() - 1);
        let twice = concat_batches(&SCHEMA, [&whole, &whole.slice(0, 1)]).unwrap();
        let read = |batch: &RecordBatch| {
            let shape = [GRID.rows, GRID.cols];
            let content = parquet_table::encode(batch, CHUNKS_PER_GROUP, &shape).unwrap();
            decode(&key, content, Some(&GRID))
        };
        assert_eq!(read(&whole).unwrap(), counts);
        for batch in [&without, &twice] {
            let error = read(batch).unwrap_err().to_string();
            assert!(error.contains("other chunks"), "{error}");
        }
    }
}
