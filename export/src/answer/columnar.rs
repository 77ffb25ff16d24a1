//! Rows as Arrow and Parquet: types, units and names of columns as they are.

use std::path::PathBuf;

use arrow::datatypes::SchemaRef;
use arrow::ipc::writer::FileWriter;
use arrow::record_batch::RecordBatch;
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression, ZstdLevel};
use parquet::file::properties::WriterProperties;

use super::{Answer, Sink};
use crate::ExportError;

/// Most rows of a row group, which is held until it is written.
const GROUP_ROWS: usize = 1 << 18;

/// Arrow's file format.
pub(super) struct Arrow {
    path: PathBuf,
    writer: FileWriter<Sink>,
}

impl Arrow {
    pub(super) fn new(sink: Sink, columns: &SchemaRef) -> Result<Self, ExportError> {
        let path = sink.path();
        let writer = FileWriter::try_new(sink, columns);
        let writer = writer.map_err(ExportError::library(&path))?;
        Ok(Self { path, writer })
    }
}

impl Answer for Arrow {
    fn append(&mut self, rows: &RecordBatch) -> Result<(), ExportError> {
        let written = self.writer.write(rows);
        written.map_err(ExportError::library(&self.path))
    }

    fn finish(self: Box<Self>) -> Result<(), ExportError> {
        let Self { path, mut writer } = *self;
        writer.finish().map_err(ExportError::library(&path))?;
        let sink = writer.into_inner();
        sink.map_err(ExportError::library(&path))?.finish()
    }
}

/// Parquet.
pub(super) struct Parquet {
    path: PathBuf,
    writer: ArrowWriter<Sink>,
}

impl Parquet {
    pub(super) fn new(sink: Sink, columns: &SchemaRef) -> Result<Self, ExportError> {
        let path = sink.path();
        let level = ZstdLevel::try_new(3).map_err(ExportError::library(&path))?;
        let properties = WriterProperties::builder()
            .set_compression(Compression::ZSTD(level))
            .set_max_row_group_row_count(Some(GROUP_ROWS))
            .set_created_by("fluxglobe".to_owned())
            .build();
        let writer = ArrowWriter::try_new(sink, columns.clone(), Some(properties));
        let writer = writer.map_err(ExportError::library(&path))?;
        Ok(Self { path, writer })
    }
}

impl Answer for Parquet {
    fn append(&mut self, rows: &RecordBatch) -> Result<(), ExportError> {
        let written = self.writer.write(rows);
        written.map_err(ExportError::library(&self.path))
    }

    fn finish(self: Box<Self>) -> Result<(), ExportError> {
        let Self { path, writer } = *self;
        let sink = writer.into_inner();
        sink.map_err(ExportError::library(&path))?.finish()
    }
}
