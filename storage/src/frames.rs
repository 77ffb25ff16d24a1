//! Frames: one time step map-major, a row a chunk with the chunk's values as one array.

use std::sync::{Arc, LazyLock};

use arrow::array::{
    Float32Builder, ListBuilder, RecordBatch, TimestampMillisecondArray, UInt32Array,
};
use arrow::datatypes::{DataType, Field, Float32Type, Schema, SchemaRef, TimeUnit};
use bytes::Bytes;
use contract::chunk::frame_chunks;
use contract::digest::Digest;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::product::ProductId;
use contract::time::Period;

use crate::{StorageError, Store, parquet_table};

/// Chunks a reader takes at once: small enough to spread a large frame over partitions.
const CHUNKS_PER_GROUP: usize = 64;

/// Columns of a frame: `chunk`, `period_start`, `period_end`, `values`.
pub static SCHEMA: LazyLock<SchemaRef> = LazyLock::new(|| {
    let time = || DataType::Timestamp(TimeUnit::Millisecond, Some("UTC".into()));
    Arc::new(Schema::new(vec![
        Field::new("chunk", DataType::UInt32, false),
        Field::new("period_start", time(), false),
        Field::new("period_end", time(), false),
        Field::new("values", DataType::List(value_field()), false),
    ]))
});

/// The item of a list of values: f32, never null; NaN is no data.
pub(crate) fn value_field() -> Arc<Field> {
    Arc::new(Field::new("item", DataType::Float32, false))
}

/// Bytes of a frame of `values` (`[row, col]`, stored unit, NaN no data).
pub fn encode(grid: &Grid, values: &[f32], period: Period) -> Result<Bytes, StorageError> {
    if values.len() != grid.cell_count() {
        let reason = format!("{} values for {} cells", values.len(), grid.cell_count());
        return Err(StorageError::damaged("frame to write", reason));
    }
    let windows = frame_chunks(grid);
    let mut lists = ListBuilder::new(Float32Builder::new()).with_field(value_field());
    for window in &windows {
        for index in window.cell_indices(grid) {
            // One bit pattern for "no data", so that equal frames are equal bytes.
            let value = values[index];
            let value = if value.is_nan() { f32::NAN } else { value };
            lists.values().append_value(value);
        }
        lists.append(true);
    }
    let time = |t: contract::time::TimeMs| {
        Arc::new(TimestampMillisecondArray::from(vec![t.ms(); windows.len()]).with_timezone("UTC"))
    };
    let batch = RecordBatch::try_new(
        Arc::clone(&SCHEMA),
        vec![
            Arc::new(UInt32Array::from_iter_values(0..windows.len() as u32)),
            time(period.start),
            time(period.end),
            Arc::new(lists.finish()),
        ],
    )
    .map_err(|e| StorageError::damaged("frame to write", e))?;
    parquet_table::encode(&batch, CHUNKS_PER_GROUP)
}

/// Values of a frame, `[row, col]`.
pub fn decode(object: &str, content: Bytes, grid: &Grid) -> Result<Vec<f32>, StorageError> {
    let batch = parquet_table::decode(object, content, &SCHEMA)?;
    let windows = frame_chunks(grid);
    let chunks = parquet_table::numbers(&batch, 0);
    if batch.num_rows() != windows.len() {
        let reason = format!(
            "{} chunks, its grid has {}",
            batch.num_rows(),
            windows.len()
        );
        return Err(StorageError::damaged(object, reason));
    }
    let mut values = vec![f32::NAN; grid.cell_count()];
    for row in 0..batch.num_rows() {
        let chunk = parquet_table::row_values::<Float32Type>(&batch, 3, row);
        let window = windows
            .get(chunks.value(row) as usize)
            .filter(|window| window.cell_count() == chunk.len())
            .ok_or_else(|| StorageError::damaged(object, "a chunk does not fit its grid"))?;
        for (index, value) in window.cell_indices(grid).zip(chunk.values()) {
            values[index] = *value;
        }
    }
    Ok(values)
}

/// Reads a stored frame.
pub async fn read(store: &Store, key: &ObjectKey, grid: &Grid) -> Result<Vec<f32>, StorageError> {
    decode(key.as_str(), store.get(key).await?, grid)
}

/// Stores a frame under the digest of its bytes.
pub async fn write(
    store: &Store,
    product: &ProductId,
    grid: &Grid,
    values: &[f32],
    period: Period,
) -> Result<ObjectKey, StorageError> {
    let content = encode(grid, values, period)?;
    let key = ObjectKey::frame(product, &Digest::of(&content));
    store.put_new(&key, content).await?;
    Ok(key)
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: Grid = Grid {
        rows: 70,
        cols: 130,
        north_deg: 35.0,
        west_deg: 0.0,
        dlat_deg: 1.0,
        dlon_deg: 1.0,
    };

    fn values() -> Vec<f32> {
        let value = |i: usize| {
            if i.is_multiple_of(7) {
                f32::NAN
            } else {
                i as f32
            }
        };
        (0..GRID.cell_count()).map(value).collect()
    }

    #[test]
    fn a_frame_round_trips_with_its_gaps() {
        let period = Period::month(2000, 1).unwrap();
        let bytes = encode(&GRID, &values(), period).unwrap();
        let back = decode("f", bytes, &GRID).unwrap();
        let bits = |v: &[f32]| v.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&back), bits(&values()));
    }

    #[test]
    fn equal_values_make_equal_bytes_whatever_their_nan() {
        let period = Period::month(2000, 1).unwrap();
        let mut other = values();
        other[0] = -f32::NAN;
        let a = encode(&GRID, &values(), period).unwrap();
        assert_eq!(a, encode(&GRID, &other, period).unwrap());
        other[1] = 2.0;
        assert_ne!(a, encode(&GRID, &other, period).unwrap());
    }

    #[test]
    fn bytes_that_are_no_frame_are_damaged() {
        let half = encode(&GRID, &values(), Period::month(2000, 1).unwrap()).unwrap();
        let other_grid = Grid { rows: 69, ..GRID };
        assert!(decode("f", half.clone(), &other_grid).is_err());
        assert!(decode("f", half.slice(..half.len() / 2), &GRID).is_err());
        assert!(decode("f", Bytes::from("text"), &GRID).is_err());
    }
}
