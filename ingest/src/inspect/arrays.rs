//! Arrays of a store of others in, what they say as a file says it, and their values.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use contract::event::RejectReason;
use contract::index::DimensionIndex;
use cube::foreign::{Absent, ArrayKind, Foreign, ForeignArray, ForeignError};
use serde_json::{Map, Value};

use super::file::description::{
    AttributeValue, Attributes, Description, Dimension, Kind, MAX_ATTRIBUTE_NUMBERS,
    MAX_ATTRIBUTE_TEXT_BYTES, MAX_ATTRIBUTES, MAX_NAME_BYTES, Part, Variable,
};
use super::indexed;
use crate::error::{IngestError, Rejection, Stop};

/// Which index is read of dimensions beside time and the map, by their names.
pub(crate) type Indexes = BTreeMap<String, u64>;

/// Attributes that hold stored numbers which stand for no data.
const FILLS: [&str; 2] = ["_FillValue", "missing_value"];

/// Attributes that say which stored numbers are values: what they hold that is no number is not as if they were not there.
const LIMITS: [&str; 3] = ["valid_range", "valid_min", "valid_max"];

/// Arrays that are read.
#[derive(Clone)]
pub(crate) struct Arrays {
    foreign: Arc<Foreign>,
    indexes: Indexes,
    /// The array that is asked for, and what its chunks mean that are not there.
    absent: (String, Absent),
    plane_cells: u64,
    /// What is said of coordinates that were not written.
    unwritten: Arc<Mutex<BTreeSet<String>>>,
}

fn lock<T>(held: &Mutex<T>) -> MutexGuard<'_, T> {
    held.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Arrays {
    /// Arrays of a store; of dimensions that `indexes` name one index is read.
    pub(crate) fn new(
        foreign: Arc<Foreign>,
        indexes: Indexes,
        absent: (String, Absent),
        plane_cells: u64,
    ) -> Self {
        Self {
            foreign,
            indexes,
            absent,
            plane_cells,
            unwritten: Arc::default(),
        }
    }

    /// Values of a part of an array, as many as `expected`.
    pub(crate) async fn read(
        &self,
        variable: &str,
        part: &[Part],
        expected: u64,
    ) -> Result<Vec<f64>, Stop> {
        if expected > self.plane_cells {
            let detail = format!(
                "{expected} values at once, at most {} are read",
                self.plane_cells
            );
            return Err(Rejection::new(RejectReason::TooLarge, variable, detail).into());
        }
        self.values(variable, part).await.map_err(stopped)
    }

    /// The same with the error of the store.
    pub(crate) async fn values(
        &self,
        variable: &str,
        part: &[Part],
    ) -> Result<Vec<f64>, ForeignError> {
        let array = self.foreign.array(variable)?;
        let ranges = Self::ranges(array, &self.indexes, part);
        if self.absent.0 == variable {
            return self.foreign.read(variable, &ranges, self.absent.1).await;
        }
        // What else is read of a store are coordinates and their bounds.
        let absent = Absent::RefusedOfCoordinate;
        let refused = match self.foreign.read(variable, &ranges, absent).await {
            Err(refused) if refused.is_absent && array.cell_count() == Some(1) => refused,
            read => return read,
        };
        // The time of a store of one step is 0 since itself, as most programs write it, and what is fill value is not written.
        let Some(fill) = array.fill.filter(|fill| fill.is_finite()) else {
            return Err(refused);
        };
        let read = self.foreign.read(variable, &ranges, Absent::Fill).await?;
        let said = format!(
            "{variable}: its one value is not there and is taken for the fill value, {fill}, which is not written"
        );
        lock(&self.unwritten).insert(said);
        Ok(read)
    }

    /// First indexes of the chunks of an array along one of those axes that are described, ascending.
    pub(crate) fn chunk_starts(
        &self,
        variable: &str,
        axis: usize,
    ) -> Result<Vec<u64>, ForeignError> {
        let array = self.foreign.array(variable)?;
        let dimensions = array.dimensions.iter().enumerate();
        let mut described = dimensions
            .filter(|(_, (name, _))| index(&self.indexes, array, name.as_deref()).is_none());
        match described.nth(axis) {
            Some((dimension, _)) => array.chunk_starts(dimension),
            None => Ok(vec![]),
        }
    }

    /// Why an array that is there is not among those that are described: a codec, say, that this program does not have.
    pub(crate) fn unread(&self, variable: &str) -> Option<&ForeignError> {
        self.foreign.unread(variable)
    }

    /// What was taken for granted of coordinates that were read.
    pub(crate) fn assumptions(&self) -> Vec<String> {
        lock(&self.unwritten).iter().cloned().collect()
    }

    /// A part as ranges along all dimensions of an array.
    pub(crate) fn ranges(
        array: &ForeignArray,
        indexes: &Indexes,
        part: &[Part],
    ) -> Vec<Range<u64>> {
        let mut parts = part.iter();
        let dimensions = array.dimensions.iter();
        dimensions
            .map(|(name, len)| match index(indexes, array, name.as_deref()) {
                Some(index) => index..index.saturating_add(1),
                None => match parts.next() {
                    Some(Part::At(index)) => *index..index.saturating_add(1),
                    Some(Part::Some { first, count }) => *first..first.saturating_add(*count),
                    Some(Part::All) | None => 0..*len,
                },
            })
            .collect()
    }
}

