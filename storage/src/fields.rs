//! Fields: one time step map-major, a row a chunk with the chunk's values as one array.
//!
//! A field is named by the digest of its values: other bytes for the same values are the same field. Fields stored
//! before that was so are named by the digest of their bytes and have no check in their rows; they are read as they are.

mod names;

use std::sync::{Arc, LazyLock};

use arrow::array::{
    Float32Builder, ListBuilder, RecordBatch, TimestampMillisecondArray, UInt32Array,
};
use arrow::datatypes::{
    DataType, Field, Float32Type, Schema, SchemaRef, TimeUnit, TimestampMillisecondType, UInt32Type,
};
use bytes::Bytes;
use contract::chunk::{Window, field_chunks};
use contract::digest::Digest;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::kind::Vouched;
use contract::product::ProductId;
use contract::time::{Period, TimeMs};

use crate::off_thread::off_thread;
use crate::parquet_table::{self, Table, shape_only, value_field};
use crate::row_check::RowCheck;
use crate::rows::Expected;
use crate::sound::{self, damage};
use crate::values::{ValuesDigest, no_data_alike};
use crate::{Encoded, StorageError, Store};

pub use names::settle;

/// Chunks a reader takes at once: small enough to spread a large field over partitions.
const CHUNKS_PER_GROUP: usize = 64;
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
    let batch = batch(grid, values, period)?;
    Ok(Encoded {
        values_sha256: digest_of(grid, values, period),
        content: parquet_table::encode(&batch, CHUNKS_PER_GROUP, &[grid.rows, grid.cols])?,
    })
}

/// What a field is: the shape of its grid, its period, its values row by row. Where the grid lies is not in it: axes of
/// two files of one product may differ in their last digits.
pub fn digest_of(grid: &Grid, values: &[f32], period: Period) -> Digest {
    ValuesDigest::new("fluxglobe frame 2\n")
        .number(grid.rows.into())
        .number(grid.cols.into())
        .number(period.start.ms())
        .number(period.end.ms())
        .values(values)
        .finish()
}

fn batch(grid: &Grid, values: &[f32], period: Period) -> Result<RecordBatch, StorageError> {
    if values.len() != grid.cell_count() {
        let reason = format!("{} values for {} cells", values.len(), grid.cell_count());
        return Err(StorageError::damaged("field to write", reason));
    }
    let windows = field_chunks(grid);
    let mut lists = ListBuilder::new(Float32Builder::new()).with_field(value_field());
    let mut checks = Vec::with_capacity(windows.len());
    let mut chunk_values = vec![];
    for (chunk, window) in windows.iter().enumerate() {
        chunk_values.clear();
        chunk_values.extend(window.cell_indices(grid).map(|i| no_data_alike(values[i])));
        lists.values().append_slice(&chunk_values);
        lists.append(true);
        checks.push(check_of_row(chunk as u32, period, &chunk_values));
    }
    let time = |t: TimeMs| {
        Arc::new(TimestampMillisecondArray::from(vec![t.ms(); windows.len()]).with_timezone("UTC"))
    };
    RecordBatch::try_new(
        Arc::clone(&SCHEMA),
        vec![
            Arc::new(UInt32Array::from_iter_values(0..windows.len() as u32)),
            time(period.start),
            time(period.end),
            Arc::new(lists.finish()),
            Arc::new(UInt32Array::from(checks)),
        ],
    )
    .map_err(|e| StorageError::damaged("field to write", e))
}

fn check_of_row(chunk: u32, period: Period, values: &[f32]) -> u32 {
    RowCheck::new()
        .u32(chunk)
        .i64(period.start.ms())
        .i64(period.end.ms())
        .f32s(values)
        .finish()
}

/// Values of a field, `[row, col]`, and its period.
fn decode(
    key: &ObjectKey,
    content: Bytes,
    grid: Option<&Grid>,
) -> Result<(Vec<f32>, Period), StorageError> {
    let damaged = |reason: String| damage::found(key, reason);
    let name = match key.vouches() {
        Vouched::Values(name) => Some(name),
        Vouched::Bytes(_) | Vouched::Nothing => None,
    };
    let schema = if name.is_some() { &SCHEMA } else { &SCHEMA_1 };
    let table = parquet_table::decode(key, content, schema)?;
    let stored = match (&table.shape[..], grid) {
        (&[rows, cols], _) => shape_only(rows, cols),
        (_, Some(grid)) => *grid,
        _ => return Err(damaged("it does not say how large its grid is".to_owned())),
    };
    if let Some(grid) = grid.filter(|grid| (grid.rows, grid.cols) != (stored.rows, stored.cols)) {
        return Err(damaged(format!(
            "it is of {} x {} cells, its product of {} x {}",
            stored.rows, stored.cols, grid.rows, grid.cols
        )));
    }
    let (values, period) = values_of(&table, &stored).map_err(damaged)?;
    match name {
        Some(name) if digest_of(&stored, &values, period) != name => {
            Err(damaged("its values are not those of its name".to_owned()))
        }
        _ => Ok((values, period)),
    }
}

fn values_of(table: &Table, grid: &Grid) -> Result<(Vec<f32>, Period), String> {
    let batch = &table.batch;
    let windows = field_chunks(grid);
    if batch.num_rows() != windows.len() || windows.is_empty() {
        return Err(format!(
            "{} chunks, its grid has {}",
            batch.num_rows(),
            windows.len()
        ));
    }
    let chunks = parquet_table::numbers::<UInt32Type>(batch, 0);
    let time = |column| {
        let times = parquet_table::numbers::<TimestampMillisecondType>(batch, column);
        let first = times.value(0);
        if times.values().iter().any(|time| *time != first) {
            return Err("its chunks are of several periods".to_owned());
        }
        TimeMs::new(first).map_err(|e| e.to_string())
    };
    let period = Period::new(time(1)?, time(2)?).map_err(|e| e.to_string())?;
    let mut values = vec![f32::NAN; grid.cell_count()];
    for row in 0..batch.num_rows() {
        let chunk = parquet_table::row_values::<Float32Type>(batch, VALUES, row);
        let window = windows
            .get(chunks.value(row) as usize)
            .filter(|window| window.cell_count() == chunk.len())
            .ok_or("a chunk does not fit its grid")?;
        for (index, value) in window.cell_indices(grid).zip(chunk.values()) {
            values[index] = *value;
        }
    }
    Ok((values, period))
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
    decode(key, content, Some(grid)).map(|(values, _period)| values)
}

async fn read_with_period(
    store: &Store,
    key: &ObjectKey,
    grid: &Grid,
) -> Result<(Vec<f32>, Period), StorageError> {
    let content = store.get(key).await?;
    let (key, grid) = (key.clone(), *grid);
    off_thread(move || decode(&key, content, Some(&grid))).await
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
