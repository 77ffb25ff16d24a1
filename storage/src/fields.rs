//! Fields: one time step map-major, a row a chunk with the chunk's values as one array.
//!
//! A field is named by the digest of its values: other bytes for the same values are the same field. Fields stored
//! before that was so are named by the digest of their bytes and have no check in their rows; they are read as they are.

mod cut;
mod files;
mod names;
mod reader;
mod spooled;
mod writer;

use std::sync::{Arc, LazyLock};

use arrow::array::RecordBatch;
use arrow::datatypes::{
    DataType, Field, Float32Type, Schema, SchemaRef, TimeUnit, TimestampMillisecondType, UInt32Type,
};
use bytes::Bytes;
use contract::chunk::{BAND_CELLS, Window, field_chunk_count, field_chunks};
use contract::digest::Digest;
use contract::grid::{Grid, MAX_CELLS};
use contract::key::ObjectKey;
use contract::kind::Vouched;
use contract::product::ProductId;
use contract::time::{Period, TimeMs};

use crate::off_thread::off_thread;
use crate::parquet_table::{self, shape_only, value_field};
use crate::row_check::RowCheck;
use crate::rows::Expected;
use crate::sound::{self, damage};
use crate::values::ValuesDigest;
use crate::{Encoded, StorageError, Store};

pub use files::FileWindows;
pub use names::settle;
pub use reader::{Bands, Reader};
pub use spooled::Spooled;
pub use writer::Writer;

/// Chunks a reader takes at once: small enough to spread a large field over partitions.
const CHUNKS_PER_GROUP: usize = 64;
/// Fields of more cells are never held as an object and as values at once.
const WHOLE_CELLS: u64 = 1 << 26;
/// Column of the values.
const VALUES: usize = 3;

/// Columns of a field: `chunk`, `period_start`, `period_end`, `values`, and `check`, the [`RowCheck`] of the others in
/// their order.
pub static SCHEMA: LazyLock<SchemaRef> = LazyLock::new(|| {
    let mut fields = SCHEMA_1.fields().to_vec();
    fields.push(Arc::new(Field::new("check", DataType::UInt32, false)));
    Arc::new(Schema::new(fields))
});

/// The same of fields that are named by their bytes.
pub static SCHEMA_1: LazyLock<SchemaRef> = LazyLock::new(|| {
    let time = || DataType::Timestamp(TimeUnit::Millisecond, Some("UTC".into()));
    Arc::new(Schema::new(vec![
        Field::new("chunk", DataType::UInt32, false),
        Field::new("period_start", time(), false),
        Field::new("period_end", time(), false),
        Field::new("values", DataType::List(value_field()), false),
    ]))
});

/// What the row of a chunk must be, for who reads some rows ([`crate::rows`]); `chunks` are all of the grid.
pub fn expected(chunks: &[Window], chunk: u32, period: Period) -> Expected {
    let check = RowCheck::new().u32(chunk);
    Expected {
        length: chunks.get(chunk as usize).map_or(0, |own| own.cell_count()),
        check: check.i64(period.start.ms()).i64(period.end.ms()),
    }
}

/// A field of `values` (`[row, col]`, stored unit, NaN no data) as bytes.
pub fn encode(grid: &Grid, values: &[f32], period: Period) -> Result<Encoded, StorageError> {
    if values.len() != grid.cell_count() {
        let reason = format!("{} values for {} cells", values.len(), grid.cell_count());
        return Err(StorageError::damaged("field to write", reason));
    }
    let mut field = Writer::new(vec![], grid, period)?;
    for band in writer::in_bands(grid, values, BAND_CELLS) {
        field.band(band)?;
    }
    let (values_sha256, content) = field.finish()?;
    Ok(Encoded {
        values_sha256,
        content: content.into(),
    })
}

/// What a field is: the shape of its grid, its period, its values row by row. Where the grid lies is not in it: axes of
/// two files of one product may differ in their last digits.
pub fn digest_of(grid: &Grid, values: &[f32], period: Period) -> Digest {
    digest_begun(grid, period).values(values).finish()
}

