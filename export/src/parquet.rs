//! One Parquet file with a row for each cell that holds a value: start and end of its step, latitude and longitude of its
//! centre, value. A step begins a row group, so that a time is found by the statistics of its columns.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow::array::{ArrayRef, Float32Array, Float64Array, TimestampMillisecondArray};
use arrow::datatypes::{DataType, Field, Schema, TimeUnit};
use arrow::record_batch::RecordBatch;
use contract::time::Period;
use cube::{Description, Places, cf};
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression, ZstdLevel};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use serde_json::Value;
use tempfile::NamedTempFile;

use crate::cells::Cells;
use crate::{ExportError, Values, Written, part_of};

/// Cells whose rows are made at a time: some 40 MB.
const CELLS_AT_ONCE: usize = 1 << 20;
/// Most rows of a row group.
const GROUP_ROWS: usize = 1 << 22;

/// The file as it is being written.
pub struct Table {
    path: PathBuf,
    writer: ArrowWriter<NamedTempFile>,
    schema: Arc<Schema>,
    description: Description,
    lat: Places,
    lon: Places,
}

impl Table {
    pub(crate) fn create(path: &Path, description: &Description) -> Result<Self, ExportError> {
        let part = part_of(path)?;
        let schema = schema(description);
        let properties = properties(description).map_err(ExportError::library(path))?;
        let writer = ArrowWriter::try_new(part, Arc::clone(&schema), Some(properties));
        let (lat, lon) = cube::places(&description.grid);
        Ok(Self {
            path: path.to_owned(),
            writer: writer.map_err(ExportError::library(path))?,
            schema,
            description: description.clone(),
            lat,
            lon,
        })
    }

    /// The rows of some cells of a step, `first` the index of the first.
    fn rows(
        &self,
        period: Period,
        values: &[f32],
        first: usize,
    ) -> Result<RecordBatch, ExportError> {
        let cols = self.description.grid.cols as usize;
        let with_data = || {
            values
                .iter()
                .enumerate()
                .filter(|(_, value)| !value.is_nan())
        };
        let cells = || with_data().map(|(offset, _)| first + offset);
        let count = with_data().count();
        let instants = |ms: i64| {
            let column = TimestampMillisecondArray::from_value(ms, count);
            Arc::new(column.with_timezone("UTC")) as ArrayRef
        };
        let lat = cells().map(|cell| self.lat.centres[cell / cols]);
        let lon = cells().map(|cell| self.lon.centres[cell % cols]);
        let value = with_data().map(|(_, value)| *value);
        let columns = vec![
            instants(period.start.ms()),
            instants(period.end.ms()),
            Arc::new(Float64Array::from_iter_values(lat)) as ArrayRef,
            Arc::new(Float64Array::from_iter_values(lon)),
            Arc::new(Float32Array::from_iter_values(value)),
        ];
        let rows = RecordBatch::try_new(Arc::clone(&self.schema), columns);
        rows.map_err(ExportError::library(&self.path))
    }
}

impl Written for Table {
    fn append(&mut self, period: Period, values: Values<'_>) -> Result<(), ExportError> {
        let mut cells = Cells::new(values, &self.description.grid);
        let mut first = 0;
        while let Some(values) = cells.next(CELLS_AT_ONCE)? {
            let rows = self.rows(period, values, first)?;
            first += values.len();
            let written = self.writer.write(&rows);
            written.map_err(ExportError::library(&self.path))?;
        }
        self.writer
            .flush()
            .map_err(ExportError::library(&self.path))
    }

    fn finish(self: Box<Self>) -> Result<(), ExportError> {
        let Self { path, writer, .. } = *self;
        let part = writer.into_inner().map_err(ExportError::library(&path))?;
        let kept = part.persist_noclobber(&path);
        kept.map(|_file| ())
            .map_err(|e| ExportError::io(&path)(e.error))
    }
}

/// Columns: of accumulated carbon `time_end` is what the sum has reached.
fn schema(description: &Description) -> Arc<Schema> {
    let instant = || DataType::Timestamp(TimeUnit::Millisecond, Some("UTC".into()));
    let with_unit = |name: &str, kind, unit: &str| {
        let unit = [("units".to_owned(), unit.to_owned())];
        Field::new(name, kind, false).with_metadata(unit.into())
    };
    let variable = cf::variable(description.quantity);
    // What other formats say of the values; there is no grid mapping here to name.
    let said = cf::of_values(description).into_iter();
    let said = said.filter(|(name, _)| name != "grid_mapping");
    let values = Field::new(&variable, DataType::Float32, false)
        .with_metadata(said.map(|(name, value)| (name, text(&value))).collect());
    Arc::new(Schema::new(vec![
        Field::new("time_start", instant(), false),
        Field::new("time_end", instant(), false),
        with_unit("lat", DataType::Float64, "degrees_north"),
        with_unit("lon", DataType::Float64, "degrees_east"),
        values,
    ]))
}

/// An attribute as a text: what is none is JSON.
fn text(value: &Value) -> String {
    let text = value.as_str().map(str::to_owned);
    text.unwrap_or_else(|| value.to_string())
}

fn properties(description: &Description) -> parquet::errors::Result<WriterProperties> {
    let said = description.attributes().into_iter();
    let said = said.map(|(name, value)| KeyValue::new(name, text(&value)));
    Ok(WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::try_new(3)?))
        .set_max_row_group_row_count(Some(GROUP_ROWS))
        .set_created_by("fluxglobe".to_owned())
        .set_key_value_metadata(Some(said.collect()))
        .build())
}