/// The index that is read of a dimension of an array; none of one that is its own coordinate, or not named.
fn index(indexes: &Indexes, array: &ForeignArray, dimension: Option<&str>) -> Option<u64> {
    let dimension = dimension.filter(|name| *name != array.name)?;
    indexes.get(dimension).copied()
}

/// What stops a file for what a store of others answers.
pub(crate) fn stopped(error: ForeignError) -> Stop {
    if error.is_retryable() {
        return IngestError::Foreign { source: error }.into();
    }
    Rejection::new(RejectReason::Unreadable, error.place, error.reason).into()
}

/// What a store says, without the dimensions of which one index is read.
///
/// # Errors
/// There is no such dimension, or no such index.
pub(crate) fn describe(foreign: &Foreign, indexes: &Indexes) -> Result<Description, Rejection> {
    for (dimension, index) in indexes {
        let asked = DimensionIndex {
            dimension: dimension.clone(),
            index: *index,
        };
        let all = foreign.arrays().flat_map(|array| &array.dimensions);
        let own = all.filter(|(own, _)| own.as_ref() == Some(dimension));
        indexed::check(&asked, own.map(|(_, len)| *len), "an array")?;
    }
    Ok(Description {
        format: foreign.found.kind.to_string(),
        attributes: attributes(&foreign.attributes, Kind::Other),
        variables: foreign
            .arrays()
            .map(|array| variable(array, indexes))
            .collect(),
        library_bytes: 0,
        groups: vec![],
    })
}

fn variable(array: &ForeignArray, indexes: &Indexes) -> Variable {
    let kind = match array.kind {
        ArrayKind::Integer(bytes) => Kind::Integer(bytes),
        ArrayKind::Unsigned(bytes) => Kind::Unsigned(bytes),
        ArrayKind::Float(bytes) => Kind::Float(bytes),
        ArrayKind::Other => Kind::Other,
    };
    let mut attributes = attributes(&array.attributes, kind);
    if let Some(stated) = stated_fill(kind, array.fill, array.is_zarr2) {
        let own = attributes.0.entry("_FillValue".to_owned());
        own.or_insert(stated);
    }
    let dimensions = array.dimensions.iter();
    let own = dimensions.filter(|(name, _)| index(indexes, array, name.as_deref()).is_none());
    Variable {
        name: array.name.clone(),
        dimensions: own
            .map(|(name, len)| Dimension {
                name: name.clone(),
                len: *len,
            })
            .collect(),
        kind,
        attributes,
    }
}

