//! Rows of a file that is read whole: those of before rows had checks, or pages of their own.

use std::collections::BTreeMap;

use arrow::array::{Array as _, PrimitiveArray, RecordBatch};
use arrow::datatypes::{Float32Type, UInt32Type};
use bytes::Bytes;
use contract::key::ObjectKey;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

use crate::StorageError;
use crate::parquet_table::row_values;
use crate::sound::damage;

/// A row, its values, and its check if it has one.
type Row = (u32, PrimitiveArray<Float32Type>, Option<u32>);

/// Some rows of a file, in the order in which they are asked for.
pub(super) fn rows(
    key: &ObjectKey,
    content: Bytes,
    wanted: &[u32],
) -> Result<Vec<Row>, StorageError> {
    let damaged = |e: &dyn std::fmt::Display| damage::found(key, e);
    let reader = ParquetRecordBatchReaderBuilder::try_new(content)
        .and_then(ParquetRecordBatchReaderBuilder::build)
        .map_err(|e| damaged(&e))?;
    let mut found = BTreeMap::new();
    for batch in reader {
        let batch = batch.map_err(|e| damaged(&e))?;
        for (row, values, check) in
            of_batch(&batch).ok_or_else(|| damaged(&"its columns are others"))?
        {
            if wanted.binary_search(&row).is_ok() && found.insert(row, (values, check)).is_some() {
                return Err(damaged(&"it has a row twice"));
            }
        }
    }
    if found.len() != wanted.len() {
        return Err(damaged(&"it lacks a row"));
    }
    let each = found.into_iter();
    Ok(each
        .map(|(row, (values, check))| (row, values, check))
        .collect())
}

fn of_batch(batch: &RecordBatch) -> Option<Vec<Row>> {
    let column = |name: &str| batch.schema().index_of(name).ok();
    let numbers = |at: usize| {
        let column = batch.column(at).as_any();
        column.downcast_ref::<PrimitiveArray<UInt32Type>>().cloned()
    };
    let values = column("values")?;
    let rows = numbers(0)?;
    let checks = match column("check") {
        Some(at) => Some(numbers(at)?),
        None => None,
    };
    let row = |at: usize| {
        let check = checks.as_ref().map(|checks| checks.value(at));
        let values = row_values::<Float32Type>(batch, values, at);
        (rows.value(at), values, check)
    };
    Some((0..batch.num_rows()).map(row).collect())
}
