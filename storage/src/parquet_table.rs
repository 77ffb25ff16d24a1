//! One record batch to sealed Parquet bytes and back, with the same bytes for the same values.

use std::io::Write;
use std::num::ParseIntError;
use std::sync::Arc;

use arrow::array::{Array as _, ArrayRef, ListArray, PrimitiveArray, RecordBatch};
#[cfg(test)]
use arrow::compute::concat_batches;
use arrow::datatypes::{ArrowPrimitiveType, DataType, Field, SchemaRef};
#[cfg(test)]
use bytes::Bytes;
use contract::grid::Grid;
use contract::key::ObjectKey;
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::{ParquetRecordBatchReader, ParquetRecordBatchReaderBuilder};
use parquet::basic::{Compression, ZstdLevel};
use parquet::file::metadata::{KeyValue, ParquetMetaData};
use parquet::file::properties::{EnabledStatistics, WriterProperties, WriterPropertiesBuilder};
use parquet::file::reader::ChunkReader;
use parquet::schema::types::ColumnPath;
use sha2::{Digest as _, Sha256};

use crate::StorageError;
use crate::sound::{damage, seal};

/// Bytes after which a page of arrays ends, which it does between rows: a row of 256 values or more is a page of its
/// own, so that a reader who wants some rows fetches and decodes those and no others.
const PAGE_BYTES: usize = 1 << 10;
/// Rows that are decoded together: of a field some 30 MB.
const ROWS_AT_ONCE: usize = 1 << 10;
/// Name of the entry of a file that holds the lengths of what its values lie on.
const SHAPE: &str = "fluxglobe.shape";

/// Bytes of a table; `rows_per_group` is how many rows share their entries in the footer, `shape` what its values lie on.
#[cfg(test)]
pub(crate) fn encode(
    batch: &RecordBatch,
    rows_per_group: usize,
    shape: &[u32],
) -> Result<Bytes, StorageError> {
    encode_as(batch, shape, properties(&batch.schema(), rows_per_group))
}

/// The same as another version of the libraries, or of this program, might write it.
#[cfg(test)]
pub(crate) fn encode_as(
    batch: &RecordBatch,
    shape: &[u32],
    properties: WriterPropertiesBuilder,
) -> Result<Bytes, StorageError> {
    let mut writer = Writer::with(Vec::new(), &batch.schema(), shape, properties)?;
    // Group by group: the writer cuts a batch by calling itself for the rest, once a group, and a series of some 20
    // million cells has so many groups that it would run out of stack, which ends the process.
    let mut first = 0;
    while first < batch.num_rows() {
        let rows = writer.rows_per_group.clamp(1, batch.num_rows() - first);
        writer.write(&batch.slice(first, rows))?;
        first += rows;
    }
    Ok(Bytes::from(writer.finish()?))
}

/// Groups of rows in, a sealed file out, written as they come: no more than a group is held.
pub(crate) struct Writer<W: Write + Send> {
    #[cfg(test)]
    rows_per_group: usize,
    rows: ArrowWriter<Sealing<W>>,
}

impl<W: Write + Send> Writer<W> {
    /// The same bytes as of [`encode`], if every batch but the last has as many rows as a group.
    pub(crate) fn new(
        out: W,
        schema: &SchemaRef,
        rows_per_group: usize,
        shape: &[u32],
    ) -> Result<Self, StorageError> {
        Self::with(out, schema, shape, properties(schema, rows_per_group))
    }

    fn with(
        out: W,
        schema: &SchemaRef,
        shape: &[u32],
        properties: WriterPropertiesBuilder,
    ) -> Result<Self, StorageError> {
        let shape: Vec<String> = shape.iter().map(ToString::to_string).collect();
        let shape = KeyValue::new(SHAPE.to_owned(), shape.join(" "));
        let properties = properties.set_key_value_metadata(Some(vec![shape])).build();
        #[cfg(test)]
        let rows_per_group = properties.max_row_group_row_count().unwrap_or(usize::MAX);
        let out = Sealing::Pages(out, Sha256::new());
        let rows = ArrowWriter::try_new(out, Arc::clone(schema), Some(properties));
        Ok(Self {
            #[cfg(test)]
            rows_per_group,
            rows: rows.map_err(unwritten)?,
        })
    }

    /// Writes the next rows.
    pub(crate) fn write(&mut self, batch: &RecordBatch) -> Result<(), StorageError> {
        self.rows.write(batch).map_err(unwritten)
    }

