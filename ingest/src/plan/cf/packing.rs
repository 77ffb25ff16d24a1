//! Stored numbers to values: fill values, valid range, scale and offset.
//!
//! Fill values speak of stored numbers. A valid range speaks of stored numbers too, unless its type is the one that scale
//! and offset unpack to and wider than the stored one; then of values (NetCDF Users Guide, attribute conventions;
//! CF 1.11, 2.5.1 and 8.1).

use contract::event::RejectReason;
use cube::foreign::ArrayKind;
use serde::{Deserialize, Serialize};

use crate::error::Rejection;
use crate::inspect::file::description::{Attributes, Kind, NumberBits, Variable};

/// From here on floating-point numbers are NetCDF's default fill values (9.97e36), or the 1e35 of older programs.
const DEFAULT_FILL_FLOAT: f64 = 1e34;
const ANY: Range = (f64::NEG_INFINITY, f64::INFINITY);
/// The attributes that make values of stored numbers.
const SCALES: [&str; 2] = ["scale_factor", "add_offset"];
/// The attributes that say which stored numbers mean no data.
const FILLS: [&str; 2] = ["_FillValue", "missing_value"];

/// Lowest and highest number that is valid.
type Range = (f64, f64);

/// How stored numbers become values: `value = stored * scale + offset`, NaN where there is no data.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Packing {
    pub(crate) scale: f64,
    pub(crate) offset: f64,
    /// Stored numbers that mean no data.
    pub(crate) fills: Vec<f64>,
    /// Stored numbers outside mean no data.
    valid_stored: Range,
    /// Values (unpacked, in the file's unit) outside mean no data.
    valid_values: Range,
    /// Stored signed integers that are meant unsigned: what to add to negative ones.
    unsigned_wrap: Option<f64>,
    is_float32: bool,
    /// The text of a valid range that is none, with its name; [`Packing::checked`] refuses it: values would be taken that are none.
    unread: Option<String>,
    /// The same of a fill value: what means no data would be taken for values.
    unread_fill: Option<String>,
    /// What was taken for granted, if the file leaves it open.
    pub(crate) assumption: Option<String>,
}

/// A packing as JSON that keeps every bit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct StoredPacking {
    scale: NumberBits,
    offset: NumberBits,
    fills: Vec<NumberBits>,
    valid_stored: [NumberBits; 2],
    valid_values: [NumberBits; 2],
    unsigned_wrap: Option<NumberBits>,
    is_float32: bool,
}

impl From<&Packing> for StoredPacking {
    fn from(own: &Packing) -> Self {
        let range = |(low, high): Range| [low.into(), high.into()];
        Self {
            scale: own.scale.into(),
            offset: own.offset.into(),
            fills: own.fills.iter().map(|fill| (*fill).into()).collect(),
            valid_stored: range(own.valid_stored),
            valid_values: range(own.valid_values),
            unsigned_wrap: own.unsigned_wrap.map(Into::into),
            is_float32: own.is_float32,
        }
    }
}

impl From<&StoredPacking> for Packing {
    fn from(stored: &StoredPacking) -> Self {
        let range = |[low, high]: [NumberBits; 2]| (low.number(), high.number());
        Self {
            scale: stored.scale.number(),
            offset: stored.offset.number(),
            fills: stored.fills.iter().map(|fill| fill.number()).collect(),
            valid_stored: range(stored.valid_stored),
            valid_values: range(stored.valid_values),
            unsigned_wrap: stored.unsigned_wrap.map(NumberBits::number),
            is_float32: stored.is_float32,
            unread: None,
            unread_fill: None,
            assumption: None,
        }
    }
}

/// What a stored number is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Unpacked {
    /// A value, in the file's unit.
    Value(f64),
    /// No data.
    Missing,
    /// Outside the valid range of the file or of its profile.
    OutOfRange,
}

/// Of which numbers an attribute speaks.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Speaks {
    OfStored,
    OfValues,
    /// Its type is neither that of stored numbers nor that of values; the convention then takes it for stored ones.
    Unclear,
}

