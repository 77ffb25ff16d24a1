//! Rows as NetCDF-4: one dimension, `row`, which grows, and a variable a column.
//!
//! Numbers that are whole, and instants, are of 64 bits; instants count from 1970 in the unit of their column. Where there
//! is no value stands the fill value that the variable names; texts are empty there.

use std::path::{Path, PathBuf};
use std::str::FromStr as _;

use arrow::array::{Array as _, ArrayRef, AsArray as _};
use arrow::compute::cast;
use arrow::datatypes::{DataType, Field, Float32Type, Float64Type, Int64Type, SchemaRef, TimeUnit};
use arrow::record_batch::RecordBatch;
use hdf5::types::VarLenUnicode;
use hdf5::{Dataset, File, H5Type};
use netcdf4::{attach, grow, growing, growing_scale, texts};
use tempfile::TempPath;

use super::Answer;
use crate::{ExportError, part_of};

/// Name of the dimension.
const ROW: &str = "row";
/// The fill value of the netCDF library for whole numbers of 64 bits.
const FILL: i64 = -9_223_372_036_854_775_806;

/// How a column is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Float32,
    Float64,
    Whole,
    /// Counted from 1970.
    Instant(TimeUnit),
    Text,
}

impl Kind {
    fn of(kind: &DataType) -> Option<Self> {
        Some(match kind {
            DataType::Float16 | DataType::Float32 => Self::Float32,
            DataType::Float64 | DataType::Decimal128(..) => Self::Float64,
            DataType::Timestamp(unit, _zone) => Self::Instant(*unit),
            DataType::Date32 | DataType::Date64 => Self::Instant(TimeUnit::Second),
            DataType::Boolean => Self::Whole,
            whole if whole.is_integer() => Self::Whole,
            DataType::Utf8 | DataType::LargeUtf8 | DataType::Utf8View => Self::Text,
            _ => return None,
        })
    }

    /// What a column is brought to before it is written.
    fn target(self) -> DataType {
        match self {
            Self::Float32 => DataType::Float32,
            Self::Float64 => DataType::Float64,
            Self::Whole => DataType::Int64,
            Self::Instant(unit) => DataType::Timestamp(unit, None),
            Self::Text => DataType::Utf8,
        }
    }
}

fn since(unit: TimeUnit) -> &'static str {
    match unit {
        TimeUnit::Second => "seconds since 1970-01-01 00:00:00",
        TimeUnit::Millisecond => "milliseconds since 1970-01-01 00:00:00",
        TimeUnit::Microsecond => "microseconds since 1970-01-01 00:00:00",
        TimeUnit::Nanosecond => "nanoseconds since 1970-01-01 00:00:00",
    }
}

/// The file as it is being written.
pub(super) struct Variables {
    path: PathBuf,
    /// The unfinished file, which goes if it is never finished.
    part: TempPath,
    file: File,
    rows: Dataset,
    columns: Vec<(Kind, Dataset)>,
    row_count: usize,
}

impl Variables {
    /// # Errors
    /// A column that NetCDF has no type for, two of one name, or it cannot be written there.
    pub(super) fn create(path: &Path, columns: &SchemaRef) -> Result<Self, ExportError> {
        let mut kinds = vec![];
        for (place, field) in columns.fields().iter().enumerate() {
            let refused = |why: String| ExportError::Form {
                reason: format!("column {}: {why}", field.name()),
            };
            let name = field.name();
            let is_name = !name.is_empty() && !name.contains('/') && name != ROW;
            if !is_name || columns.fields()[..place].iter().any(|it| it.name() == name) {
                let why = "NetCDF wants a name of its own for each column, not row and without /; give one with AS";
                return Err(refused(why.to_owned()));
            }
            let kind = Kind::of(field.data_type());
            kinds.push(kind.ok_or_else(|| {
                let kind = field.data_type();
                refused(format!(
                    "NetCDF has no {kind}; Arrow and Parquet have, or use CAST"
                ))
            })?);
        }
        let part = part_of(path)?.into_temp_path();
        let begun = begin(&part, columns, &kinds).map_err(ExportError::library(path))?;
        let (file, rows, datasets) = begun;
        Ok(Self {
            path: path.to_owned(),
            part,
            file,
            rows,
            columns: kinds.into_iter().zip(datasets).collect(),
            row_count: 0,
        })
    }

