//! How complete the sums of accumulated carbon are: steps and time that contributed to every cell, map-major, a row a
//! chunk, stored beside the field of the sums.

mod reader;
mod writer;

use std::sync::{Arc, LazyLock};

use arrow::datatypes::{DataType, Field, Schema, SchemaRef, TimeUnit};
use bytes::Bytes;
use contract::digest::Digest;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::product::ProductId;
use contract::time::{Period, TimeMs};
use sha2::{Digest as _, Sha256};

use crate::off_thread::off_thread;
use crate::spool::FOLDER;
use crate::{StorageError, Store};

pub use reader::Reader;
pub use writer::Spooled;

/// Numbers whose bytes are hashed together.
const HASHED_AT_ONCE: usize = 1024;
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
    #[cfg(test)]
    fn digest(&self) -> Digest {
        let mut numbers = NumbersDigest::new(self.period, self.of_steps);
        numbers.steps(&self.steps);
        numbers.milliseconds(&self.milliseconds);
        numbers.finish()
    }
}

/// The digest that counts are named by: all steps come before all milliseconds.
struct NumbersDigest(Sha256);

impl NumbersDigest {
    fn new(period: Period, of_steps: u32) -> Self {
        let mut hasher = Sha256::new();
        for number in [period.start.ms(), period.end.ms(), i64::from(of_steps)] {
            hasher.update(number.to_le_bytes());
        }
        Self(hasher)
    }

    fn steps(&mut self, steps: &[u32]) {
        for some in steps.chunks(HASHED_AT_ONCE) {
            let bytes: Vec<u8> = some.iter().flat_map(|n| n.to_le_bytes()).collect();
            self.0.update(&bytes);
        }
    }

    fn milliseconds(&mut self, milliseconds: &[i64]) {
        for some in milliseconds.chunks(HASHED_AT_ONCE) {
            let bytes: Vec<u8> = some.iter().flat_map(|n| n.to_le_bytes()).collect();
            self.0.update(&bytes);
        }
    }

    fn finish(self) -> Digest {
        Digest::from_bytes(self.0.finalize().into())
    }
}

/// Has an object these numbers that its name says?
pub(crate) fn check(key: &ObjectKey, content: Bytes) -> Result<(), StorageError> {
    Reader::of(key, &content.into(), None).map(|_reader| ())
}

/// Reads stored counts, which must be those that their name says.
pub async fn read(
    store: &Store,
    key: &ObjectKey,
    grid: &Grid,
) -> Result<Contributed, StorageError> {
    let mut reader = Reader::open(store, key, grid).await?;
    off_thread(move || reader.rows(reader.row_count())).await
}

