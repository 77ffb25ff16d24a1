//! Stored numbers to values: fill values, valid range, scale and offset.

use crate::file::description::{Attributes, Kind, Variable};

/// From here on floating-point numbers are NetCDF's default fill values (9.97e36), or the 1e35 of older programs.
const DEFAULT_FILL_FLOAT: f64 = 1e34;

/// How stored numbers become values: `value = stored * scale + offset`, NaN where there is no data.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Packing {
    pub(crate) scale: f64,
    pub(crate) offset: f64,
    /// Stored numbers that mean no data.
    pub(crate) fills: Vec<f64>,
    /// Stored numbers outside mean no data.
    pub(crate) valid_stored: (f64, f64),
    /// Values (unpacked, in the file's unit) outside mean no data.
    pub(crate) valid_values: (f64, f64),
    /// Stored signed integers that are meant unsigned: what to add to negative ones.
    pub(crate) unsigned_wrap: Option<f64>,
    pub(crate) is_float32: bool,
}

impl Packing {
    /// The packing that the attributes of a variable state.
    pub(crate) fn of(variable: &Variable) -> Self {
        let attributes = &variable.attributes;
        let mut fills: Vec<f64> = ["_FillValue", "missing_value"]
            .into_iter()
            .filter_map(|name| attributes.numbers(name))
            .flatten()
            .collect();
        if fills.is_empty() {
            fills.extend(default_fill(variable.kind));
        }
        let is_unsigned = attributes
            .text("_Unsigned")
            .is_some_and(|t| t.eq_ignore_ascii_case("true"));
        let unsigned_wrap = match variable.kind {
            Kind::Integer(bytes) if is_unsigned => Some(2f64.powi(8 * i32::from(bytes))),
            _ => None,
        };
        Self {
            scale: attributes.number("scale_factor").unwrap_or(1.0),
            offset: attributes.number("add_offset").unwrap_or(0.0),
            fills,
            valid_stored: valid_range(attributes),
            valid_values: (f64::NEG_INFINITY, f64::INFINITY),
            unsigned_wrap,
            is_float32: variable.kind == Kind::Float(4),
        }
    }

    /// Does the stored number say that there is no value? What is outside a valid range is a value that is not taken.
    #[expect(clippy::float_cmp, reason = "a fill value is one exact number")]
    pub(crate) fn is_missing(&self, stored: f64) -> bool {
        let is_fill =
            |fill: &f64| *fill == stored || self.is_float32 && f64::from(*fill as f32) == stored;
        stored.is_nan() || stored.abs() > DEFAULT_FILL_FLOAT || self.fills.iter().any(is_fill)
    }

    /// The value of a stored number, in the file's unit; NaN for no data.
    pub(crate) fn value(&self, stored: f64) -> f64 {
        if self.is_missing(stored) || !(self.valid_stored.0..=self.valid_stored.1).contains(&stored)
        {
            return f64::NAN;
        }
        let stored = match self.unsigned_wrap {
            Some(wrap) if stored < 0.0 => stored + wrap,
            _ => stored,
        };
        let value = stored * self.scale + self.offset;
        if (self.valid_values.0..=self.valid_values.1).contains(&value) {
            value
        } else {
            f64::NAN
        }
    }
}

/// What NetCDF fills a variable with that has no fill value of its own.
fn default_fill(kind: Kind) -> Option<f64> {
    match kind {
        Kind::Integer(2) => Some(-32_767.0),
        Kind::Integer(4) => Some(-2_147_483_647.0),
        Kind::Integer(_) | Kind::Unsigned(_) | Kind::Float(_) | Kind::Text(_) | Kind::Other => None,
    }
}

/// `valid_range`, or `valid_min` and `valid_max`, of the stored numbers; never beyond the default fill values.
fn valid_range(attributes: &Attributes) -> (f64, f64) {
    let range = attributes.numbers("valid_range").filter(|r| r.len() == 2);
    let low = range
        .as_ref()
        .map(|r| r[0])
        .or_else(|| attributes.number("valid_min"));
    let high = range
        .as_ref()
        .map(|r| r[1])
        .or_else(|| attributes.number("valid_max"));
    let usable = |v: &f64| !v.is_nan();
    let low = low
        .filter(usable)
        .unwrap_or(f64::NEG_INFINITY)
        .max(-DEFAULT_FILL_FLOAT);
    let high = high
        .filter(usable)
        .unwrap_or(f64::INFINITY)
        .min(DEFAULT_FILL_FLOAT);
    (low, high)
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "these numbers are exact")]
mod tests {
    use super::*;
    use crate::file::description::AttributeValue;

    fn variable(kind: Kind, numbers: &[(&str, &[f64])]) -> Variable {
        let attribute = |(name, values): &(&str, &[f64])| {
            (
                (*name).to_owned(),
                AttributeValue::Numbers(values.iter().map(|v| (*v).into()).collect()),
            )
        };
        Variable {
            name: "v".into(),
            dimensions: vec![],
            kind,
            attributes: numbers.iter().map(attribute).collect(),
        }
    }

    #[test]
    fn packed_integers_unpack_and_their_range_is_that_of_the_stored_numbers() {
        let attributes: [(&str, &[f64]); 4] = [
            ("scale_factor", &[0.01]),
            ("add_offset", &[273.15]),
            ("valid_range", &[-300.0, 4500.0]),
            ("_FillValue", &[-32_768.0]),
        ];
        let packing = Packing::of(&variable(Kind::Integer(2), &attributes));
        assert!((packing.value(2000.0) - 293.15).abs() < 1e-12);
        assert!(packing.value(-32_768.0).is_nan());
        assert!(packing.value(4501.0).is_nan());
    }

    #[test]
    fn every_kind_of_missing_is_missing() {
        let float = Packing::of(&variable(
            Kind::Float(4),
            &[("_FillValue", &[-999.9]), ("missing_value", &[-5.0])],
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
        assert!(
            Packing::of(&variable(Kind::Integer(2), &[]))
                .value(-32_767.0)
                .is_nan()
        );
    }
}
