//! A unit as a file spells it to the unit that a property is stored in.

use super::property::{self, COMMON_UNITS, DEGREE, Property};
use crate::plan::unit::{self, Unit};

/// From here on numbers stand for no value: 1e35 and the like.
const NO_NUMBER: f64 = 1e30;

/// Share of the way from zero to the lowest value that can be true, beyond which nines below zero stand for no value: a wind of
/// -99.9 m/s is none, a longitude of -99.9 is one.
const UNMARKED_SHARE: f64 = 0.75;
/// Words in names of properties that are differences: on the scale of a temperature their zero stays where it is.
const DIFFERENCES: [&str; 20] = [
    "anomaly",
    "bias",
    "correction",
    "deviation",
    "diff",
    "difference",
    "err",
    "error",
    "gradient",
    "offset",
    "precision",
    "range",
    "residual",
    "rms",
    "rmse",
    "sd",
    "spread",
    "std",
    "stddev",
    "uncertainty",
];

/// How stored numbers become values: `value = number * factor + offset`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Conversion {
    /// Name of the property.
    pub(super) property: String,
    /// Unit of values.
    pub(super) unit: String,
    factor: f64,
    offset: f64,
    known: Option<&'static Property>,
}

/// What a number of a file is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Given {
    /// A value, in the stored unit.
    Value(f64),
    /// No value.
    Missing,
    /// What cannot be true, in the stored unit.
    Implausible(f64),
}

impl Conversion {
    /// The conversion of a property from a file's unit, or what is wrong with the unit.
    pub(super) fn new(name: &str, spelling: &str) -> Result<Self, String> {
        let known = property::known(name);
        let (unit, factor, offset) = match known {
            Some(property) => to_known(property, spelling)?,
            None => to_common(name, spelling),
        };
        Ok(Self {
            property: name.to_owned(),
            unit,
            factor,
            offset,
            known,
        })
    }

    /// What a number of the file is.
    pub(super) fn given(&self, number: f64) -> Given {
        let value = number * self.factor + self.offset;
        if self.is_unmarked(number, value) {
            return Given::Missing;
        }
        let can_be = self
            .known
            .is_none_or(|known| known.plausible.contains(&value));
        if value.is_finite() && can_be && number.abs() < NO_NUMBER {
            Given::Value(value)
        } else if stands_for_nothing(number) {
            Given::Missing
        } else {
            Given::Implausible(value)
        }
    }

    /// Does a number that could be true stand for no value all the same? Nines below zero (-99, -99.9, -999) of what nothing is
    /// known of, and of what is known those in the last quarter of its way down; 9999 and longer nines of what nothing is known
    /// of.
    fn is_unmarked(&self, number: f64, value: f64) -> bool {
        let can_stand = match self.known {
            Some(known) => {
                number < 0.0 && value < UNMARKED_SHARE * known.plausible.start().min(0.0)
            }
            None => number <= -99.0 || number >= 9999.0,
        };
        can_stand && number.abs() < NO_NUMBER && stands_for_nothing(number)
    }

    /// What its values can be, for people.
    pub(super) fn bounds(&self) -> String {
        self.known.map_or_else(String::new, |known| {
            let (low, high) = (known.plausible.start(), known.plausible.end());
            format!(", which is not of {low} to {high}")
        })
    }
}

/// Does a number that cannot be true stand for no value, where the file has no fill value of its own? No number, a very
/// large one, and nines (99.9, -999, -9999.9): the stand-ins of WOCE, SOCAT, NDBC and EPIC.
fn stands_for_nothing(number: f64) -> bool {
    if number.is_nan() || number.is_finite() && number.abs() >= NO_NUMBER {
        return true;
    }
    // Float32 in the file: -999.9 is no short decimal as a float64.
    let digits = (number.abs() as f32).to_string().replace('.', "");
    digits.len() > 1 && digits.bytes().all(|digit| digit == b'9')
}

