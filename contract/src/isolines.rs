//! Isolines of the quantity that a picture draws: which values have a line. In words `auto`, or the difference of
//! neighbouring lines; in a job the stored numbers.

use std::fmt::{Display, Formatter};
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::ContractError;
use crate::colour::{Scale, TransferFunction};
use crate::quantity::Quantity;

/// Most lines over a range of colours: more could not be told apart.
pub const MOST_ISOLINES: usize = 50;
/// Lines over a range of colours that are aimed at where nobody says how far apart they are.
const USUAL_LINES: f64 = 12.0;
/// Steps that are round, times a power of ten.
const ROUND: [f64; 4] = [1.0, 2.0, 5.0, 10.0];
/// Of a step: ends of a range that are as near to a line have it.
const NEAR: f64 = 1e-9;
/// Largest multiple of a step that is a line: beyond, multiples and their sums would be rounded.
const MOST_MULTIPLE: f64 = 1e9;
/// Where lines lie between powers of ten on a logarithmic scale, and which of them are wider.
const IN_A_DECADE: [(f64, bool); 2] = [(1.0, true), (3.0, false)];

/// Which isolines somebody asks for, in the unit people read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum IsolineWish {
    /// Round values, about a dozen; 1 and 3 of every power of ten on a logarithmic scale.
    Auto,
    /// All multiples of this.
    Every(f64),
}

/// The isolines of a job, stored unit: those whose values lie in the range of its colours.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Isolines {
    /// All multiples of a step, counted from what is shown as 0.
    Every {
        /// Stored value of what is shown as 0.
        #[serde(with = "crate::exact")]
        zero: f64,
        /// Difference of neighbouring lines, above 0.
        #[serde(with = "crate::exact")]
        step: f64,
    },
    /// 1 and 3 of every power of ten.
    Decades {
        /// Stored value of what is shown as 1, above 0.
        #[serde(with = "crate::exact")]
        one: f64,
    },
}

/// One isoline.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Isoline {
    /// Stored value.
    pub value: f64,
    /// Is it that of zero, or of a power of ten on a logarithmic scale? Such lines are wider.
    pub is_main: bool,
}

impl IsolineWish {
    /// The isolines of a quantity in the range of a valid transfer function.
    ///
    /// # Errors
    /// A step with more than [`MOST_ISOLINES`] lines in the range, or with none.
    pub fn within(
        self,
        quantity: Quantity,
        transfer: &TransferFunction,
    ) -> Result<Isolines, ContractError> {
        let display = quantity.display();
        let factor = display.factor.abs();
        let every = |shown: f64| Isolines::Every {
            zero: display.stored(0.0),
            step: shown / factor,
        };
        let isolines = match (self, transfer.scale) {
            (Self::Every(shown), _) => every(shown),
            (Self::Auto, Scale::Log) => Isolines::Decades {
                one: display.stored(1.0),
            },
            (Self::Auto, Scale::Linear) => every(round_step(
                (transfer.high - transfer.low) * factor / USUAL_LINES,
            )),
        };
        isolines.lines(transfer)?;
        Ok(isolines)
    }
}

/// The next round number that is not smaller.
fn round_step(rough: f64) -> f64 {
    let power = 10f64.powf(rough.log10().floor());
    let mut round = ROUND.iter().map(|factor| factor * power);
    round.find(|step| *step >= rough * 0.999).unwrap_or(rough)
}

impl Isolines {
    /// The lines in the range of a valid transfer function, rising: at least one.
    ///
    /// # Errors
    /// Numbers that mean nothing, more than [`MOST_ISOLINES`] lines in the range, or none.
    pub fn lines(&self, transfer: &TransferFunction) -> Result<Vec<Isoline>, ContractError> {
        let lines = match *self {
            Self::Every { zero, step } => multiples(zero, step, transfer)?,
            Self::Decades { one } => decades(one, transfer)?,
        };
        if lines.is_empty() {
            let reason = "no line lies in the range of colours; make the step smaller, or leave isolines out";
            return Err(ContractError::invalid("isolines", &self.text(), reason));
        }
        Ok(lines)
    }