impl Packing {
    /// The packing that the attributes of a variable state.
    pub(crate) fn of(variable: &Variable) -> Self {
        let attributes = &variable.attributes;
        let mut fills: Vec<f64> = FILLS
            .into_iter()
            .filter_map(|name| numbers(variable, name))
            .flatten()
            .map(|fill| as_stored(variable.kind, fill))
            .collect();
        // Whatever else means no data: cells that nobody wrote hold it.
        if attributes.numbers("_FillValue").is_none() {
            fills.extend(variable.kind.netcdf_fill());
        }
        let is_unsigned = attributes
            .text("_Unsigned")
            .is_some_and(|t| t.eq_ignore_ascii_case("true"));
        let unsigned_wrap = match variable.kind {
            Kind::Integer(bytes) if is_unsigned => Some(2f64.powi(8 * i32::from(bytes))),
            _ => None,
        };
        let mut packing = Self {
            scale: number(variable, "scale_factor", 1.0),
            offset: number(variable, "add_offset", 0.0),
            fills,
            valid_stored: ANY,
            valid_values: ANY,
            unsigned_wrap,
            is_float32: variable.kind == Kind::Float(4),
            unread: None,
            unread_fill: FILLS.into_iter().find_map(|name| unread(variable, name)),
            assumption: None,
        };
        let pair = packing.numbers_of_range(variable, "valid_range", 2);
        let bounds = [("valid_min", 0, false), ("valid_max", 1, true)];
        for (alone, place, is_upper) in bounds {
            let single = packing.numbers_of_range(variable, alone, 1);
            let (name, number) = match (&pair, single) {
                (Some(pair), _) if pair.len() == 2 => ("valid_range", pair[place]),
                (_, Some(single)) => (alone, single[0]),
                (_, None) => continue,
            };
            if !number.is_nan() {
                packing.bound(variable, name, number, is_upper);
            }
        }
        packing
    }

    /// This, if values can be had by it.
    ///
    /// # Errors
    /// `Values` if the scale is zero, scale or offset are no finite number, or the valid range or a fill value is a text that is none.
    pub(crate) fn checked(self, variable: &Variable) -> Result<Self, Rejection> {
        let (scale, offset) = (self.scale, self.offset);
        let refused = |what: &str, own: &str| {
            let detail = format!(
                "has {what}, which cannot be; correct {own} in the file, or state {own} in a profile where it is a grid"
            );
            Err(Rejection::new(RejectReason::Values, &variable.name, detail))
        };
        if !(scale.is_finite() && scale != 0.0 && offset.is_finite()) {
            let what = format!("scale_factor {scale} and add_offset {offset}");
            return refused(&what, "them");
        }
        if let Some(unread) = &self.unread {
            return refused(unread, "the valid range");
        }
        if let Some(unread) = &self.unread_fill {
            return refused(unread, "the fill value");
        }
        Ok(self)
    }

    /// The same where a valid range or a fill value that is a text and none counts for nothing: of places, times, bounds and flags, which no
    /// such range leaves out.
    pub(crate) fn with_any_range_text(mut self) -> Self {
        self.unread = None;
        self.unread_fill = None;
        self
    }

    /// These stored numbers mean no data too, and say what a fill value of the file does not that is none.
    pub(crate) fn with_fills(mut self, fills: impl IntoIterator<Item = f64>) -> Self {
        self.fills.extend(fills);
        self.unread_fill = None;
        self
    }

    /// Only these values (unpacked, in the file's unit) are valid, whatever the file says.
    pub(crate) fn with_valid_values(mut self, low: f64, high: f64) -> Self {
        self.valid_stored = ANY;
        self.valid_values = (low, high);
        self.unread = None;
        self.assumption = None;
        self
    }