/// Unit, factor and offset for a property that is known.
fn to_known(property: &Property, spelling: &str) -> Result<(String, f64, f64), String> {
    let stored = property.unit.to_owned();
    if property.unit == DEGREE {
        return if is_degree(spelling) {
            Ok((stored, 1.0, 0.0))
        } else {
            Err(format!(
                "has unit {spelling:?}, directions and places are given in degrees"
            ))
        };
    }
    // Practical salinity is a plain number that files give a great many units.
    if property.name.ends_with("salinity") {
        return if spelling.trim().is_empty() || unit::is_salinity(spelling) {
            Ok((stored, 1.0, 0.0))
        } else {
            Err(format!(
                "has unit {spelling:?}, practical salinity is a plain number"
            ))
        };
    }
    let own = parse(spelling, property.unit == "K")
        .map_err(|e| format!("has unit {spelling:?}, which {e}"))?;
    let target = unit::parse(property.unit).map_err(|e| format!("has a stored unit that {e}"))?;
    match linear(own, target) {
        Some((factor, offset)) => Ok((stored, factor, offset)),
        None => Err(format!(
            "has unit {spelling:?}, which is no unit of {}; it is stored in {}",
            property.name, property.unit
        )),
    }
}

/// Unit, factor and offset for anything else: a common unit of the same kind, or the file's own.
fn to_common(name: &str, spelling: &str) -> (String, f64, f64) {
    let own = parse(spelling, spelling.starts_with("deg"));
    let common = own.ok().and_then(|own| {
        COMMON_UNITS.into_iter().find_map(|common| {
            let (factor, offset) = linear(own, unit::parse(common).ok()?)?;
            let offset = if is_difference(name) { 0.0 } else { offset };
            Some((common.to_owned(), factor, offset))
        })
    });
    common.unwrap_or_else(|| {
        let plain = spelling.chars().filter(|c| !c.is_control());
        let mut kept: String = plain.collect();
        kept.truncate(kept.floor_char_boundary(32));
        if kept.is_empty() {
            kept.push('1');
        }
        (kept, 1.0, 0.0)
    })
}

/// Is a property how far values are apart, by the words of its name?
fn is_difference(name: &str) -> bool {
    name.split('_')
        .any(|word| DIFFERENCES.contains(&word) || word.ends_with("stdev"))
}

/// `value = number * factor + offset` from one unit to another of the same kind.
fn linear(own: Unit, target: Unit) -> Option<(f64, f64)> {
    let factor = own.factor / target.factor;
    let is_alike = own.dimension == target.dimension && own.dimension.month == 0;
    (is_alike && factor.is_normal()).then(|| (factor, (own.offset - target.offset) / target.factor))
}

/// Where a temperature is meant, `C` is a degree Celsius; elsewhere it is carbon.
fn parse(spelling: &str, is_temperature: bool) -> Result<Unit, String> {
    let squeezed = spelling.to_ascii_lowercase().replace([' ', '.', '_'], "");
    match squeezed.as_str() {
        "c" | "degc" | "degreec" | "degreesc" | "degreescelsius" | "degcelsius"
            if is_temperature =>
        {
            unit::parse("degC")
        }
        "nmi" | "nauticalmile" | "nauticalmiles" => Ok(Unit {
            factor: 1852.0,
            ..unit::parse("m")?
        }),
        "ft" | "foot" | "feet" => Ok(Unit {
            factor: 0.3048,
            ..unit::parse("m")?
        }),
        _ => unit::parse(spelling),
    }
}

fn is_degree(spelling: &str) -> bool {
    let lower = spelling.to_ascii_lowercase();
    let word = lower.trim_start_matches("decimal").trim();
    word.starts_with("deg") && !word.contains('c') && !word.ends_with('k') || word == "°"
}

#[cfg(test)]
mod tests {
    use super::*;

    fn given(property: &str, unit: &str, number: f64) -> Given {
        Conversion::new(property, unit).unwrap().given(number)
    }

    fn value(property: &str, unit: &str, number: f64) -> Option<f64> {
        match given(property, unit, number) {
            Given::Value(value) => Some(value),
            Given::Missing | Given::Implausible(_) => None,
        }
    }

    #[test]
    fn units_of_real_files_become_the_stored_one() {
        let near = |found: Option<f64>, expected: f64| (found.unwrap() - expected).abs() < 1e-9;
        assert!(near(value("sea_surface_temperature", "C", 20.0), 293.15));
        assert!(near(
            value("sea_surface_temperature", "deg.C", 20.0),
            293.15
        ));
        assert!(near(
            value("sea_water_temperature", "Degree_C", -1.0),
            272.15
        ));
        assert!(near(
            value("eastward_sea_water_velocity", "cm s-1", 50.0),
            0.5
        ));
        assert!(near(
            value("air_pressure_at_mean_sea_level", "hPa", 1013.25),
            101_325.0
        ));
        assert!(near(
            value("fugacity_of_carbon_dioxide_in_sea_water", "uatm", 1e3),
            101.325
        ));
        assert!(near(
            value("mole_fraction_of_carbon_dioxide_in_air", "umol/mol", 400.0),
            4e-4
        ));
        assert!(near(value("relative_humidity", "%", 80.0), 0.8));
        assert!(near(
            value("sea_water_practical_salinity", "PSU", 35.0),
            35.0
        ));
        assert!(near(value("visibility_in_air", "nmi", 2.0), 3704.0));
        assert!(near(value("wind_from_direction", "degrees", 276.0), 276.0));
    }

