//! Units as files spell them, and their conversion to the one unit a quantity is stored in.
//!
//! [`parse::parse`] reads the spelling; this file knows what the words mean and which quantity they fit. Two things are
//! more than a factor: *of what* a mass or amount is (carbon or CO2), and months, whose length depends on the step.

mod parse;
mod salinity;
mod symbol;

use chrono::{Datelike as _, NaiveDate};
use contract::quantity::{CARBON_KG_PER_MOL, Quantity};
use contract::time::Period;

pub(crate) use parse::parse;
pub(crate) use salinity::is_salinity;

/// Mass of one mole of CO2, kg (IUPAC 2021: carbon 12.011, oxygen 15.999).
const CO2_KG_PER_MOL: f64 = 0.044_009;
/// Density by which a depth of rain becomes a mass, kg m⁻³: fresh water, as the convention has it.
const WATER_KG_PER_M3: f64 = 1000.0;
/// What is wrong with a unit whose powers cannot be counted.
const TOO_HIGH: &str = "has powers too high; give a unit in a profile";

/// Powers of the base units.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Dimension {
    /// Power of kilogram.
    pub(crate) mass: i8,
    /// Power of metre.
    pub(crate) length: i8,
    /// Power of second; months are counted apart.
    pub(crate) time: i8,
    /// Power of calendar month, whose length depends on the step.
    pub(crate) month: i8,
    /// Power of kelvin.
    pub(crate) temperature: i8,
    /// Power of mole.
    pub(crate) amount: i8,
}

/// Of what a mass or amount is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Substance {
    /// Carbon.
    Carbon,
    /// Carbon dioxide.
    Co2,
}

/// A parsed unit: `base = value * factor + offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Unit {
    /// Powers of the base units.
    pub(crate) dimension: Dimension,
    /// Multiplies a value; months are not in it.
    pub(crate) factor: f64,
    /// Added after the factor: degrees Celsius have one.
    pub(crate) offset: f64,
    /// Of what, if the unit says it.
    pub(crate) substance: Option<Substance>,
}

/// A linear conversion to the stored unit of a quantity: `stored = value * factor + offset`, for one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Conversion {
    /// Multiplies a value, with `months` powers of the length of the step's month still to come.
    factor: f64,
    offset: f64,
    months: i8,
}

impl Unit {
    /// The conversion to the stored unit of a quantity, or what is wrong.
    ///
    /// `substance`: of what a mass is where the unit itself does not say (a profile or the standard name does). An
    /// amount (mol) of CO2 holds the same amount of carbon.
    pub(crate) fn to_quantity(
        self,
        quantity: Quantity,
        substance: Option<Substance>,
    ) -> Result<Conversion, String> {
        if let Quantity::Open(_) = quantity {
            return self.to_open(quantity);
        }
        let Ok(target) = parse(quantity.unit()) else {
            return Err(format!("cannot be brought to that of {}", quantity.word()));
        };
        let months = self.dimension.month;
        // A month is a time; its length comes with the step.
        let time = self.dimension.time.checked_add(months);
        let own = Dimension {
            month: 0,
            time: time.ok_or(TOO_HIGH)?,
            ..self.dimension
        };
        let extra = match quantity {
            Quantity::CarbonFlux | Quantity::AccumulatedCarbon => {
                carbon_factor(own, target.dimension, self.substance.or(substance))?
            }
            Quantity::Precipitation
                if own
                    == (Dimension {
                        length: 1,
                        time: -1,
                        ..Dimension::default()
                    }) =>
            {
                WATER_KG_PER_M3
            }
            _ if own == target.dimension => 1.0,
            _ => return Err(wrong_kind(quantity)),
        };
        Ok(Conversion {
            factor: usable(self.factor * extra / target.factor)?,
            offset: self.offset,
            months,
        })
    }
}

impl Unit {
    /// The conversion to the unit that a profile states for an open quantity.
    fn to_open(self, quantity: Quantity) -> Result<Conversion, String> {
        let target = parse(quantity.unit())?;
        if self.dimension != target.dimension || self.substance != target.substance {
            return Err(wrong_kind(quantity));
        }
        Ok(Conversion {
            factor: usable(self.factor / target.factor)?,
            offset: (self.offset - target.offset) / target.factor,
            months: 0,
        })
    }
}

/// The unit that a spelling is for values of a quantity, or what is wrong. Of salinity all that people write mean the same number,
/// and what is none of them (parts in a million or a hundred) is refused rather than taken for a share of 1.
pub(crate) fn of(quantity: Quantity, spelling: &str) -> Result<Unit, String> {
    match quantity {
        Quantity::Salinity if is_salinity(spelling) => parse("1"),
        Quantity::Salinity => Err(wrong_kind(quantity)),
        _ => parse(spelling),
    }
}