    /// The numbers of an attribute of the valid range, at least one; none if it has none. A text that is not `count` numbers is noted.
    fn numbers_of_range(
        &mut self,
        variable: &Variable,
        name: &str,
        count: usize,
    ) -> Option<Vec<f64>> {
        let found = numbers(variable, name).filter(|all| !all.is_empty());
        let text = variable.attributes.text(name).unwrap_or_default();
        if text.is_empty() || !variable.is_numeric() {
            return found;
        }
        let Some(found) = found.filter(|all| all.len() == count) else {
            self.unread
                .get_or_insert_with(|| format!("{name} {text:?}"));
            return None;
        };
        // A bound of more digits than values have is the nearest one of theirs.
        let is_float32 = self.is_float32;
        let own = |number: f64| {
            if is_float32 {
                f64::from(number as f32)
            } else {
                number
            }
        };
        Some(found.into_iter().map(own).collect())
    }

    /// Takes one bound of the valid range.
    fn bound(&mut self, variable: &Variable, name: &str, number: f64, is_upper: bool) {
        let speaks = speaks(variable, name, number);
        if speaks == Speaks::Unclear {
            let kind = variable.attributes.kind(name);
            let kind = kind.map_or_else(|| "text".to_owned(), Kind::name);
            self.assumption = Some(format!(
                "{}: {name} is {kind}, which is neither the type of its stored numbers ({}) nor that of scale_factor; taken for stored numbers",
                variable.name,
                variable.kind.name()
            ));
        }
        // Attributes are often float32: what is a bound in their precision lies within it.
        let slack = f64::from(f32::EPSILON) * number.abs().max(self.offset.abs());
        let stored = self.unsigned(number);
        match (speaks, is_upper) {
            (Speaks::OfValues, false) => self.valid_values.0 = number - slack,
            (Speaks::OfValues, true) => self.valid_values.1 = number + slack,
            (_, false) => self.valid_stored.0 = stored,
            (_, true) => self.valid_stored.1 = stored,
        }
    }

    /// The value of a stored number, in the file's unit; NaN for no data.
    pub(crate) fn value(&self, stored: f64) -> f64 {
        match self.unpacked(stored) {
            Unpacked::Value(value) => value,
            Unpacked::Missing | Unpacked::OutOfRange => f64::NAN,
        }
    }

    /// What a stored number is.
    pub(crate) fn unpacked(&self, stored: f64) -> Unpacked {
        if self.is_missing(stored) {
            return Unpacked::Missing;
        }
        let stored = self.unsigned(stored);
        let value = stored * self.scale + self.offset;
        let is_within = |(low, high): Range, number: f64| (low..=high).contains(&number);
        if is_within(self.valid_stored, stored) && is_within(self.valid_values, value) {
            Unpacked::Value(value)
        } else {
            Unpacked::OutOfRange
        }
    }

    /// Does a stored number stand for no data, whatever the valid range is?
    #[expect(clippy::float_cmp, reason = "a fill value is one exact number")]
    fn is_missing(&self, stored: f64) -> bool {
        let is_fill = |fill: &f64| {
            *fill == stored
                || self.unsigned(*fill) == self.unsigned(stored)
                || self.is_float32 && f64::from(*fill as f32) == stored
        };
        stored.is_nan() || stored.abs() >= DEFAULT_FILL_FLOAT || self.fills.iter().any(is_fill)
    }

    /// A stored number, or what it means where integers are meant unsigned.
    pub(crate) fn unsigned(&self, stored: f64) -> f64 {
        match self.unsigned_wrap {
            Some(wrap) if stored < 0.0 => stored + wrap,
            _ => stored,
        }
    }
}

/// The numbers of an attribute, or of its text, which some writers give in their place: blanks lie between them, or commas with blanks. A
/// comma within a word may be a decimal one, and no such text is read.
fn numbers(variable: &Variable, name: &str) -> Option<Vec<f64>> {
    let of_text = || -> Option<Vec<f64>> {
        let words = variable.attributes.text(name)?.split_whitespace();
        let words = words.map(|word| word.strip_suffix(',').unwrap_or(word));
        words.map(|word| word.parse().ok()).collect()
    };
    let own = variable.attributes.numbers(name);
    // The fill value of text is a letter.
    own.or_else(|| variable.is_numeric().then(of_text).flatten())
}

