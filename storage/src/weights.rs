//! Weights: the area of a region's share of every cell, a row a chunk, computed once and used for every step.

use std::sync::{Arc, LazyLock};

use arrow::array::{Float64Builder, ListBuilder, RecordBatch, UInt32Array};
use arrow::datatypes::{DataType, Field, Float64Type, Schema, SchemaRef, UInt32Type};
use bytes::Bytes;
use contract::key::ObjectKey;

use crate::row_check::RowCheck;
use crate::sound::{self, Soundness, damage};
use crate::{StorageError, Store, parquet_table};

/// Version of the layout: part of what weights are named by.
pub const LAYOUT: u32 = 2;
/// Chunks a reader takes at once.
const CHUNKS_PER_GROUP: usize = 64;

/// Columns of weights: `chunk`, `area_m2`, row-major in the chunk, and `check`, the [`RowCheck`] of both.
pub static SCHEMA: LazyLock<SchemaRef> = LazyLock::new(|| {
    Arc::new(Schema::new(vec![
        Field::new("chunk", DataType::UInt32, false),
        Field::new("area_m2", DataType::List(area_field()), false),
        Field::new("check", DataType::UInt32, false),
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
    let check = |(chunk, areas): &(u32, Vec<f64>)| RowCheck::new().u32(*chunk).f64s(areas).finish();
    let batch = RecordBatch::try_new(
        Arc::clone(&SCHEMA),
        vec![
            Arc::new(UInt32Array::from_iter_values(numbers)),
            Arc::new(lists.finish()),
            Arc::new(UInt32Array::from_iter_values(chunks.iter().map(check))),
        ],
    )
    .map_err(|e| StorageError::damaged("weights to write", e))?;
    parquet_table::encode(&batch, CHUNKS_PER_GROUP, &[chunks.len() as u32])
}

/// Weights by chunk, of bytes that were read from under a key; their seal must be whole.
pub fn decode(key: &ObjectKey, content: Bytes) -> Result<Vec<(u32, Vec<f64>)>, StorageError> {
    sealed(key, sound::of_bytes(key, &content)?)?;
    let batch = parquet_table::decode(key, content, &SCHEMA)?.batch;
    let numbers = parquet_table::numbers::<UInt32Type>(&batch, 0);
    let row = |row| {
        let areas = parquet_table::row_values::<Float64Type>(&batch, 1, row);
        (numbers.value(row), areas.values().to_vec())
    };
    Ok((0..batch.num_rows()).map(row).collect())
}

/// Reads stored weights.
pub async fn read(store: &Store, key: &ObjectKey) -> Result<Vec<(u32, Vec<f64>)>, StorageError> {
    decode(key, store.fetch(key).await?)
}

/// Are there such weights, with a whole seal?
///
/// # Errors
/// `is_not_found` if there are none, `Damaged` if they are not what was stored.
pub async fn check(store: &Store, key: &ObjectKey) -> Result<(), StorageError> {
    let (_content, soundness) = store.get_with_soundness(key).await?;
    sealed(key, soundness)
}

fn sealed(key: &ObjectKey, soundness: Soundness) -> Result<(), StorageError> {
    match soundness {
        Soundness::Sound => Ok(()),
        Soundness::Unsealed => Err(damage::found(key, "its seal is gone")),
    }
}

/// Stores weights under the key of the job they were computed for.
pub async fn write(
    store: &Store,
    key: &ObjectKey,
    chunks: &[(u32, Vec<f64>)],
) -> Result<(), StorageError> {
    store.put_new(key, encode(chunks)?).await.map(|_new| ())
}

/// The same in the place of weights that were found damaged.
pub async fn write_over(
    store: &Store,
    key: &ObjectKey,
    chunks: &[(u32, Vec<f64>)],
) -> Result<(), StorageError> {
    store.put_over(key, encode(chunks)?).await
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn weights_round_trip_bit_for_bit_and_damaged_ones_are_none() {
        let store = Store::memory();
        let key = ObjectKey::weights(&contract::digest::Digest::of(b"job"));
        let chunks = vec![(3, vec![0.1, 0.0, 1e12]), (7, vec![2.0 / 3.0])];
        write(&store, &key, &chunks).await.unwrap();
        assert_eq!(read(&store, &key).await.unwrap(), chunks);
        let mut damaged = encode(&chunks).unwrap().to_vec();
        let middle = damaged.len() / 2;
        damaged[middle] ^= 4;
        store.put_over(&key, damaged.into()).await.unwrap();
        let error = read(&store, &key).await.unwrap_err();
        assert!(error.to_string().contains(key.as_str()), "{error}");
        write_over(&store, &key, &chunks).await.unwrap();
        assert_eq!(read(&store, &key).await.unwrap(), chunks);
    }
}