    /// Writes indexes, seal and footer.
    pub(crate) fn finish(mut self) -> Result<W, StorageError> {
        let ended = self.rows.flush().and_then(|()| Ok(self.rows.sync()?));
        ended.map_err(unwritten)?;
        // From here on nothing is written but what stands behind the last page.
        self.rows.inner_mut().end_pages();
        let sealing = self.rows.into_inner().map_err(unwritten)?;
        sealing.finish().map_err(unwritten)
    }
}

fn unwritten(error: impl std::fmt::Display) -> StorageError {
    StorageError::damaged("table to write", error)
}

/// What a file is written to: its pages are hashed on their way, its end is held until the seal can be put into it.
enum Sealing<W> {
    Pages(W, Sha256),
    End(W, Sha256, Vec<u8>),
    Taken,
}

impl<W: Write> Sealing<W> {
    fn end_pages(&mut self) {
        *self = match std::mem::replace(self, Self::Taken) {
            Self::Pages(out, pages) => Self::End(out, pages, vec![]),
            other => other,
        };
    }

    fn finish(self) -> std::io::Result<W> {
        match self {
            Self::End(mut out, pages, end) => {
                out.write_all(&seal::parquet_end(pages, end))?;
                out.flush()?;
                Ok(out)
            }
            Self::Pages(..) | Self::Taken => Err(std::io::ErrorKind::InvalidInput.into()),
        }
    }
}

impl<W: Write> Write for Sealing<W> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        match self {
            Self::Pages(out, pages) => {
                let count = out.write(bytes)?;
                pages.update(&bytes[..count]);
                Ok(count)
            }
            Self::End(_, _, end) => end.write(bytes),
            Self::Taken => Err(std::io::ErrorKind::InvalidInput.into()),
        }
    }

    fn flush(&mut self) -> std::io::Result<()> {
        match self {
            Self::Pages(out, _) => out.flush(),
            Self::End(..) | Self::Taken => Ok(()),
        }
    }
}

/// A table that was read.
#[cfg(test)]
pub(crate) struct Table {
    pub(crate) batch: RecordBatch,
}

/// The item of a list of values: f32, never null; NaN is no data.
pub(crate) fn value_field() -> Arc<Field> {
    Arc::new(Field::new("item", DataType::Float32, false))
}

/// A grid of which only the shape is known.
pub(crate) fn shape_only(rows: u32, cols: u32) -> Grid {
    Grid {
        rows,
        cols,
        north_deg: 0.0,
        west_deg: 0.0,
        dlat_deg: 0.0,
        dlon_deg: 0.0,
    }
}

/// How tables are written.
fn properties(schema: &SchemaRef, rows_per_group: usize) -> WriterPropertiesBuilder {
    let mut properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_created_by("fluxglobe".to_owned())
        .set_dictionary_enabled(false)
        .set_statistics_enabled(EnabledStatistics::Chunk)
        .set_max_row_group_row_count(Some(rows_per_group));
    for field in schema.fields() {
        properties = match field.data_type() {
            DataType::List(item) => {
                let parts = [field.name(), "list", item.name()].map(str::to_owned);
                let column = ColumnPath::new(parts.to_vec());
                properties.set_column_data_page_size_limit(column, PAGE_BYTES)
            }
            // Where the pages of arrays lie is told to readers only beside statistics of some column's pages.
            _ => properties.set_column_statistics_enabled(
                ColumnPath::from(field.name().as_str()),
                EnabledStatistics::Page,
            ),
        };
    }
    properties
}

/// The table in some bytes, which must have this schema.
#[cfg(test)]
pub(crate) fn decode(
    key: &ObjectKey,
    content: Bytes,
    schema: &SchemaRef,
) -> Result<Table, StorageError> {
    let damaged = |e: &dyn std::fmt::Display| damage::found(key, e);
    let Opened { batches, .. } = open(key, content)?;
    let batches: Vec<RecordBatch> = batches.collect::<Result<_, _>>().map_err(|e| damaged(&e))?;
    let found = batches.first().map(RecordBatch::schema);
    if found.is_some_and(|found| found.fields() != schema.fields()) {
        return Err(damaged(&"its columns are others"));
    }
    let batch = concat_batches(schema, &batches).map_err(|e| damaged(&e))?;
    Ok(Table { batch })
}

