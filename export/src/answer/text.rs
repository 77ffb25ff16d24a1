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
    /// # Errors
    /// Columns of one name: who reads an object keeps the last of them.
    pub(super) fn new(sink: Sink, columns: &SchemaRef) -> Result<Self, ExportError> {
        let fields = columns.fields();
        let mut numbered = fields.iter().enumerate();
        let twice = numbered.find(|(place, own)| {
            let before = &fields[..*place];
            before.iter().any(|it| it.name() == own.name())
        });
        if let Some((_place, field)) = twice {
            return Err(ExportError::Form {
                reason: format!(
                    "two columns are called {}, of which readers of JSON keep one: give one another name with AS",
                    field.name()
                ),
            });
        }
        let builder = WriterBuilder::new().with_explicit_nulls(true);
        Ok(Self {
            path: sink.path(),
            writer: builder.build(sink),
        })
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

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use arrow::datatypes::{DataType, Field, Schema};

    use crate::answer::{AnswerFormat, Destination, answer};

    #[test]
    fn columns_of_one_name_are_refused_where_readers_would_keep_one() {
        let refused = |format, names: [&str; 2]| {
            let fields = names.map(|name| Field::new(name, DataType::Float64, true));
            let columns = Arc::new(Schema::new(fields.to_vec()));
            let to = Destination::Stream(Box::new(std::io::sink()));
            let begun = answer(format, to, &columns);
            begun.err().map(|error| error.to_string())
        };
        let told = refused(AnswerFormat::Json, ["value", "value"]).unwrap();
        assert!(told.contains("two columns are called value"), "{told}");
        assert_eq!(refused(AnswerFormat::Json, ["value", "other"]), None);
        // A line of CSV has both.
        assert_eq!(refused(AnswerFormat::Csv, ["value", "value"]), None);
    }
}