/// The text of an attribute that is to hold numbers, with its name, where it does not; an empty one says nothing.
fn unread(variable: &Variable, name: &str) -> Option<String> {
    let text = variable.attributes.text(name).unwrap_or_default();
    let is_unread = !text.is_empty() && variable.is_numeric() && numbers(variable, name).is_none();
    is_unread.then(|| format!("{name} {text:?}"))
}

/// The number of an attribute, `usual` if it is not there. Of text that is not one number NaN, which [`Packing::checked`] refuses: values
/// would be taken as they are packed.
fn number(variable: &Variable, name: &str, usual: f64) -> f64 {
    let is_text = variable.attributes.text(name).is_some();
    match numbers(variable, name) {
        Some(all) if is_text && all.len() > 1 => f64::NAN,
        Some(all) => all.first().copied().unwrap_or(usual),
        None if variable.attributes.0.contains_key(name) => f64::NAN,
        None => usual,
    }
}

/// A number as values of this kind have it: a fill value of more digits is the nearest one of theirs.
pub(crate) fn as_stored(kind: Kind, number: f64) -> f64 {
    match kind {
        Kind::Float(2) => cube::foreign::as_stored(ArrayKind::Float(2), number),
        _ => number,
    }
}

/// Of which numbers a bound of the valid range speaks.
fn speaks(variable: &Variable, name: &str, number: f64) -> Speaks {
    let attributes = &variable.attributes;
    let Some(unpacked) = unpacked_kind(attributes) else {
        return Speaks::OfStored;
    };
    let is_float = |kind| matches!(kind, Kind::Float(_));
    // What no stored integer can be is a value.
    let beyond = match variable.kind {
        Kind::Integer(bytes) | Kind::Unsigned(bytes) => {
            number.abs() >= 2f64.powi(8 * i32::from(bytes))
        }
        _ => false,
    };
    let Some(kind) = attributes.kind(name) else {
        // A text has no type of its own: written as no integer is, it is of no stored integers.
        let text = attributes.text(name).unwrap_or_default();
        let is_of_values = beyond || text.contains(['.', 'e', 'E']);
        return if is_of_values && !is_float(variable.kind) {
            Speaks::OfValues
        } else {
            Speaks::Unclear
        };
    };
    // A text has no type of its own: what is no type of stored integers is that of values.
    if is_scaled_by_text(attributes) && is_float(kind) && !is_float(variable.kind) {
        return Speaks::OfValues;
    }
    if kind == unpacked && width(unpacked) > width(variable.kind) {
        return Speaks::OfValues;
    }
    if !is_float(kind) || is_float(variable.kind) {
        return Speaks::OfStored;
    }
    if number.fract() != 0.0 || beyond {
        return Speaks::OfValues;
    }
    Speaks::Unclear
}

fn is_scaled_by_text(attributes: &Attributes) -> bool {
    let is_text = |name: &str| {
        attributes
            .text(name)
            .is_some_and(|text| !text.trim().is_empty())
    };
    SCALES.into_iter().any(is_text)
}

/// The type that scale and offset unpack to: the wider of theirs. Their text is read in double precision.
fn unpacked_kind(attributes: &Attributes) -> Option<Kind> {
    if is_scaled_by_text(attributes) {
        return Some(Kind::Float(8));
    }
    let kinds = SCALES.map(|name| attributes.kind(name));
    kinds.into_iter().flatten().max_by_key(|kind| width(*kind))
}

/// Orders types by what they can hold: any floating-point number is wider than an integer.
fn width(kind: Kind) -> (bool, u8) {
    match kind {
        Kind::Float(bytes) => (true, bytes),
        Kind::Integer(bytes) | Kind::Unsigned(bytes) => (false, bytes),
        Kind::Text(_) | Kind::Other => (false, 0),
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "these numbers are exact")]
mod tests;
