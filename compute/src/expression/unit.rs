//! Units as powers of five base units, so that an expression over mixed ones is refused instead of computed.
//!
//! Stored values are in SI units throughout (`Quantity::unit`), so that a dimension is all that a unit can differ by. Units
//! with a factor are for numbers that people write: `unit(0.17, 'K')`, `unit(5, 'hPa')`.

use std::fmt::{Display, Formatter};

/// Powers of kilogram, metre, second, kelvin and mole.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Unit {
    powers: [i8; 5],
}

/// A number's unit as people write it: `SI = factor * number + offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scaled {
    /// Multiplies the number.
    pub factor: f64,
    /// Added after the factor; 0 but for degrees Celsius.
    pub offset: f64,
    /// The SI unit.
    pub unit: Unit,
}

const BASES: [&str; 5] = ["kg", "m", "s", "K", "mol"];
/// Longest text of a unit that is read, bytes.
const MAX_BYTES: usize = 64;
/// Highest power that is understood; nothing in the field comes near it.
const MAX_POWER: i8 = 24;

impl Unit {
    /// A pure number.
    pub const ONE: Self = Self::of([0; 5]);
    /// Temperature.
    pub const KELVIN: Self = Self::of([0, 0, 0, 1, 0]);
    /// Pressure.
    pub const PASCAL: Self = Self::of([1, -1, -2, 0, 0]);
    /// Speed.
    pub const METRE_PER_SECOND: Self = Self::of([0, 1, -1, 0, 0]);
    /// Second moment of a speed.
    pub const SPEED_2: Self = Self::of([0, 2, -2, 0, 0]);
    /// Third moment of a speed.
    pub const SPEED_3: Self = Self::of([0, 3, -3, 0, 0]);
    /// Solubility by volume: mol m⁻³ Pa⁻¹.
    pub const MOL_PER_M3_PASCAL: Self = Self::of([-1, -2, 2, 0, 1]);
    /// Solubility by mass: mol kg⁻¹ Pa⁻¹.
    pub const MOL_PER_KG_PASCAL: Self = Self::of([-2, 1, 2, 0, 1]);
    /// Mass of a mole.
    pub const KG_PER_MOL: Self = Self::of([1, 0, 0, 0, -1]);

    const fn of(powers: [i8; 5]) -> Self {
        Self { powers }
    }

    /// The unit of stored values, such as `kg m-2 s-1`; none if it is not one of SI without a factor.
    pub fn stored(text: &str) -> Option<Self> {
        let scaled = Scaled::parse(text)?;
        let is_plain = scaled.offset == 0.0 && (scaled.factor - 1.0).abs() < 1e-12;
        is_plain.then_some(scaled.unit)
    }

    /// Of a product.
    pub fn times(self, other: Self) -> Option<Self> {
        self.with(other, i8::checked_add)
    }

    /// Of a ratio.
    pub fn over(self, other: Self) -> Option<Self> {
        self.with(other, i8::checked_sub)
    }

    fn with(self, other: Self, join: fn(i8, i8) -> Option<i8>) -> Option<Self> {
        let mut powers = self.powers;
        for (own, other) in powers.iter_mut().zip(other.powers) {
            *own = join(*own, other).filter(|power| power.abs() <= MAX_POWER)?;
        }
        Some(Self { powers })
    }

    /// Of a power, which must leave whole powers: the root of m² is m, that of m is none.
    pub fn to(self, exponent: f64) -> Option<Self> {
        let mut powers = self.powers;
        for power in &mut powers {
            let raised = f64::from(*power) * exponent;
            if raised.fract() != 0.0 || raised.abs() > f64::from(MAX_POWER) {
                return None;
            }
            *power = raised as i8;
        }
        Some(Self { powers })
    }
}

impl Display for Unit {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let known = [
            (Self::PASCAL, "Pa"),
            (Self::MOL_PER_M3_PASCAL, "mol m-3 Pa-1"),
            (Self::MOL_PER_KG_PASCAL, "mol kg-1 Pa-1"),
        ];
        if let Some((_, name)) = known.iter().find(|(unit, _)| unit == self) {
            return f.write_str(name);
        }
        let mut is_first = true;
        for (base, power) in BASES.iter().zip(self.powers) {
            if power != 0 {
                f.write_str(if is_first { "" } else { " " })?;
                f.write_str(base)?;
                if power != 1 {
                    write!(f, "{power}")?;
                }
                is_first = false;
            }
        }
        if is_first { f.write_str("1") } else { Ok(()) }
    }
}

impl Scaled {
    /// The unit of stored values, one of SI or so many of one, as those of statistics: `K year-1`, `g m-2 year-1`, `day`. None if it begins
    /// elsewhere, or is a part of one: a share in percent beside a number would be taken for the other.
    pub fn kept(text: &str) -> Option<Self> {
        let scaled = Self::parse(text).filter(|scaled| scaled.offset == 0.0)?;
        // A hair beside one is one: the bits of values stay.
        let is_one = (scaled.factor - 1.0).abs() < 1e-12;
        if scaled.unit == Unit::ONE && !is_one {
            return None;
        }
        Some(Self {
            factor: if is_one { 1.0 } else { scaled.factor },
            ..scaled
        })
    }