/// The unit of base units that a spelling comes to, and what values are multiplied by; none where values are better left
/// as they are: a unit that is not known, a zero that was agreed upon (in a difference of temperatures it is none), months
/// (whose length is that of a step), and masses of carbon (which the unit would not say any more).
pub(crate) fn canonical(spelling: &str) -> Option<(String, f64)> {
    let unit = parse(spelling).ok()?;
    if unit.offset != 0.0 || unit.substance.is_some() || unit.dimension.month != 0 {
        return None;
    }
    Some((base_spelling(unit.dimension), unit.factor))
}

/// `kg m-2 s-1` and the like; pressures in Pa, fluxes of energy in W m-2.
fn base_spelling(dimension: Dimension) -> String {
    let Dimension {
        mass,
        length,
        time,
        month: _,
        temperature,
        amount,
    } = dimension;
    match (mass, length, time, temperature, amount) {
        (1, -1, -2, 0, 0) => return "Pa".to_owned(),
        (1, 0, -3, 0, 0) => return "W m-2".to_owned(),
        _ => {}
    }
    let powers = [
        ("kg", mass),
        ("mol", amount),
        ("m", length),
        ("s", time),
        ("K", temperature),
    ];
    let word = |(name, power): (&str, i8)| match power {
        0 => None,
        1 => Some(name.to_owned()),
        _ => Some(format!("{name}{power}")),
    };
    let words: Vec<String> = powers.into_iter().filter_map(word).collect();
    if words.is_empty() {
        "1".to_owned()
    } else {
        words.join(" ")
    }
}

/// A factor that keeps a value what it is: neither 0 nor so large or small that digits of it are lost.
fn usable(factor: f64) -> Result<f64, String> {
    if factor.is_normal() && factor > 0.0 {
        Ok(factor)
    } else {
        Err(format!(
            "has the factor {factor:e}, which is no positive number of a usual size; give a unit in a profile"
        ))
    }
}

fn wrong_kind(quantity: Quantity) -> String {
    format!(
        "is no unit of {}; give one such as {:?} in a profile",
        quantity.title().to_lowercase(),
        quantity.unit()
    )
}

/// Factor from kg or mol of the substance to kg of carbon.
fn carbon_factor(
    own: Dimension,
    target: Dimension,
    substance: Option<Substance>,
) -> Result<f64, String> {
    let as_amount = Dimension {
        mass: 0,
        amount: 1,
        ..target
    };
    match (own == target, own == as_amount, substance) {
        (true, _, Some(Substance::Carbon)) => Ok(1.0),
        (true, _, Some(Substance::Co2)) => Ok(CARBON_KG_PER_MOL / CO2_KG_PER_MOL),
        (true, _, None) => {
            Err("does not say whether it is mass of carbon or of CO2; give unit = \"... C ...\" or \"... CO2 ...\" in a profile".to_owned())
        }
        (_, true, _) => Ok(CARBON_KG_PER_MOL),
        _ => Err("is no unit of a carbon flux; give one such as \"g C m-2 month-1\" or \"mol m-2 s-1\" in a profile".to_owned()),
    }
}

impl Conversion {
    /// Factor and offset for a step of this period, or what is wrong.
    pub(crate) fn for_period(self, period: Period) -> Result<(f64, f64), String> {
        let month_s = if self.months == 0 {
            1.0
        } else {
            month_seconds(period)?
        };
        let factor = usable(self.factor * month_s.powi(self.months.into()))?;
        Ok((factor, self.offset))
    }
}

/// Length of the month that a step covers or lies in, seconds; the mean length if it covers several whole months.
fn month_seconds(period: Period) -> Result<f64, String> {
    let advice = "a unit per month needs steps of whole months or within one month";
    let instant =
        |t: contract::time::TimeMs| chrono::DateTime::from_timestamp_millis(t.ms()).ok_or(advice);
    let before =
        |t: chrono::DateTime<chrono::Utc>| t.checked_sub_signed(chrono::Duration::milliseconds(1));
    let (start, last) = (
        instant(period.start)?,
        before(instant(period.end)?).ok_or(advice)?,
    );
    let (first_month, last_month) = ((start.year(), start.month()), (last.year(), last.month()));
    if first_month == last_month {
        return Period::month(first_month.0, first_month.1)
            .map(Period::seconds)
            .map_err(|e| e.to_string());
    }
    let is_month_start = |t: chrono::DateTime<chrono::Utc>| {
        NaiveDate::from_ymd_opt(t.year(), t.month(), 1).and_then(|d| d.and_hms_opt(0, 0, 0))
            == Some(t.naive_utc())
    };
    if is_month_start(start) && is_month_start(instant(period.end)?) {
        let count =
            (last_month.0 - first_month.0) * 12 + last_month.1 as i32 - first_month.1 as i32 + 1;
        return Ok(period.seconds() / f64::from(count));
    }
    Err(advice.to_owned())
}

#[cfg(test)]
mod tests;
