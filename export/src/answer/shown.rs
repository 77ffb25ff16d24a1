//! Rows as texts, for a table that people read.

use arrow::datatypes::SchemaRef;
use arrow::error::ArrowError;
use arrow::record_batch::RecordBatch;
use arrow::util::display::{ArrayFormatter, FormatOptions};

use crate::ExportError;

/// A column of a table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ShownColumn {
    /// Its name.
    pub name: String,
    /// Are its texts numbers, which stand on the right?
    pub is_number: bool,
}

/// The columns of an answer.
pub fn shown_columns(columns: &SchemaRef) -> Vec<ShownColumn> {
    let shown = |field: &arrow::datatypes::FieldRef| ShownColumn {
        name: field.name().clone(),
        is_number: field.data_type().is_numeric(),
    };
    columns.fields().iter().map(shown).collect()
}

/// Rows, a text a column: numbers in the fewest digits that say them, `null` where there is no value.
///
/// # Errors
/// An instant beyond what a calendar can say.
pub fn shown_rows(rows: &RecordBatch) -> Result<Vec<Vec<String>>, ExportError> {
    let failed = |error: ArrowError| ExportError::Form {
        reason: format!("an answer cannot be shown: {error}"),
    };
    let options = FormatOptions::default().with_null("null");
    let columns = rows.columns().iter();
    let columns = columns.map(|column| ArrayFormatter::try_new(column.as_ref(), &options));
    let columns: Vec<ArrayFormatter<'_>> = columns.collect::<Result<_, _>>().map_err(failed)?;
    let text = |row: usize, column: &ArrayFormatter<'_>| column.value(row).try_to_string();
    let line = |row: usize| columns.iter().map(|column| text(row, column)).collect();
    let lines: Result<Vec<Vec<String>>, ArrowError> = (0..rows.num_rows()).map(line).collect();
    lines.map_err(failed)
}