    fn text(&self) -> String {
        match self {
            Self::Every { step, .. } => format!("{step:e} (stored unit)"),
            Self::Decades { one } => format!("decades of {one:e} (stored unit)"),
        }
    }
}

fn multiples(
    zero: f64,
    step: f64,
    transfer: &TransferFunction,
) -> Result<Vec<Isoline>, ContractError> {
    let bad = |reason: String| {
        let text = format!("{step:e} (stored unit)");
        Err(ContractError::invalid("isolines", &text, reason))
    };
    if !(step > 0.0 && step.is_finite() && zero.is_finite()) {
        return bad("their step is above 0".to_owned());
    }
    let first = ((transfer.low - zero) / step - NEAR).ceil();
    let last = ((transfer.high - zero) / step + NEAR).floor();
    let count = last - first + 1.0;
    if first.abs().max(last.abs()) > MOST_MULTIPLE && count <= MOST_ISOLINES as f64 {
        return bad("their step is too small for the values".to_owned());
    }
    if count.is_nan() || count > MOST_ISOLINES as f64 {
        return bad(format!(
            "they would be {count:.0} over the range of colours, at most {MOST_ISOLINES} are drawn; make their step larger"
        ));
    }
    let line = |i: u32| {
        let number = first + f64::from(i);
        Isoline {
            value: zero + number * step,
            is_main: number.abs() < 0.5,
        }
    };
    Ok((0..count.max(0.0) as u32).map(line).collect())
}

fn decades(one: f64, transfer: &TransferFunction) -> Result<Vec<Isoline>, ContractError> {
    let bad = |reason: &str| {
        let text = format!("decades of {one:e} (stored unit)");
        Err(ContractError::invalid("isolines", &text, reason))
    };
    if !(one > 0.0 && one.is_finite() && transfer.low > 0.0) {
        return bad("powers of ten are lines of a range above 0");
    }
    let decade = |value: f64| (value / one).log10().floor();
    let (first, last) = (decade(transfer.low * (1.0 - NEAR)), decade(transfer.high));
    if last - first >= MOST_ISOLINES as f64 / 2.0 {
        return bad("the range of colours has too many powers of ten; name a step");
    }
    let powers = (0..=(last - first) as u32).map(|i| 10f64.powf(first + f64::from(i)));
    let lines = powers.flat_map(|power| {
        IN_A_DECADE.map(|(figure, is_main)| Isoline {
            value: one * figure * power,
            is_main,
        })
    });
    let inside = transfer.low * (1.0 - NEAR)..=transfer.high * (1.0 + NEAR);
    Ok(lines.filter(|line| inside.contains(&line.value)).collect())
}

impl Display for IsolineWish {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Every(step) => step.fmt(f),
        }
    }
}