    fn write(&self, rows: &RecordBatch) -> Result<(), Box<dyn std::error::Error>> {
        let numbers: Vec<i64> = (self.row_count..self.row_count + rows.num_rows())
            .map(|row| row as i64)
            .collect();
        grow(&self.rows, self.row_count, &numbers)?;
        for ((kind, dataset), column) in self.columns.iter().zip(rows.columns()) {
            self.column(*kind, dataset, column)?;
        }
        Ok(())
    }

    fn column(
        &self,
        kind: Kind,
        dataset: &Dataset,
        column: &ArrayRef,
    ) -> Result<(), Box<dyn std::error::Error>> {
        let lost = cast(column, &kind.target())?;
        if lost.null_count() > column.null_count() {
            return Err("a number is too large for 64 bits with a sign".into());
        }
        let first = self.row_count;
        match kind {
            Kind::Float32 => {
                let values = lost.as_primitive::<Float32Type>().iter();
                let values: Vec<f32> = values.map(|value| value.unwrap_or(f32::NAN)).collect();
                grow(dataset, first, &values)?;
            }
            Kind::Float64 => {
                let values = lost.as_primitive::<Float64Type>().iter();
                let values: Vec<f64> = values.map(|value| value.unwrap_or(f64::NAN)).collect();
                grow(dataset, first, &values)?;
            }
            Kind::Whole | Kind::Instant(_) => {
                let whole = cast(&lost, &DataType::Int64)?;
                let values = whole.as_primitive::<Int64Type>().iter();
                let values: Vec<i64> = values.map(|value| value.unwrap_or(FILL)).collect();
                grow(dataset, first, &values)?;
            }
            Kind::Text => {
                let values = lost.as_string::<i32>().iter();
                let values = values.map(|value| VarLenUnicode::from_str(value.unwrap_or_default()));
                let values: Vec<VarLenUnicode> = values.collect::<Result<_, _>>()?;
                grow(dataset, first, &values)?;
            }
        }
        Ok(())
    }
}

impl Answer for Variables {
    fn append(&mut self, rows: &RecordBatch) -> Result<(), ExportError> {
        if rows.num_rows() > 0 {
            self.write(rows).map_err(ExportError::library(&self.path))?;
            self.row_count += rows.num_rows();
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<(), ExportError> {
        let Self {
            path,
            part,
            file,
            rows,
            columns,
            ..
        } = *self;
        drop((rows, columns));
        file.close().map_err(ExportError::library(&path))?;
        let kept = part.persist_noclobber(&path);
        kept.map_err(|e| ExportError::io(&path)(e.error))
    }
}

/// The file with its variables, which have no rows yet.
fn begin(
    part: &Path,
    columns: &SchemaRef,
    kinds: &[Kind],
) -> hdf5::Result<(File, Dataset, Vec<Dataset>)> {
    let file = netcdf4::create(part)?;
    texts(&file, &[("Conventions", "CF-1.11")])?;
    let rows = growing_scale::<i64>(&file, ROW)?;
    let mut datasets = vec![];
    for (field, kind) in columns.fields().iter().zip(kinds) {
        let dataset = match kind {
            Kind::Float32 => filled(&file, field, &f32::NAN)?,
            Kind::Float64 => filled(&file, field, &f64::NAN)?,
            Kind::Whole | Kind::Instant(_) => filled(&file, field, &FILL)?,
            Kind::Text => growing::<VarLenUnicode>(&file, field.name())?,
        };
        describe(&dataset, field, *kind)?;
        attach(&file, &dataset, &[&rows])?;
        datasets.push(dataset);
    }
    Ok((file, rows, datasets))
}

fn filled<T: H5Type>(file: &File, field: &Field, fill: &T) -> hdf5::Result<Dataset> {
    let dataset = growing::<T>(file, field.name())?;
    let attribute = dataset.new_attr::<T>().create("_FillValue")?;
    attribute.write_scalar(fill)?;
    Ok(dataset)
}

/// What the column says of itself, and of instants their unit.
fn describe(dataset: &Dataset, field: &Field, kind: Kind) -> hdf5::Result<()> {
    let mut said: Vec<(&str, &str)> = field
        .metadata()
        .iter()
        .filter(|(name, _)| ["units", "standard_name", "long_name"].contains(&name.as_str()))
        .map(|(name, text)| (name.as_str(), text.as_str()))
        .collect();
    // The order of a map is none.
    said.sort_unstable();
    if let Kind::Instant(unit) = kind {
        said.retain(|(name, _)| *name != "units");
        said.extend([("units", since(unit)), ("calendar", "proleptic_gregorian")]);
    }
    texts(dataset, &said)
}
