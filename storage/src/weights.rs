//! Weights: the area of a region's share of every cell, a row a chunk, computed once and used for every step.

use std::sync::{Arc, LazyLock};

use arrow::array::{Float64Builder, ListBuilder, RecordBatch, UInt32Array};
use arrow::datatypes::{DataType, Field, Float64Type, Schema, SchemaRef};
use bytes::Bytes;
use contract::key::ObjectKey;

use crate::{StorageError, Store, parquet_table};

/// Chunks a reader takes at once.
const CHUNKS_PER_GROUP: usize = 64;

/// Columns of weights: `chunk` and `area_m2`, row-major in the chunk.
pub static SCHEMA: LazyLock<SchemaRef> = LazyLock::new(|| {
    Arc::new(Schema::new(vec![
        Field::new("chunk", DataType::UInt32, false),
        Field::new("area_m2", DataType::List(area_field()), false),
    ]))
});

fn area_field() -> Arc<Field> {
    Arc::new(Field::new("item", DataType::Float64, false))
}

/// Bytes of the weights of some chunks, in the order of their numbers.
pub fn encode(chunks: &[(u32, Vec<f64>)]) -> Result<Bytes, StorageError> {
    let mut lists = ListBuilder::new(Float64Builder::new()).with_field(area_field());
    for (_, areas) in chunks {
        lists.values().append_slice(areas);
        lists.append(true);
    }
    let numbers = chunks.iter().map(|(chunk, _)| *chunk);
    let batch = RecordBatch::try_new(
        Arc::clone(&SCHEMA),
        vec![
            Arc::new(UInt32Array::from_iter_values(numbers)),
            Arc::new(lists.finish()),
        ],
    )
    .map_err(|e| StorageError::damaged("weights to write", e))?;
    parquet_table::encode(&batch, CHUNKS_PER_GROUP)
}

/// Weights by chunk.
pub fn decode(object: &str, content: Bytes) -> Result<Vec<(u32, Vec<f64>)>, StorageError> {
    let batch = parquet_table::decode(object, content, &SCHEMA)?;
    let numbers = parquet_table::numbers(&batch, 0);
    let row = |row| {
        let areas = parquet_table::row_values::<Float64Type>(&batch, 1, row);
        (numbers.value(row), areas.values().to_vec())
    };
    Ok((0..batch.num_rows()).map(row).collect())
}

/// Reads stored weights.
pub async fn read(store: &Store, key: &ObjectKey) -> Result<Vec<(u32, Vec<f64>)>, StorageError> {
    decode(key.as_str(), store.get(key).await?)
}

/// Stores weights under the key of the job they were computed for.
pub async fn write(
    store: &Store,
    key: &ObjectKey,
    chunks: &[(u32, Vec<f64>)],
) -> Result<(), StorageError> {
    store.put_new(key, encode(chunks)?).await.map(|_new| ())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_round_trip_bit_for_bit() {
        let chunks = vec![(3, vec![0.1, 0.0, 1e12]), (7, vec![2.0 / 3.0])];
        let back = decode("w", encode(&chunks).unwrap()).unwrap();
        assert_eq!(back, chunks);
    }
}