/// What stands for a `_FillValue` that an array has not among its attributes; none where nothing says what cells hold that nobody wrote.
///
/// Zarr version 2 has it where version 3 has a value for what was not written, which may be one like any other. Cells that nobody wrote hold
/// that value and not the one that NetCDF fills variables with: where they are two, no number stands for no data.
fn stated_fill(kind: Kind, fill: Option<f64>, is_zarr2: bool) -> Option<AttributeValue> {
    let fill = fill?;
    let bits = if is_zarr2 {
        vec![fill.into()]
    } else if kind.netcdf_fill() == Some(fill) {
        return None;
    } else {
        vec![]
    };
    Some(AttributeValue::Numbers { kind, bits })
}

/// Attributes as a file has them. JSON does not tell types of numbers: one without a fraction is taken to be of the array's
/// own type, as a number of what is stored, one with a fraction for a value.
fn attributes(all: &Map<String, Value>, kind: Kind) -> Attributes {
    let kept = all.iter().filter(|(name, _)| name.len() <= MAX_NAME_BYTES);
    kept.take(MAX_ATTRIBUTES)
        .filter_map(|(name, value)| {
            let read = attribute(name, value, kind).or_else(|| unread(name, value))?;
            Some((name.clone(), read))
        })
        .collect()
}

/// What stands for a fill value or a valid range and is neither numbers nor a text, as a text: whoever plans refuses it.
fn unread(name: &str, value: &Value) -> Option<AttributeValue> {
    let is_nothing = value.is_null() || value.as_array().is_some_and(Vec::is_empty);
    let is_told = (FILLS.contains(&name) || LIMITS.contains(&name)) && !is_nothing;
    is_told.then(|| AttributeValue::Text(cut(&value.to_string())))
}

fn attribute(name: &str, value: &Value, kind: Kind) -> Option<AttributeValue> {
    if let Value::String(text) = value {
        return Some(match number_of_text(name, text, kind) {
            Some(number) => AttributeValue::Numbers {
                kind,
                bits: vec![number.into()],
            },
            None => AttributeValue::Text(cut(text)),
        });
    }
    if let Some(text) = joined(value) {
        return Some(AttributeValue::Text(cut(&text)));
    }
    let numbers: Vec<&Value> = match value {
        Value::Array(all) => all.iter().take(MAX_ATTRIBUTE_NUMBERS).collect(),
        Value::Number(_) | Value::Bool(_) => vec![value],
        // What this program says of its own, as a file of NetCDF has it.
        Value::Object(_) if name == cube::Description::ATTRIBUTE => {
            return Some(AttributeValue::Text(cut(&value.to_string())));
        }
        Value::Null | Value::Object(_) | Value::String(_) => return None,
    };
    let is_whole = numbers
        .iter()
        .all(|n| n.is_i64() || n.is_u64() || n.is_boolean());
    let number = |value: &Value| match value {
        Value::Bool(is_on) => Some(f64::from(u8::from(*is_on))),
        Value::String(text) => not_finite(text),
        value => value.as_f64(),
    };
    let bits: Option<Vec<_>> = numbers.iter().map(|n| number(n).map(Into::into)).collect();
    Some(AttributeValue::Numbers {
        kind: match kind {
            Kind::Integer(_) | Kind::Unsigned(_) if is_whole => kind,
            _ if is_whole => Kind::Integer(8),
            _ => Kind::Float(8),
        },
        bits: bits.filter(|bits| !bits.is_empty())?,
    })
}

/// Several texts, joined by spaces as those of a file are; none of numbers, some of which JSON can only name.
fn joined(value: &Value) -> Option<String> {
    let texts: Option<Vec<&str>> = value.as_array()?.iter().map(Value::as_str).collect();
    let texts = texts.filter(|all| all.iter().any(|text| not_finite(text).is_none()))?;
    Some(texts.join(" "))
}

/// A number that JSON cannot hold: by its name, or (as xarray writes fill values in Zarr version 3) in base 64.
fn number_of_text(name: &str, text: &str, kind: Kind) -> Option<f64> {
    if !FILLS.contains(&name) || !matches!(kind, Kind::Float(_)) {
        return None;
    }
    let in_base_64 = || {
        let bytes = STANDARD.decode(text).ok()?;
        Some(f64::from_le_bytes(bytes.try_into().ok()?))
    };
    not_finite(text).or_else(in_base_64)
}