/// A table whose rows are still to be read.
pub(crate) struct Opened {
    /// What its values lie on: nothing where the file does not say.
    pub(crate) shape: Vec<u32>,
    /// Its rows, as its end says.
    pub(crate) row_count: u64,
    /// Some rows at a time; each batch must be compared with the schema.
    pub(crate) batches: ParquetRecordBatchReader,
}

/// The table in some bytes, row by row.
pub(crate) fn open(
    key: &ObjectKey,
    content: impl ChunkReader + 'static,
) -> Result<Opened, StorageError> {
    open_in(key, content, ROWS_AT_ONCE)
}

/// The same, so many rows decoded together.
pub(crate) fn open_in(
    key: &ObjectKey,
    content: impl ChunkReader + 'static,
    rows_at_once: usize,
) -> Result<Opened, StorageError> {
    let damaged = |e: &dyn std::fmt::Display| damage::found(key, e);
    let builder = ParquetRecordBatchReaderBuilder::try_new(content).map_err(|e| damaged(&e))?;
    let shape = shape_of(builder.metadata()).map_err(|e| damaged(&e))?;
    let rows = builder.metadata().file_metadata().num_rows();
    let batches = builder.with_batch_size(rows_at_once).build();
    Ok(Opened {
        shape,
        row_count: rows.unsigned_abs(),
        batches: batches.map_err(|e| damaged(&e))?,
    })
}

/// What the values of a table lie on; nothing where the file does not say.
pub(crate) fn shape_of(metadata: &ParquetMetaData) -> Result<Vec<u32>, ParseIntError> {
    let entries = metadata.file_metadata().key_value_metadata();
    let shape = entries
        .into_iter()
        .flatten()
        .find(|entry| entry.key == SHAPE)
        .and_then(|entry| entry.value.as_deref());
    let lengths = shape.unwrap_or_default().split_whitespace();
    lengths.map(str::parse).collect()
}

/// A column of numbers of a decoded table.
pub(crate) fn numbers<T: ArrowPrimitiveType>(
    batch: &RecordBatch,
    column: usize,
) -> &PrimitiveArray<T> {
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

#[cfg(test)]
mod tests {
    use arrow::array::{Float32Builder, ListBuilder, UInt32Array};
    use arrow::datatypes::Schema;
    use parquet::file::metadata::{PageIndexPolicy, ParquetMetaDataReader};

    use super::*;

    #[test]
    fn a_table_of_very_many_groups_needs_no_stack_for_them() {
        const ROWS: u32 = 5000;
        const STACK_BYTES: usize = 512 << 10;
        let field = Field::new("chunk", DataType::UInt32, false);
        let numbers = Arc::new(UInt32Array::from_iter_values(0..ROWS));
        let schema = Arc::new(Schema::new(vec![field]));
        let batch = RecordBatch::try_new(schema, vec![numbers]).unwrap();
        let encode = move || encode(&batch, 1, &[ROWS]).unwrap();
        let thread = std::thread::Builder::new().stack_size(STACK_BYTES);
        let content = thread.spawn(encode).unwrap().join().unwrap();
        let reader = ParquetRecordBatchReaderBuilder::try_new(content).unwrap();
        assert_eq!(reader.metadata().num_row_groups(), ROWS as usize);
    }

    #[test]
    fn a_row_of_many_values_is_a_page_of_its_own() {
        let item = Arc::new(Field::new("item", DataType::Float32, false));
        let schema = Arc::new(Schema::new(vec![
            Field::new("chunk", DataType::UInt32, false),
            Field::new("values", DataType::List(Arc::clone(&item)), false),
        ]));
        let mut lists = ListBuilder::new(Float32Builder::new()).with_field(item);
        for row in 0..100 {
            let value = |i: usize| (i * row) as f32;
            lists
                .values()
                .append_slice(&(0..7200).map(value).collect::<Vec<_>>());
            lists.append(true);
        }
        let numbers = Arc::new(UInt32Array::from_iter_values(0..100));
        let batch = RecordBatch::try_new(schema, vec![numbers, Arc::new(lists.finish())]).unwrap();
        let bytes = encode(&batch, 64, &[]).unwrap();
        let metadata = ParquetMetaDataReader::new()
            .with_page_index_policy(PageIndexPolicy::Required)
            .parse_and_finish(&bytes)
            .unwrap();
        let pages = |group: usize, column: usize| {
            let pages = &metadata.offset_index().unwrap()[group][column];
            pages.page_locations().len()
        };
        assert_eq!((pages(0, 0), pages(0, 1)), (1, 64));
        assert_eq!((pages(1, 0), pages(1, 1)), (1, 36));
    }
}