impl FromStr for IsolineWish {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        if s == "auto" {
            return Ok(Self::Auto);
        }
        let step = s.trim().parse().ok();
        let step = step.filter(|step: &f64| *step > 0.0 && step.is_finite());
        step.map(Self::Every).ok_or_else(|| {
            let reason =
                "auto, or the difference of neighbouring lines in the unit of the legend, above 0, such as 10";
            ContractError::invalid("isolines", s, reason)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::colour::{Palette, TransferOptions};

    /// Values of the lines as people read them, and which are wider.
    fn shown(wish: &str, quantity: Quantity, range: &str) -> Result<Vec<(f64, bool)>, String> {
        let options = TransferOptions {
            range: range.parse().ok(),
            ..TransferOptions::default()
        };
        let transfer = options.over(quantity).unwrap();
        let wish: IsolineWish = wish.parse().map_err(|e: ContractError| e.to_string())?;
        let isolines = wish
            .within(quantity, &transfer)
            .map_err(|e| e.to_string())?;
        let display = quantity.display();
        let lines = isolines.lines(&transfer).unwrap().into_iter();
        let round = |value: f64| (display.shown(value) * 1e6).round() / 1e6;
        Ok(lines
            .map(|line| (round(line.value), line.is_main))
            .collect())
    }

    fn values(wish: &str, quantity: Quantity, range: &str) -> Vec<f64> {
        let lines = shown(wish, quantity, range).unwrap();
        lines.into_iter().map(|(value, _)| value).collect()
    }

    #[test]
    fn lines_are_multiples_of_the_step_in_the_range_of_colours() {
        assert_eq!(
            shown("20", Quantity::CarbonFlux, "").unwrap(),
            [
                (-40.0, false),
                (-20.0, false),
                (0.0, true),
                (20.0, false),
                (40.0, false)
            ]
        );
        assert_eq!(
            values("10", Quantity::SeaSurfaceTemperature, ""),
            [0.0, 10.0, 20.0, 30.0]
        );
        assert_eq!(
            values("0.25", Quantity::WindSpeed, "1:1.6"),
            [1.0, 1.25, 1.5]
        );
    }

    #[test]
    fn lines_that_nobody_chose_are_round_and_few() {
        assert_eq!(values("auto", Quantity::CarbonFlux, "").len(), 9);
        for quantity in Quantity::ALL {
            let lines = values("auto", quantity, "");
            assert!((5..=16).contains(&lines.len()), "{quantity:?} {lines:?}");
        }
        assert_eq!(
            shown("auto", Quantity::Chlorophyll, "").unwrap(),
            [
                (0.03, false),
                (0.1, true),
                (0.3, false),
                (1.0, true),
                (3.0, false),
                (10.0, true)
            ]
        );
    }

    #[test]
    fn steps_that_mean_nothing_are_refused_with_what_would() {
        for text in ["", "0", "-5", "nan", "inf", "ten", "automatic", "1,2"] {
            let refused = shown(text, Quantity::CarbonFlux, "").unwrap_err();
            assert!(refused.contains("such as 10"), "{text}: {refused}");
        }
        let refused = shown("1", Quantity::CarbonFlux, "").unwrap_err();
        assert!(refused.contains("81 over the range"), "{refused}");
        assert!(shown("1e-300", Quantity::CarbonFlux, "").is_err());
        assert_eq!(
            values("1", Quantity::CarbonFlux, "-25:24").len(),
            MOST_ISOLINES
        );
        let refused = shown("50", Quantity::CarbonFlux, "5:40").unwrap_err();
        assert!(refused.contains("no line"), "{refused}");
    }

    #[test]
    fn numbers_from_outside_are_checked() {
        let transfer = TransferFunction::linear(Palette::Ice, 0.5, 2.0);
        for (zero, step) in [
            (0.0, 0.0),
            (0.0, -1.0),
            (f64::NAN, 1.0),
            (0.0, f64::NAN),
            (1e300, 1.0),
        ] {
            let isolines = Isolines::Every { zero, step };
            assert!(isolines.lines(&transfer).is_err(), "{zero} {step}");
        }
        for one in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(Isolines::Decades { one }.lines(&transfer).is_err(), "{one}");
        }
        let below = TransferFunction::linear(Palette::Ice, -0.5, 2.0);
        assert!(Isolines::Decades { one: 1.0 }.lines(&below).is_err());
        let wide = TransferFunction::linear(Palette::Ice, 1e-30, 2.0);
        assert!(Isolines::Decades { one: 1.0 }.lines(&wide).is_err());
    }

    #[test]
    fn a_job_says_its_lines_in_exact_numbers() {
        let isolines = Isolines::Every {
            zero: 0.0,
            step: 0.1,
        };
        let text = serde_json::to_string(&isolines).unwrap();
        assert_eq!(text, r#"{"every":{"zero":"0","step":"0.1"}}"#);
        assert_eq!(serde_json::from_str::<Isolines>(&text).unwrap(), isolines);
        let wish: IsolineWish = " 2.50".parse().unwrap();
        assert_eq!(wish.to_string(), "2.5");
        assert_eq!(IsolineWish::Auto.to_string().parse(), Ok(IsolineWish::Auto));
    }
}