fn not_finite(text: &str) -> Option<f64> {
    match text {
        "NaN" => Some(f64::NAN),
        "Infinity" => Some(f64::INFINITY),
        "-Infinity" => Some(f64::NEG_INFINITY),
        _ => None,
    }
}

fn cut(text: &str) -> String {
    let mut end = text.len().min(MAX_ATTRIBUTE_TEXT_BYTES);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    text[..end].to_owned()
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "these numbers are exact")]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::plan::cf::packing::Packing;

    #[test]
    fn several_texts_are_one_and_several_names_of_numbers_are_numbers() {
        let of = |value: Value| attribute("valid_range", &value, Kind::Float(4));
        let text = of(json!(["0.0", "100.0"]));
        assert_eq!(text, Some(AttributeValue::Text("0.0 100.0".to_owned())));
        let numbers = of(json!(["-Infinity", "Infinity"]));
        assert!(matches!(numbers, Some(AttributeValue::Numbers { .. })));
        assert_eq!(of(json!([])), None);
    }

    #[test]
    fn fill_values_and_valid_ranges_that_are_no_numbers_are_not_as_if_they_were_not_there() {
        for value in [json!({"value": -999}), json!([1.5, "abc"])] {
            for name in ["_FillValue", "missing_value", "valid_range", "valid_max"] {
                let all = Map::from_iter([(name.to_owned(), value.clone())]);
                let read = attributes(&all, Kind::Float(4));
                let text = read.text(name).unwrap_or_default();
                assert_eq!(text, value.to_string(), "{name}");
            }
            let other = Map::from_iter([("history".to_owned(), value)]);
            assert_eq!(attributes(&other, Kind::Float(4)).text("history"), None);
        }
        for value in [Value::Null, json!([])] {
            let all = Map::from_iter([("_FillValue".to_owned(), value)]);
            assert!(attributes(&all, Kind::Float(4)).0.is_empty());
        }
    }

    /// Cells of an array of Zarr that nobody wrote hold its own fill value: what NetCDF fills variables with is a value there.
    #[test]
    fn the_fill_value_of_netcdf_is_no_data_of_arrays_that_are_filled_with_it() {
        const SHORT: Kind = Kind::Integer(2);
        let value = |fill: Option<f64>, is_zarr2: bool, stored: f64| {
            let stated = stated_fill(SHORT, fill, is_zarr2);
            let stated = stated.map(|stated| ("_FillValue".to_owned(), stated));
            let variable = Variable {
                name: "sst".to_owned(),
                dimensions: vec![],
                kind: SHORT,
                attributes: Attributes(stated.into_iter().collect()),
            };
            Packing::of(&variable).value(stored)
        };
        let own = value(Some(0.0), false, -32_767.0);
        assert_eq!((own, value(Some(0.0), false, 0.0)), (-32_767.0, 0.0));
        assert!(value(Some(-32_767.0), false, -32_767.0).is_nan());
        // Version 2 says it, or says nothing, as of files of NetCDF that are referred to.
        assert!(value(Some(0.0), true, 0.0).is_nan());
        assert_eq!(value(Some(0.0), true, -32_767.0), -32_767.0);
        assert!(value(None, true, -32_767.0).is_nan());
    }

    #[test]
    fn fill_values_that_json_cannot_hold_are_read_by_name_or_in_base_64() {
        let float = Kind::Float(4);
        let of = |name: &str, text: &str, kind| number_of_text(name, text, kind);
        let packed = STANDARD.encode((-999.5_f64).to_le_bytes());
        assert_eq!(of("_FillValue", &packed, float), Some(-999.5));
        assert_eq!(
            of("missing_value", "-Infinity", float),
            Some(f64::NEG_INFINITY)
        );
        assert!(of("_FillValue", "NaN", float).unwrap().is_nan());
        for (name, text, kind) in [
            ("units", packed.as_str(), float),
            ("_FillValue", packed.as_str(), Kind::Integer(2)),
            ("_FillValue", "AAAA", float),
            ("_FillValue", "no number", float),
        ] {
            assert_eq!(of(name, text, kind), None, "{name} {text}");
        }
    }
}