/// The same of a field whose values come some rows after the other.
pub struct FieldDigest(ValuesDigest);

impl FieldDigest {
    /// Of a field of a period on a grid, before its values.
    pub fn new(grid: &Grid, period: Period) -> Self {
        Self(digest_begun(grid, period))
    }

    /// Adds the next rows.
    pub fn add(&mut self, values: &[f32]) {
        self.0.add(values);
    }

    /// The digest of all that were added.
    pub fn finish(self) -> Digest {
        self.0.finish()
    }
}

/// The same before its values.
fn digest_begun(grid: &Grid, period: Period) -> ValuesDigest {
    ValuesDigest::new("fluxglobe frame 2\n")
        .number(grid.rows.into())
        .number(grid.cols.into())
        .number(period.start.ms())
        .number(period.end.ms())
}

fn check_of_row(chunk: u32, period: Period, values: &[f32]) -> u32 {
    RowCheck::new()
        .u32(chunk)
        .i64(period.start.ms())
        .i64(period.end.ms())
        .f32s(values)
        .finish()
}

/// Why values are damaged that are others than their name says.
const OTHER_VALUES: &str = "its values are not those of its name";

fn other_grid(found: &Grid, wanted: &Grid) -> String {
    format!(
        "it is of {} x {} cells, its product of {} x {}",
        found.rows, found.cols, wanted.rows, wanted.cols
    )
}

/// The grid of a field, its values, `[row, col]`, and its period.
fn decode(
    key: &ObjectKey,
    content: Bytes,
    grid: Option<&Grid>,
) -> Result<(Grid, Vec<f32>, Period), StorageError> {
    let damaged = |reason: String| damage::found(key, reason);
    let name = match key.vouches() {
        Vouched::Values(name) => Some(name),
        Vouched::Bytes(_) | Vouched::Nothing => None,
    };
    let schema = if name.is_some() { &SCHEMA } else { &SCHEMA_1 };
    let table = parquet_table::open(key, content)?;
    let stored = match (&table.shape[..], grid) {
        (&[rows, cols], _) => shape_only(rows, cols),
        (_, Some(grid)) => *grid,
        _ => return Err(damaged("it does not say how large its grid is".to_owned())),
    };
    if let Some(grid) = grid.filter(|grid| (grid.rows, grid.cols) != (stored.rows, stored.cols)) {
        return Err(damaged(other_grid(&stored, grid)));
    }
    // Before anything is allocated for a grid that the file made up.
    check_count(&stored, table.row_count).map_err(damaged)?;
    let mut whole = Whole::new(&stored);
    for batch in table.batches {
        let batch = batch.map_err(|e| damage::found(key, e))?;
        if batch.schema().fields() != schema.fields() {
            return Err(damaged("its columns are others".to_owned()));
        }
        whole.add(&batch).map_err(damaged)?;
    }
    let (values, period) = whole.finish().map_err(damaged)?;
    match name {
        Some(name) if digest_of(&stored, &values, period) != name => {
            Err(damaged(OTHER_VALUES.to_owned()))
        }
        _ => Ok((grid.copied().unwrap_or(stored), values, period)),
    }
}

/// A field of which rows come.
struct Whole<'a> {
    grid: &'a Grid,
    windows: Vec<Window>,
    row_count: u64,
    period: Option<Period>,
    values: Vec<f32>,
}

impl<'a> Whole<'a> {
    fn new(grid: &'a Grid) -> Self {
        Self {
            grid,
            windows: field_chunks(grid),
            row_count: 0,
            period: None,
            values: vec![f32::NAN; grid.cell_count()],
        }
    }

