//! Columns of an answer as Arrow's, and as the bytes of a form.

use std::collections::HashMap;
use std::io::Write;
use std::sync::{Arc, Mutex, PoisonError};

use arrow::array::{
    ArrayRef, BooleanArray, Float64Array, StringArray, TimestampMillisecondArray, UInt32Array,
};
use arrow::datatypes::{Field, Schema};
use arrow::record_batch::RecordBatch;
use contract::rows::{Column, ColumnValues, Columns};
use contract::time::TimeMs;

use super::{AnswerFormat, Destination, answer};
use crate::ExportError;

/// Name, in a schema's metadata, of what the answer says besides its rows.
const ABOUT: &str = "fluxglobe";
/// Zone of all instants.
const ZONE: &str = "UTC";

/// Columns as the bytes of a form; not of NetCDF, which is written in places of a file.
///
/// # Errors
/// Columns that differ in length, or have one name; a form that cannot hold them.
pub fn encoded(columns: &Columns, format: AnswerFormat) -> Result<Vec<u8>, ExportError> {
    let rows = batch(columns)?;
    let bytes = Held::default();
    let to = Destination::Stream(Box::new(bytes.clone()));
    let mut answer = answer(format, to, &rows.schema())?;
    answer.append(&rows)?;
    answer.finish()?;
    Ok(bytes.taken())
}

/// Columns as Arrow's.
fn batch(columns: &Columns) -> Result<RecordBatch, ExportError> {
    let failed = |reason: String| ExportError::Form { reason };
    let mut names: Vec<&str> = columns
        .columns
        .iter()
        .map(|own| own.name.as_str())
        .collect();
    names.sort_unstable();
    if names.windows(2).any(|two| two[0] == two[1]) {
        return Err(failed(format!("two columns of {names:?} have one name")));
    }
    let (fields, arrays): (Vec<Field>, Vec<ArrayRef>) = columns.columns.iter().map(array).unzip();
    let about = HashMap::from([(ABOUT.to_owned(), columns.about.clone())]);
    let schema = Schema::new(fields).with_metadata(about);
    RecordBatch::try_new(Arc::new(schema), arrays).map_err(|e| failed(e.to_string()))
}

fn array(column: &Column) -> (Field, ArrayRef) {
    let instants = |own: TimestampMillisecondArray| Arc::new(own.with_timezone(ZONE)) as ArrayRef;
    let (array, is_nullable): (ArrayRef, bool) = match &column.values {
        ColumnValues::Instants(own) => {
            let own: Vec<i64> = own.iter().map(|instant| instant.ms()).collect();
            (instants(own.into()), false)
        }
        ColumnValues::SomeInstants(own) => {
            let own: Vec<Option<i64>> = own.iter().map(|own| own.map(TimeMs::ms)).collect();
            (instants(own.into()), true)
        }
        ColumnValues::Numbers(own) => (Arc::new(Float64Array::from(own.clone())), true),
        ColumnValues::Counts(own) => (Arc::new(UInt32Array::from(own.clone())), true),
        ColumnValues::Flags(own) => (Arc::new(BooleanArray::from(own.clone())), false),
        ColumnValues::Texts(own) => (Arc::new(StringArray::from(own.clone())), true),
    };
    let field = Field::new(&column.name, array.data_type().clone(), is_nullable);
    let unit = column
        .unit
        .iter()
        .map(|unit| ("units".to_owned(), unit.clone()));
    (field.with_metadata(unit.collect()), array)
}

/// Bytes in memory, which whoever writes them shares with who takes them.
#[derive(Clone, Default)]
struct Held(Arc<Mutex<Vec<u8>>>);

impl Held {
    fn taken(&self) -> Vec<u8> {
        std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Write for Held {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let mut own = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        own.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use arrow::array::{Array as _, AsArray as _};
    use arrow::datatypes::{Float64Type, TimestampMillisecondType, UInt32Type};
    use arrow::ipc::reader::FileReader;

    use super::*;

    fn columns() -> Columns {
        let day = |day: i64| TimeMs::new(day * 86_400_000).unwrap();
        let column = |name: &str, unit: Option<&str>, values| Column {
            name: name.to_owned(),
            unit: unit.map(str::to_owned),
            values,
        };
        Columns {
            about: r#"{"title":"t"}"#.to_owned(),
            columns: vec![
                column("start", None, ColumnValues::Instants(vec![day(0), day(1)])),
                column(
                    "mean",
                    Some("K"),
                    ColumnValues::Numbers(vec![Some(0.1), None]),
                ),
                column("steps", None, ColumnValues::Counts(vec![None, Some(7)])),
                column(
                    "found",
                    None,
                    ColumnValues::SomeInstants(vec![None, Some(day(2))]),
                ),
                column("is_withheld", None, ColumnValues::Flags(vec![false, true])),
                column(
                    "region",
                    None,
                    ColumnValues::Texts(vec![None, Some("a, \"b\"".to_owned())]),
                ),
            ],
        }
    }

    #[test]
    fn every_value_comes_back_from_arrow_with_its_unit_and_what_it_is_of() {
        let bytes = encoded(&columns(), AnswerFormat::Arrow).unwrap();
        let reader = FileReader::try_new(Cursor::new(bytes), None).unwrap();
        let schema = reader.schema();
        assert_eq!(schema.metadata()[ABOUT], r#"{"title":"t"}"#);
        assert_eq!(schema.field(1).metadata()["units"], "K");
        let rows: Vec<RecordBatch> = reader.map(Result::unwrap).collect();
        assert_eq!((rows.len(), rows[0].num_rows()), (1, 2));
        let start = rows[0].column(0).as_primitive::<TimestampMillisecondType>();
        assert_eq!(
            (start.values()[1], start.timezone()),
            (86_400_000, Some("UTC"))
        );
        let mean = rows[0].column(1).as_primitive::<Float64Type>();
        assert_eq!(
            (mean.value(0).to_bits(), mean.is_null(1)),
            (0.1f64.to_bits(), true)
        );
        let steps = rows[0].column(2).as_primitive::<UInt32Type>();
        assert_eq!((steps.is_null(0), steps.value(1)), (true, 7));
        let found = rows[0].column(3).as_primitive::<TimestampMillisecondType>();
        assert_eq!((found.is_null(0), found.value(1)), (true, 172_800_000));
        let flags = rows[0].column(4).as_boolean();
        assert_eq!((flags.value(0), flags.value(1)), (false, true));
        let texts = rows[0].column(5).as_string::<i32>();
        assert_eq!((texts.is_null(0), texts.value(1)), (true, "a, \"b\""));
    }

    #[test]
    fn the_same_is_a_line_a_row_in_csv() {
        let bytes = encoded(&columns(), AnswerFormat::Csv).unwrap();
        let expected = "start,mean,steps,found,is_withheld,region\n\
            1970-01-01T00:00:00Z,0.1,,,false,\n\
            1970-01-02T00:00:00Z,,7,1970-01-03T00:00:00Z,true,\"a, \"\"b\"\"\"\n";
        assert_eq!(String::from_utf8(bytes).unwrap(), expected);
    }

    #[test]
    fn columns_that_make_no_table_are_refused() {
        let mut short = columns();
        short.columns[0].values = ColumnValues::Flags(vec![true]);
        assert!(encoded(&short, AnswerFormat::Csv).is_err());
        let mut twice = columns();
        twice.columns[1].name = "start".to_owned();
        let refused = encoded(&twice, AnswerFormat::Arrow).unwrap_err();
        assert!(refused.to_string().contains("one name"), "{refused}");
        assert!(encoded(&columns(), AnswerFormat::NetCdf).is_err());
    }
}