    #[test]
    fn what_cannot_be_true_is_told_from_what_stands_for_no_value() {
        let sst = |number| given("sea_surface_temperature", "degree_C", number);
        let float32 = f64::from(-999.9f32);
        for number in [-999.0, -99.99, 99.9, 9999.0, float32, 1e35, -1e34, f64::NAN] {
            assert_eq!(sst(number), Given::Missing, "{number}");
        }
        for number in [-30.0, 290.0, -900.0, 9.0e9, f64::INFINITY] {
            assert!(matches!(sst(number), Given::Implausible(_)), "{number}");
        }
        // Nines that can be true are values.
        assert_eq!(given("wind_speed", "m s-1", 99.0), Given::Value(99.0));
        assert_eq!(given("longitude", "degree", -99.9), Given::Value(-99.9));
        let bounds = Conversion::new("wind_speed", "m s-1").unwrap().bounds();
        assert_eq!(bounds, ", which is not of 0 to 120");
    }

    #[test]
    fn unknown_properties_keep_a_unit_of_their_kind() {
        let conversion = Conversion::new("temperature_equi", "degrees C").unwrap();
        assert_eq!(conversion.unit, "K");
        assert!((value("temperature_equi", "degrees C", -1.16).unwrap() - 271.99).abs() < 1e-9);
        let other = Conversion::new("ph", "total scale").unwrap();
        assert_eq!(
            (other.unit.as_str(), other.given(8.1)),
            ("total scale", Given::Value(8.1))
        );
        let hostile = Conversion::new("x", &"\u{1b}é".repeat(100)).unwrap();
        assert!(hostile.unit.len() <= 32 && !hostile.unit.chars().any(char::is_control));
    }

    #[test]
    fn differences_of_temperatures_keep_their_zero() {
        for name in [
            "sea_water_temperature_standard_error",
            "temp_air_stddev",
            "sea_surface_temperature_anomaly",
            "temp_uncertainty",
        ] {
            let conversion = Conversion::new(name, "degree_Celsius").unwrap();
            assert_eq!(conversion.unit, "K");
            assert_eq!(conversion.given(0.5), Given::Value(0.5), "{name}");
        }
        // A word is a word: this is no error.
        let found = value("temperature_erratic", "degree_Celsius", 0.5).unwrap();
        assert!((found - 273.65).abs() < 1e-9, "{found}");
    }

    #[test]
    fn stand_ins_that_could_be_true_are_no_values_unless_such_values_are_common() {
        for (property, unit, number) in [
            ("nitrate", "umol kg-1", -999.0),
            ("nitrate", "umol kg-1", -99.9),
            ("nitrate", "umol kg-1", 9999.0),
            ("eastward_wind", "m s-1", -99.9),
            ("water_surface_height_above_reference_datum", "m", -99.0),
        ] {
            assert_eq!(
                given(property, unit, number),
                Given::Missing,
                "{property} {number}"
            );
        }
        for (property, unit, number) in [
            ("nitrate", "umol kg-1", 9.9),
            ("nitrate", "umol kg-1", -9.9),
            ("oxygen", "umol kg-1", 99.0),
            ("eastward_wind", "m s-1", -9.9),
            ("eastward_sea_water_velocity", "cm s-1", -99.9),
            ("longitude", "degree", -99.9),
        ] {
            let found = given(property, unit, number);
            assert!(
                matches!(found, Given::Value(_)),
                "{property} {number}: {found:?}"
            );
        }
    }

    #[test]
    fn a_unit_of_another_kind_is_refused() {
        for (name, unit) in [
            ("sea_surface_temperature", "m"),
            ("wind_speed", "furlongs"),
            ("wind_from_direction", "m s-1"),
            ("sea_water_practical_salinity", "kg m-3"),
            ("wind_to_direction", "degrees C"),
        ] {
            assert!(Conversion::new(name, unit).is_err(), "{name} in {unit}");
        }
    }
}
