//! Rows as text: CSV and JSON.

use std::path::PathBuf;

use arrow::csv;
use arrow::datatypes::SchemaRef;
use arrow::json;
use arrow::json::writer::{JsonArray, WriterBuilder};
use arrow::record_batch::RecordBatch;

use super::{Answer, Sink};
use crate::ExportError;

/// Lines of values with commas.
pub(super) struct Csv {
    path: PathBuf,
    writer: csv::Writer<Sink>,
}

impl Csv {
    /// # Errors
    /// A column of lists or the like.
    pub(super) fn new(sink: Sink, columns: &SchemaRef) -> Result<Self, ExportError> {
        let nested = columns
            .fields()
            .iter()
            .find(|it| it.data_type().is_nested());
        if let Some(field) = nested {
            return Err(ExportError::Form {
                reason: format!(
                    "column {} is {}, which CSV cannot hold; JSON, Arrow and Parquet can",
                    field.name(),
                    field.data_type()
                ),
            });
        }
        let mut own = Self {
            path: sink.path(),
            writer: csv::WriterBuilder::new().with_header(true).build(sink),
        };
        // The names are there also where no row is.
        own.append(&RecordBatch::new_empty(columns.clone()))?;
        Ok(own)
    }
}

impl Answer for Csv {
    fn append(&mut self, rows: &RecordBatch) -> Result<(), ExportError> {
        let written = self.writer.write(rows);
        written.map_err(ExportError::library(&self.path))
    }

    fn finish(self: Box<Self>) -> Result<(), ExportError> {
        self.writer.into_inner().finish()
    }
}

/// An array of objects.
pub(super) struct Json {
    path: PathBuf,
    writer: json::Writer<Sink, JsonArray>,
}

impl Json {
    pub(super) fn new(sink: Sink) -> Self {
        let builder = WriterBuilder::new().with_explicit_nulls(true);
        Self {
            path: sink.path(),
            writer: builder.build(sink),
        }
    }
}

impl Answer for Json {
    fn append(&mut self, rows: &RecordBatch) -> Result<(), ExportError> {
        let written = self.writer.write(rows);
        written.map_err(ExportError::library(&self.path))
    }

    fn finish(self: Box<Self>) -> Result<(), ExportError> {
        let Self { path, mut writer } = *self;
        writer.finish().map_err(ExportError::library(&path))?;
        writer.into_inner().finish()
    }
}
