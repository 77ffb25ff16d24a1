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
        let mut fills: Vec<f64> = ["_FillValue", "missing_value"]
            .into_iter()
            .filter_map(|name| numbers(variable, name))
            .flatten()
            .map(|fill| as_stored(variable.kind, fill))
            .collect();
        // Whatever else means no data: cells that nobody wrote hold it.
        if attributes.numbers("_FillValue").is_none() {
            fills.extend(default_fill(variable.kind));
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
    /// `Values` if the scale is zero, scale or offset are no finite number, or the valid range is a text that is none.
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
        Ok(self)
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

/// What NetCDF fills a variable with that has no fill value of its own; of bytes every value may be meant.
fn default_fill(kind: Kind) -> Option<f64> {
    match kind {
        Kind::Integer(2) => Some(-32_767.0),
        Kind::Integer(4) => Some(-2_147_483_647.0),
        Kind::Integer(8) => Some(-9_223_372_036_854_775_806.0),
        Kind::Unsigned(2) => Some(65_535.0),
        Kind::Unsigned(4) => Some(4_294_967_295.0),
        Kind::Unsigned(8) => Some(18_446_744_073_709_551_614.0),
        Kind::Integer(_) | Kind::Unsigned(_) | Kind::Float(_) | Kind::Text(_) | Kind::Other => None,
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "these numbers are exact")]
mod tests {
    use super::*;
    use crate::inspect::file::description::AttributeValue;

    const SHORT: Kind = Kind::Integer(2);
    const FLOAT: Kind = Kind::Float(4);
    const DOUBLE: Kind = Kind::Float(8);

    fn variable(kind: Kind, numbers: &[(&str, Kind, &[f64])]) -> Variable {
        let attribute = |(name, kind, values): &(&str, Kind, &[f64])| {
            let value = AttributeValue::Numbers {
                kind: *kind,
                bits: values.iter().map(|v| (*v).into()).collect(),
            };
            ((*name).to_owned(), value)
        };
        Variable {
            name: "v".into(),
            dimensions: vec![],
            kind,
            attributes: numbers.iter().map(attribute).collect(),
        }
    }

    /// Shorts that unpack to float32 degrees: 0.01 times the number, plus 20.
    fn packed(range: &[(&str, Kind, &[f64])]) -> Packing {
        let mut attributes: Vec<(&str, Kind, &[f64])> = vec![
            ("scale_factor", FLOAT, &[0.01]),
            ("add_offset", FLOAT, &[20.0]),
            ("_FillValue", SHORT, &[-32_768.0]),
        ];
        attributes.extend_from_slice(range);
        Packing::of(&variable(SHORT, &attributes))
    }

    #[test]
    fn packing_that_is_written_as_text_counts_and_what_is_no_number_is_no_packing() {
        let told = |name: &str, text: &str| {
            let mut shorts = variable(SHORT, &[]);
            let text = AttributeValue::Text(text.to_owned());
            shorts.attributes.0.insert(name.to_owned(), text);
            Packing::of(&shorts)
        };
        assert_eq!(told("scale_factor", "0.5").value(3.0), 1.5);
        assert_eq!(told("add_offset", " 20").value(3.0), 23.0);
        assert!(told("missing_value", "-999, -998").value(-998.0).is_nan());
        assert!(told("scale_factor", "see the manual").scale.is_nan());
        assert!(told("add_offset", "none").offset.is_nan());
        assert_eq!(told("scale_factor", "").value(3.0), 3.0);
        // A decimal comma is none between numbers.
        for (name, text) in [("add_offset", "273,15"), ("scale_factor", "1, 5")] {
            let packing = told(name, text);
            assert!(packing.checked(&variable(SHORT, &[])).is_err(), "{text}");
        }
        assert_eq!(told("_FillValue", "-999,0").value(0.0), 0.0);
        assert!(
            told("add_offset", "273.15")
                .checked(&variable(SHORT, &[]))
                .is_ok()
        );
        // Bounds of values are known by their type, whatever type the scale is written in.
        let bounds = [
            ("valid_min", FLOAT, &[-1.0][..]),
            ("valid_max", FLOAT, &[40.0]),
        ];
        let mut shorts = variable(SHORT, &bounds);
        let scale = AttributeValue::Text("0.01".to_owned());
        shorts.attributes.0.insert("scale_factor".to_owned(), scale);
        let packing = Packing::of(&shorts);
        assert_eq!(
            (packing.value(2500.0), packing.assumption.as_ref()),
            (25.0, None)
        );
        assert!(packing.value(4100.0).is_nan());
    }

    #[test]
    fn a_valid_range_that_is_written_as_text_counts_and_what_is_no_numbers_is_refused() {
        let with = |mut own: Variable, texts: &[(&str, &str)]| {
            for (name, text) in texts {
                let text = AttributeValue::Text((*text).to_owned());
                own.attributes.0.insert((*name).to_owned(), text);
            }
            own
        };
        let float = |texts: &[(&str, &str)]| Packing::of(&with(variable(FLOAT, &[]), texts));
        for texts in [
            &[("valid_range", "0.0 100.1")][..],
            &[("valid_range", "0, 100.1")],
            &[("valid_min", " 0"), ("valid_max", "100.1")],
        ] {
            let packing = float(texts);
            assert_eq!(packing.value(0.0), 0.0, "{texts:?}");
            // In the precision of the values.
            let most = f64::from(100.1f32);
            assert_eq!(packing.value(most), most, "{texts:?}");
            for outside in [-1.0, 100.2] {
                assert!(packing.value(outside).is_nan(), "{outside} {texts:?}");
            }
            assert!(packing.checked(&variable(FLOAT, &[])).is_ok());
        }
        // Of packed values those that are written as no stored integer is, or that none can be; of others it is said.
        let scale = [("scale_factor", FLOAT, &[0.01][..])];
        let packed = |texts: &[(&str, &str)]| Packing::of(&with(variable(SHORT, &scale), texts));
        for (text, is_of_values) in [
            ("0.0 40.0", true),
            ("0 1e1", true),
            ("0 70000", false),
            ("0 40", false),
        ] {
            let packing = packed(&[("valid_range", text)]);
            assert_eq!(packing.value(900.0).is_nan(), text == "0 40", "{text}");
            assert_eq!(packing.assumption.is_none(), is_of_values, "{text}");
            let told = packing.assumption.unwrap_or_default();
            assert!(
                is_of_values || told.contains("valid_range is text"),
                "{told}"
            );
        }
        for (name, text) in [
            ("valid_range", "0 to 100"),
            ("valid_range", "0"),
            ("valid_min", "0,5"),
            ("valid_max", "0 100"),
            ("valid_max", "none"),
        ] {
            let packing = float(&[(name, text)]);
            let own = packing.clone().with_valid_values(0.0, 1.0);
            let refused = packing.checked(&variable(FLOAT, &[])).unwrap_err();
            assert!(
                refused.detail.contains(name) && refused.detail.contains(text),
                "{refused}"
            );
            assert!(
                own.checked(&variable(FLOAT, &[])).is_ok(),
                "a profile says it"
            );
        }
        assert!(
            float(&[("valid_min", "")])
                .checked(&variable(FLOAT, &[]))
                .is_ok()
        );
    }

    /// Halves are 8 apart there: -9999 is stored as -10000.
    #[test]
    fn a_fill_value_of_more_digits_than_values_have_is_the_nearest_of_theirs() {
        let half = Kind::Float(2);
        let packing = Packing::of(&variable(half, &[("_FillValue", DOUBLE, &[-9999.0])]));
        assert!(packing.value(-10_000.0).is_nan());
        assert!((packing.value(-9992.0) + 9992.0).abs() < 1e-9);
    }

    #[test]
    fn a_range_of_the_stored_type_speaks_of_stored_numbers() {
        let packing = packed(&[("valid_range", SHORT, &[-300.0, 4500.0])]);
        assert!((packing.value(2000.0) - 40.0).abs() < 1e-12);
        assert!(packing.value(-32_768.0).is_nan() && packing.value(4501.0).is_nan());
        assert_eq!(packing.value(4500.0), 65.0);
        assert_eq!(packing.assumption, None);
    }

    #[test]
    fn a_range_of_the_unpacked_type_speaks_of_values() {
        for range in [
            vec![("valid_range", FLOAT, &[-2.0, 45.0][..])],
            vec![
                ("valid_min", FLOAT, &[-2.0][..]),
                ("valid_max", FLOAT, &[45.0][..]),
            ],
        ] {
            let packing = packed(&range);
            for stored in [-2200.0, 0.0, 2500.0] {
                assert_eq!(packing.value(stored), stored * 0.01 + 20.0, "{stored}");
            }
            assert!(packing.value(-2201.0).is_nan() && packing.value(2501.0).is_nan());
            assert_eq!(packing.assumption, None);
        }
    }

    #[test]
    fn a_bound_in_single_precision_is_within_the_range() {
        let scale = f64::from(0.005f32);
        let numbers: [(&str, Kind, &[f64]); 2] = [
            ("scale_factor", FLOAT, &[scale]),
            ("valid_max", FLOAT, &[45.0]),
        ];
        let packing = Packing::of(&variable(SHORT, &numbers));
        assert_eq!(packing.value(9000.0), 9000.0 * scale);
        assert!(packing.value(9001.0).is_nan());
    }

    #[test]
    fn a_range_of_a_third_type_is_of_values_if_it_must_be_and_else_an_assumption() {
        let packing = packed(&[("valid_range", DOUBLE, &[-2.5, 45.5])]);
        assert!(packing.value(2600.0).is_nan() && !packing.value(0.0).is_nan());
        assert_eq!(packing.assumption, None);
        let packing = packed(&[("valid_range", DOUBLE, &[-200.0, 4500.0])]);
        assert!(packing.value(-201.0).is_nan() && !packing.value(4500.0).is_nan());
        let said = packing.assumption.unwrap();
        assert!(
            said.contains("valid_range") && said.contains("float64"),
            "{said}"
        );
        let own =
            packed(&[("valid_range", DOUBLE, &[-200.0, 4500.0])]).with_valid_values(0.0, 30.0);
        assert_eq!((own.value(-1000.0), own.assumption), (10.0, None));
    }

    #[test]
    fn unsigned_bytes_have_unsigned_fills_and_ranges() {
        let byte = Kind::Integer(1);
        let mut numbers = variable(
            byte,
            &[
                ("_FillValue", byte, &[-1.0]),
                ("valid_range", byte, &[0.0, -6.0]),
                ("scale_factor", FLOAT, &[0.5]),
            ],
        );
        let text = AttributeValue::Text("true".to_owned());
        numbers.attributes.0.insert("_Unsigned".to_owned(), text);
        let packing = Packing::of(&numbers);
        assert_eq!(packing.value(-6.0), 125.0);
        assert_eq!(packing.value(100.0), 50.0);
        assert!(packing.value(-1.0).is_nan() && packing.value(-5.0).is_nan());
        // Some write the fill value as it is meant, and some as it is stored.
        for fill in [255.0, -1.0] {
            let fill = [("_FillValue", Kind::Integer(2), &[fill][..])];
            let mut numbers = variable(byte, &fill);
            let text = AttributeValue::Text("true".to_owned());
            numbers.attributes.0.insert("_Unsigned".to_owned(), text);
            let packing = Packing::of(&numbers);
            assert!(packing.value(-1.0).is_nan());
            assert_eq!(packing.value(-2.0), 254.0);
        }
    }

    #[test]
    fn every_kind_of_missing_is_missing() {
        let float = Packing::of(&variable(
            FLOAT,
            &[
                ("_FillValue", FLOAT, &[-999.9]),
                ("missing_value", FLOAT, &[-5.0]),
            ],
        ));
        for stored in [
            f64::NAN,
            f64::INFINITY,
            f64::from(-999.9f32),
            -999.9,
            -5.0,
            9.969209968386869e36,
            1e35,
            -1e35,
        ] {
            assert!(float.value(stored).is_nan(), "{stored}");
        }
        assert_eq!(float.value(-999.0), -999.0);
        for (kind, fill) in [(SHORT, -32_767.0), (Kind::Unsigned(2), 65_535.0)] {
            assert!(Packing::of(&variable(kind, &[])).value(fill).is_nan());
            let beside = [("missing_value", kind, &[9.0][..])];
            let packing = Packing::of(&variable(kind, &beside));
            assert!(packing.value(fill).is_nan() && packing.value(9.0).is_nan());
            let own = [("_FillValue", kind, &[9.0][..])];
            assert_eq!(Packing::of(&variable(kind, &own)).value(fill), fill);
        }
    }
}
