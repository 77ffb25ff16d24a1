//! Rows of an answer as a file, or as bytes on standard output: CSV, JSON, Arrow, Parquet, NetCDF. A file is whole or not
//! there, and takes the place of nothing.

mod columnar;
mod columns;
mod netcdf;
mod shown;
mod text;

use std::io::Write;
use std::path::{Path, PathBuf};

use arrow::datatypes::SchemaRef;
use arrow::record_batch::RecordBatch;
use tempfile::NamedTempFile;

use crate::{ExportError, part_of};

pub use columns::encoded;
pub use shown::{ShownColumn, shown_columns, shown_rows};

/// A form of rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AnswerFormat {
    /// Commas, a line of names first; nothing where there is no value.
    Csv,
    /// One array of objects; `null` where there is no value.
    Json,
    /// Arrow's file format, also called Feather version 2.
    Arrow,
    /// Parquet.
    Parquet,
    /// NetCDF-4 of one dimension, `row`, a variable a column; instants are whole numbers of 64 bits.
    NetCdf,
}

/// Where an answer goes.
pub enum Destination {
    /// A file that is not there yet.
    File(PathBuf),
    /// Bytes one after the other; not for NetCDF.
    Stream(Box<dyn Write + Send>),
}

/// What becomes of the rows of an answer.
pub trait Answer: Send {
    /// Writes some rows.
    ///
    /// # Errors
    /// They cannot be written.
    fn append(&mut self, rows: &RecordBatch) -> Result<(), ExportError>;

    /// Makes it whole, a file under its name.
    ///
    /// # Errors
    /// It cannot be written, or something has come to be there.
    fn finish(self: Box<Self>) -> Result<(), ExportError>;
}

/// Begins an answer with these columns.
///
/// # Errors
/// `Exists`, a column that the form cannot hold, or it cannot be written there.
pub fn answer(
    format: AnswerFormat,
    to: Destination,
    columns: &SchemaRef,
) -> Result<Box<dyn Answer>, ExportError> {
    if let Destination::File(path) = &to
        && path.exists()
    {
        return Err(ExportError::Exists {
            path: path.display().to_string(),
        });
    }
    if format == AnswerFormat::NetCdf {
        let Destination::File(path) = to else {
            return Err(ExportError::Form {
                reason: "NetCDF is written in places of a file: give --output FILE".to_owned(),
            });
        };
        return Ok(Box::new(netcdf::Variables::create(&path, columns)?));
    }
    let sink = Sink::open(to)?;
    Ok(match format {
        AnswerFormat::Csv => Box::new(text::Csv::new(sink, columns)?),
        AnswerFormat::Json => Box::new(text::Json::new(sink, columns)?),
        AnswerFormat::Arrow => Box::new(columnar::Arrow::new(sink, columns)?),
        AnswerFormat::Parquet | AnswerFormat::NetCdf => {
            Box::new(columnar::Parquet::new(sink, columns)?)
        }
    })
}

/// Where bytes go, and what makes them a file.
enum Sink {
    File(PathBuf, NamedTempFile),
    Stream(Box<dyn Write + Send>),
}

impl Sink {
    fn open(to: Destination) -> Result<Self, ExportError> {
        Ok(match to {
            Destination::File(path) => {
                let part = part_of(&path)?;
                Self::File(path, part)
            }
            Destination::Stream(stream) => Self::Stream(stream),
        })
    }

    /// Its name in messages.
    fn path(&self) -> PathBuf {
        match self {
            Self::File(path, _part) => path.clone(),
            Self::Stream(_) => Path::new("standard output").to_owned(),
        }
    }

    fn finish(self) -> Result<(), ExportError> {
        match self {
            Self::File(path, part) => {
                let kept = part.persist_noclobber(&path);
                kept.map(|_file| ())
                    .map_err(|e| ExportError::io(&path)(e.error))
            }
            Self::Stream(mut stream) => {
                let path = Path::new("standard output");
                stream.flush().map_err(ExportError::io(path))
            }
        }
    }
}

impl Write for Sink {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        match self {
            Self::File(_path, part) => part.write(bytes),
            Self::Stream(stream) => stream.write(bytes),
        }
    }

    fn flush(&mut self) -> std::io::Result<()> {
        match self {
            Self::File(_path, part) => part.flush(),
            Self::Stream(stream) => stream.flush(),
        }
    }
}
