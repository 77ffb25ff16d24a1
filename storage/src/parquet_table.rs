//! One record batch to Parquet bytes and back, with the same bytes for the same values.

use arrow::array::{Array as _, ArrayRef, ListArray, PrimitiveArray, RecordBatch, UInt32Array};
use arrow::compute::concat_batches;
use arrow::datatypes::{ArrowPrimitiveType, SchemaRef};
use bytes::Bytes;
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::basic::{Compression, ZstdLevel};
use parquet::file::properties::{EnabledStatistics, WriterProperties};

use crate::StorageError;

/// Bytes of a table; `rows_per_group` is how many rows a reader must take at once.
pub(crate) fn encode(batch: &RecordBatch, rows_per_group: usize) -> Result<Bytes, StorageError> {
    let damaged = |e: parquet::errors::ParquetError| StorageError::damaged("table to write", e);
    let properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_created_by("fluxglobe".to_owned())
        .set_dictionary_enabled(false)
        .set_statistics_enabled(EnabledStatistics::Chunk)
        .set_max_row_group_row_count(Some(rows_per_group))
        .build();
    let mut out = Vec::new();
    let mut writer =
        ArrowWriter::try_new(&mut out, batch.schema(), Some(properties)).map_err(damaged)?;
    writer.write(batch).map_err(damaged)?;
    writer.close().map_err(damaged)?;
    Ok(Bytes::from(out))
}

/// The table in some bytes, which must have this schema.
pub(crate) fn decode(
    object: &str,
    content: Bytes,
    schema: &SchemaRef,
) -> Result<RecordBatch, StorageError> {
    let damaged = |e: &dyn std::fmt::Display| StorageError::damaged(object, e);
    let builder = ParquetRecordBatchReaderBuilder::try_new(content).map_err(|e| damaged(&e))?;
    let reader = builder.build().map_err(|e| damaged(&e))?;
    let batches: Vec<RecordBatch> = reader.collect::<Result<_, _>>().map_err(|e| damaged(&e))?;
    let found = batches.first().map(RecordBatch::schema);
    if found.is_some_and(|found| found.fields() != schema.fields()) {
        return Err(StorageError::damaged(object, "its columns are others"));
    }
    concat_batches(schema, &batches).map_err(|e| damaged(&e))
}

/// A column of numbers of a decoded table.
pub(crate) fn numbers(batch: &RecordBatch, column: usize) -> &UInt32Array {
    batch
        .column(column)
        .as_any()
        .downcast_ref()
        .expect("the schema is checked in decode")
}

/// The array of values in one row of a list column.
pub(crate) fn row_values<T: ArrowPrimitiveType>(
    batch: &RecordBatch,
    column: usize,
    row: usize,
) -> PrimitiveArray<T> {
    let list: &ListArray = batch
        .column(column)
        .as_any()
        .downcast_ref()
        .expect("the schema is checked in decode");
    let values: ArrayRef = list.value(row);
    values
        .as_any()
        .downcast_ref::<PrimitiveArray<T>>()
        .expect("the schema is checked in decode")
        .clone()
}