    /// Reads `cm h-1`, `kg m-2 s-1`, `µatm`, `degC`, `1`; none if a part of it is unknown.
    pub fn parse(text: &str) -> Option<Self> {
        let text = text.trim();
        if text.is_empty() || text.len() > MAX_BYTES {
            return None;
        }
        if matches!(text, "degC" | "°C" | "celsius") {
            return Some(Self {
                factor: 1.0,
                offset: 273.15,
                unit: Unit::KELVIN,
            });
        }
        let mut all = Self {
            factor: 1.0,
            offset: 0.0,
            unit: Unit::ONE,
        };
        for part in text.split_whitespace() {
            let split = part
                .find(|c: char| c == '-' || c.is_ascii_digit())
                .filter(|&split| split > 0);
            let (symbol, power) = match split {
                Some(split) => (&part[..split], part[split..].parse::<i8>().ok()?),
                None => (part, 1),
            };
            if power.abs() > MAX_POWER {
                return None;
            }
            let (factor, unit) = symbol_of(symbol)?;
            all.factor *= factor.powi(i32::from(power));
            all.unit = all.unit.times(unit.to(f64::from(power))?)?;
        }
        Some(all)
    }
}

/// Factor to SI and SI unit of one symbol.
fn symbol_of(symbol: &str) -> Option<(f64, Unit)> {
    let base = |index: usize| {
        let mut powers = [0; 5];
        powers[index] = 1;
        Unit::of(powers)
    };
    let volume = Unit::of([0, 3, 0, 0, 0]);
    Some(match symbol {
        "1" => (1.0, Unit::ONE),
        "%" => (0.01, Unit::ONE),
        "ppm" => (1e-6, Unit::ONE),
        "kg" => (1.0, base(0)),
        "g" => (1e-3, base(0)),
        "mg" => (1e-6, base(0)),
        "m" => (1.0, base(1)),
        "cm" => (0.01, base(1)),
        "mm" => (1e-3, base(1)),
        "km" => (1e3, base(1)),
        "s" => (1.0, base(2)),
        "h" | "hour" => (3600.0, base(2)),
        "d" | "day" => (86_400.0, base(2)),
        "year" | "yr" => (365.25 * 86_400.0, base(2)),
        "K" => (1.0, base(3)),
        "mol" => (1.0, base(4)),
        "mmol" => (1e-3, base(4)),
        "umol" | "µmol" => (1e-6, base(4)),
        "l" => (1e-3, volume),
        "Pa" => (1.0, Unit::PASCAL),
        "hPa" | "mbar" => (100.0, Unit::PASCAL),
        "bar" => (1e5, Unit::PASCAL),
        "atm" => (101_325.0, Unit::PASCAL),
        "uatm" | "µatm" => (0.101_325, Unit::PASCAL),
        "J" => (1.0, Unit::of([1, 2, -2, 0, 0])),
        "N" => (1.0, Unit::of([1, 1, -2, 0, 0])),
        "W" => (1.0, Unit::of([1, 2, -3, 0, 0])),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::quantity::Quantity;

    #[test]
    fn the_unit_of_every_quantity_is_understood_and_written_back() {
        for quantity in Quantity::ALL {
            let unit = Unit::stored(quantity.unit()).unwrap();
            assert_eq!(unit.to_string(), quantity.unit(), "{quantity:?}");
        }
    }

    #[test]
    fn units_of_people_have_their_factors() {
        for (text, factor, unit) in [
            ("cm h-1", 0.01 / 3600.0, Unit::METRE_PER_SECOND),
            ("mol l-1 atm-1", 1000.0 / 101_325.0, Unit::MOL_PER_M3_PASCAL),
            ("µatm", 0.101_325, Unit::PASCAL),
            ("1", 1.0, Unit::ONE),
        ] {
            let scaled = Scaled::parse(text).unwrap();
            assert_eq!(scaled.unit, unit, "{text}");
            assert!((scaled.factor / factor - 1.0).abs() < 1e-14, "{text}");
        }
        assert_eq!(Unit::stored("hPa"), None);
        assert_eq!(Unit::stored("degC"), None);
        for bad in [
            "",
            "furlong",
            "m99999",
            "kg--2",
            "m2.5",
            "5 m",
            &"m ".repeat(40),
        ] {
            assert_eq!(Scaled::parse(bad), None, "{bad}");
        }
    }

    #[test]
    fn flux_is_velocity_times_solubility_times_pressure_times_the_mass_of_a_mole() {
        let flux = Unit::METRE_PER_SECOND
            .times(Unit::MOL_PER_M3_PASCAL)
            .and_then(|unit| unit.times(Unit::PASCAL))
            .and_then(|unit| unit.times(Unit::KG_PER_MOL));
        assert_eq!(flux, Unit::stored("kg m-2 s-1"));
        assert_eq!(Unit::SPEED_2.to(0.5), Some(Unit::METRE_PER_SECOND));
        assert_eq!(Unit::METRE_PER_SECOND.to(0.5), None);
        assert_eq!(Unit::SPEED_2.over(Unit::SPEED_2), Some(Unit::ONE));
        assert_eq!(Unit::SPEED_3.to(1e9), None);
    }
}