    fn add(&mut self, batch: &RecordBatch) -> Result<(), String> {
        let chunks = parquet_table::numbers::<UInt32Type>(batch, 0);
        let time = |column, row| {
            let times = parquet_table::numbers::<TimestampMillisecondType>(batch, column);
            TimeMs::new(times.value(row)).map_err(|e| e.to_string())
        };
        for row in 0..batch.num_rows() {
            let period = Period::new(time(1, row)?, time(2, row)?).map_err(|e| e.to_string())?;
            if *self.period.get_or_insert(period) != period {
                return Err("its chunks are of several periods".to_owned());
            }
            let chunk = parquet_table::row_values::<Float32Type>(batch, VALUES, row);
            let window = self
                .windows
                .get(chunks.value(row) as usize)
                .filter(|window| window.cell_count() == chunk.len())
                .ok_or("a chunk does not fit its grid")?;
            for (index, value) in window.cell_indices(self.grid).zip(chunk.values()) {
                self.values[index] = *value;
            }
        }
        self.row_count += batch.num_rows() as u64;
        Ok(())
    }

    fn finish(self) -> Result<(Vec<f32>, Period), String> {
        check_count(self.grid, self.row_count)?;
        let period = self.period.ok_or("it has no chunk")?;
        Ok((self.values, period))
    }
}

/// Has a field as many chunks as its grid, and no more than one may have?
fn check_count(grid: &Grid, row_count: u64) -> Result<(), String> {
    let (cells, chunks) = (
        u64::from(grid.rows) * u64::from(grid.cols),
        field_chunk_count(grid),
    );
    if row_count == chunks && (1..=MAX_CELLS).contains(&cells) {
        return Ok(());
    }
    Err(format!("{row_count} chunks, its grid has {chunks}"))
}

/// Has a field that is named by its values these values?
pub(crate) fn check_values(key: &ObjectKey, content: Bytes) -> Result<(), StorageError> {
    decode(key, content, None).map(|_values| ())
}

/// Reads a stored field, `[row, col]`. Its bytes and its values are compared with its name.
pub async fn read(store: &Store, key: &ObjectKey, grid: &Grid) -> Result<Vec<f32>, StorageError> {
    read_with_period(store, key, grid)
        .await
        .map(|(values, _period)| values)
}

/// The same of bytes that somebody else read from under its key.
pub fn of_bytes(key: &ObjectKey, content: Bytes, grid: &Grid) -> Result<Vec<f32>, StorageError> {
    sound::of_bytes(key, &content)?;
    decode(key, content, Some(grid)).map(|(_grid, values, _period)| values)
}

async fn read_with_period(
    store: &Store,
    key: &ObjectKey,
    grid: &Grid,
) -> Result<(Vec<f32>, Period), StorageError> {
    if grid.cell_count() as u64 > WHOLE_CELLS {
        return read_by_bands(store, key, grid).await;
    }
    let content = store.get(key).await?;
    let (key, grid) = (key.clone(), *grid);
    let decoded = off_thread(move || decode(&key, content, Some(&grid))).await;
    decoded.map(|(_grid, values, period)| (values, period))
}

/// The same without holding the object beside the values.
async fn read_by_bands(
    store: &Store,
    key: &ObjectKey,
    grid: &Grid,
) -> Result<(Vec<f32>, Period), StorageError> {
    let reader = Reader::open(store, key, Some(grid)).await?;
    let period = reader.period();
    let mut bands = reader.bands();
    let mut values = Vec::with_capacity(grid.cell_count());
    while let Some((_rows, band)) = bands.next().await? {
        values.extend_from_slice(&band);
    }
    Ok((values, period))
}

/// The bands of a stored field, of at most so many cells: a field of one is read whole, as [`read`] does it.
pub async fn bands(
    store: &Store,
    key: &ObjectKey,
    grid: &Grid,
    most_cells: u64,
) -> Result<Bands, StorageError> {
    let reader = if grid.cell_count() as u64 <= most_cells.min(WHOLE_CELLS) {
        Reader::whole(store, key, grid).await?
    } else {
        Reader::open(store, key, Some(grid)).await?
    };
    Ok(reader.bands_of(most_cells))
}

/// Stores a field under the digest of its values.
pub async fn write(
    store: &Store,
    product: &ProductId,
    grid: &Grid,
    values: &[f32],
    period: Period,
) -> Result<ObjectKey, StorageError> {
    let encoded = encode(grid, values, period)?;
    let key = ObjectKey::field(product, &encoded.values_sha256);
    store.put_new(&key, encoded.content).await?;
    Ok(key)
}

#[cfg(test)]
mod tests;