/// Stores counts under the digest of their numbers.
pub async fn write(
    store: &Store,
    product: &ProductId,
    grid: &Grid,
    counts: &Contributed,
) -> Result<ObjectKey, StorageError> {
    let folder = FOLDER.as_path();
    let mut spooled = Spooled::one_of(1, folder, grid, (counts.period, counts.of_steps))?;
    spooled.band(counts)?;
    spooled
        .put(store, product)
        .await
        .map(|(key, _complete)| key)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parquet_table;
    use arrow::array::RecordBatch;
    use arrow::compute::concat_batches;
    use contract::chunk::field_chunks;

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
        let mut writer = writer::Writer::new(vec![], &GRID, (counts.period, 1)).unwrap();
        writer.band(&counts).unwrap();
        let content = writer.finish().unwrap().into();
        let whole = parquet_table::decode(&key, content, &SCHEMA).unwrap().batch;
        let without = whole.slice(0, whole.num_rows() - 1);
        let twice = concat_batches(&SCHEMA, [&whole, &whole.slice(0, 1)]).unwrap();
        let read = |batch: &RecordBatch| {
            let shape = [GRID.rows, GRID.cols];
            let content = parquet_table::encode(batch, CHUNKS_PER_GROUP, &shape).unwrap();
            Reader::of(&key, &content.into(), Some(&GRID))?.rows(GRID.rows)
        };
        assert_eq!(read(&whole).unwrap(), counts);
        // As many as there should be, one of them in the place of another.
        let first = concat_batches(&SCHEMA, [&whole.slice(0, 1), &without]).unwrap();
        for batch in [&without, &twice, &first] {
            let error = read(batch).unwrap_err().to_string();
            assert!(error.contains("other chunks"), "{error}");
        }
    }

    #[tokio::test]
    async fn counts_have_the_same_bytes_in_whatever_bands_they_come_and_are_read() {
        let (store, product) = (Store::memory(), "p".parse().unwrap());
        let (counts, cols) = (counts(), GRID.cols as usize);
        let key = write(&store, &product, &GRID, &counts).await.unwrap();
        let other = Store::memory();
        // What is put aside lies in a file.
        let folder = FOLDER.as_path();
        let head = (counts.period, counts.of_steps);
        let mut spooled = Spooled::one_of(usize::MAX, folder, &GRID, head).unwrap();
        let mut reader = Reader::open(&store, &key, &GRID).await.unwrap();
        assert_eq!((reader.period(), reader.of_steps()), head);
        for rows in [0..60usize, 60..70] {
            let band = reader.rows(rows.len() as u32).unwrap();
            let cells = rows.start * cols..rows.end * cols;
            assert_eq!(band.steps, counts.steps[cells.clone()]);
            assert_eq!(band.milliseconds, counts.milliseconds[cells]);
            spooled.band(&band).unwrap();
        }
        assert!(reader.rows(1).is_err(), "there are no more");
        let put = spooled.put(&other, &product).await.unwrap();
        assert_eq!(put, (key.clone(), counts.complete_cells()));
        assert_eq!(
            other.get(&key).await.unwrap(),
            store.get(&key).await.unwrap()
        );
        // Rows that end within a chunk.
        let band = |rows: usize| Contributed {
            steps: counts.steps[..rows * cols].to_vec(),
            milliseconds: counts.milliseconds[..rows * cols].to_vec(),
            ..counts
        };
        let mut part = Spooled::one_of(1, folder, &GRID, head).unwrap();
        let told = part.band(&band(30)).unwrap_err().to_string();
        assert!(told.contains("do not fit 70 x 130"), "{told}");
        let mut reader = Reader::open(&store, &key, &GRID).await.unwrap();
        let told = reader.rows(30).unwrap_err().to_string();
        assert!(told.contains("30 rows from 0 on"), "{told}");
        let few = Spooled::one_of(1, folder, &GRID, head).unwrap();
        assert!(few.put(&other, &product).await.is_err(), "rows are missing");
    }

    /// Of 81 chunks, in bands of which each has complete cells.
    #[tokio::test]
    async fn counts_of_more_chunks_than_a_group_are_written_and_read_in_bands() {
        let grid = Grid {
            rows: 540,
            cols: 1000,
            north_deg: 54.0,
            west_deg: 0.0,
            dlat_deg: 0.2,
            dlon_deg: 0.2,
        };
        assert!(field_chunks(&grid).len() > CHUNKS_PER_GROUP);
        let january = Period::month(2001, 1).unwrap();
        let mut counts = Contributed::nothing(&grid, january.start);
        let has_data: Vec<bool> = (0..grid.cell_count()).map(|i| i % 1007 < 3).collect();
        counts.add(january, &has_data);
        for (number, steps) in (0..).zip(&mut counts.steps) {
            *steps = number;
        }
        let (store, product) = (Store::memory(), "p".parse().unwrap());
        let head = (counts.period, counts.of_steps);
        let mut spooled = Spooled::one_of(1, FOLDER.as_path(), &grid, head).unwrap();
        for rows in [0..300usize, 300..540] {
            let cells = rows.start * 1000..rows.end * 1000;
            let band = Contributed {
                steps: counts.steps[cells.clone()].to_vec(),
                milliseconds: counts.milliseconds[cells].to_vec(),
                ..counts
            };
            spooled.band(&band).unwrap();
        }
        let (key, complete_cells) = spooled.put(&store, &product).await.unwrap();
        assert!(complete_cells > 1000);
        assert_eq!(complete_cells, counts.complete_cells());
        assert!(read(&store, &key, &grid).await.unwrap() == counts);
        let mut reader = Reader::open(&store, &key, &grid).await.unwrap();
        let mut found = Contributed {
            steps: vec![],
            milliseconds: vec![],
            ..counts
        };
        for rows in [480, 60] {
            let band = reader.rows(rows).unwrap();
            found.steps.extend(band.steps);
            found.milliseconds.extend(band.milliseconds);
        }
        assert!(found == counts, "read in bands it is another one");
    }
}
