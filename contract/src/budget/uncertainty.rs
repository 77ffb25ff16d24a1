//! How uncertain a budget is: standard errors of the flux and how far they go together, as people state them and as answers
//! spell what they come to.

use std::str::FromStr;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::ContractError;
use crate::manifest::{Manifest, ManifestId};
use crate::product::ProductId;

/// Longest correlation length, km: beyond, everything goes together as it is.
const MAX_LENGTH_KM: f64 = 1e6;
/// Longest correlation time, days.
const MAX_DAYS: f64 = 1e6;
/// Most draws of a Monte Carlo.
const MAX_DRAWS: u32 = 10_000;
/// Fewest: below, the spread of the draws says little.
const MIN_DRAWS: u32 = 10;

/// Standard error of a flux as somebody states it: `20%`, `0.3 mol m-2 year-1`, or the product that holds it.
#[derive(Debug, Clone, PartialEq)]
pub enum StatedError {
    /// Share of the size of the flux, percent.
    Relative {
        /// Percent.
        percent: f64,
    },
    /// The same wherever and whenever there is a flux.
    Absolute {
        /// In its unit.
        value: f64,
        /// As it was written.
        unit: String,
    },
    /// A product of standard errors on the grid of the flux.
    Product(ProductId),
}

impl FromStr for StatedError {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let bad = |reason: &str| Err(ContractError::invalid("error", s, reason));
        let text = s.trim();
        if text.starts_with(|c: char| c.is_ascii_alphabetic()) {
            return text.parse().map(Self::Product);
        }
        let Some((value, unit)) = number_and_unit(text) else {
            return bad("use 20%, a number with its unit such as 0.3 mol m-2 year-1, or a product");
        };
        if !value.is_finite() || value < 0.0 {
            return bad("a standard error is a finite number, 0 or above");
        }
        match unit {
            "" => bad("say % of the flux, or a unit: 20%, 0.3 mol m-2 year-1"),
            "%" => Ok(Self::Relative { percent: value }),
            unit => Ok(Self::Absolute {
                value,
                unit: unit.to_owned(),
            }),
        }
    }
}

/// The number that a text begins with and what follows it.
fn number_and_unit(text: &str) -> Option<(f64, &str)> {
    let is_of_number = |(at, c): (usize, char)| {
        let is_exponent = matches!(c, 'e' | 'E')
            && text[at + 1..].starts_with(|c: char| c.is_ascii_digit() || c == '-' || c == '+');
        let is_sign = matches!(c, '+' | '-') && (at == 0 || text[..at].ends_with(['e', 'E']));
        c.is_ascii_digit() || c == '.' || is_exponent || is_sign
    };
    let end = text
        .char_indices()
        .find(|(at, c)| !is_of_number((*at, *c)))
        .map_or(text.len(), |(at, _)| at);
    let value = text[..end].parse().ok()?;
    Some((value, text[end..].trim()))
}

impl std::fmt::Display for StatedError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Relative { percent } => write!(f, "{percent} % of the flux"),
            Self::Absolute { value, unit } => write!(f, "{value} {unit}"),
            Self::Product(product) => f.write_str(product.as_str()),
        }
    }
}

/// What is asked about uncertainty, as words and numbers come from a command line or an address.
#[derive(Debug, Clone, Copy, Default)]
pub struct ErrorWords<'a> {
    /// `20%`, a number with its unit, or a product.
    pub error: Option<&'a str>,
    /// Correlation length, km.
    pub correlation_length_km: Option<f64>,
    /// Correlation time, days.
    pub correlation_days: Option<f64>,
    /// Draws of a Monte Carlo.
    pub monte_carlo: Option<u32>,
    /// What its random numbers follow from.
    pub seed: Option<u64>,
}

impl ErrorWords<'_> {
    /// The question; none if nothing is asked.
    ///
    /// # Errors
    /// Words that do not belong together, or numbers out of their limits.
    pub fn asked(&self) -> Result<Option<BudgetErrors>, ContractError> {
        let Some(error) = self.error else {
            let words = [
                ("correlation length", self.correlation_length_km.is_some()),
                ("correlation days", self.correlation_days.is_some()),
                ("Monte Carlo", self.monte_carlo.is_some()),
            ];
            return match words.iter().find(|(_, is_given)| *is_given) {
                Some((what, _)) => {
                    let reason = "it says how errors go together: give the error too";
                    Err(ContractError::invalid(what, "", reason))
                }
                None => self.without_draws().map(|()| None),
            };
        };
        let Some(length_km) = self.correlation_length_km else {
            let reason = "how far do errors go together? Give it beside the error, in km (--correlation-length-km, correlation_length_km=); 0 if each cell's is its own";
            return Err(ContractError::invalid("correlation length", "", reason));
        };
        let within = |what, value: f64, most: f64, unit: &str| {
            if (0.0..=most).contains(&value) {
                return Ok(value);
            }
            let reason = format!("0 to {most} {unit}; 0 where errors do not go together");
            Err(ContractError::invalid(what, &value.to_string(), reason))
        };
        let days = self.correlation_days.unwrap_or(0.0);
        let monte_carlo = match self.monte_carlo {
            None => self.without_draws().map(|()| None)?,
            Some(draws) if (MIN_DRAWS..=MAX_DRAWS).contains(&draws) => Some(MonteCarlo {
                draws,
                seed: self.seed.unwrap_or(0),
            }),
            Some(draws) => {
                let reason = format!("{MIN_DRAWS} to {MAX_DRAWS} draws");
                return Err(ContractError::invalid(
                    "Monte Carlo",
                    &draws.to_string(),
                    reason,
                ));
            }
        };
        Ok(Some(BudgetErrors {
            stated: error.parse()?,
            of_product: None,
            length_km: within("correlation length", length_km, MAX_LENGTH_KM, "km")?,
            days: within("correlation days", days, MAX_DAYS, "days")?,
            monte_carlo,
        }))
    }

    fn without_draws(&self) -> Result<(), ContractError> {
        match self.seed {
            Some(seed) => Err(ContractError::invalid(
                "seed",
                &seed.to_string(),
                "it belongs to a Monte Carlo: give the number of draws too",
            )),
            None => Ok(()),
        }
    }
}

/// Standard errors of a flux and how they go together: rho = exp(-d / length) exp(-t / days), d along great circles, t between the
/// middles of steps.
#[derive(Debug, Clone, PartialEq)]
pub struct BudgetErrors {
    /// As it was stated.
    pub stated: StatedError,
    /// The version of the product that is stated; whoever asks looks it up ([`Self::product`]).
    pub of_product: Option<Arc<Manifest>>,
    /// Correlation length, km; 0 where each cell's error is its own.
    pub length_km: f64,
    /// Correlation time, days; 0 where each step's error is its own.
    pub days: f64,
    /// Draws besides, as a check and for percentiles.
    pub monte_carlo: Option<MonteCarlo>,
}

impl BudgetErrors {
    /// The product whose newest version is to be looked up.
    pub fn product(&self) -> Option<&ProductId> {
        match &self.stated {
            StatedError::Product(product) => Some(product),
            StatedError::Relative { .. } | StatedError::Absolute { .. } => None,
        }
    }

    /// All that an answer depends on, for keys of answers.
    pub fn key(&self) -> impl Serialize + use<> {
        let draws = self.monte_carlo.map(|own| (own.draws, own.seed));
        let product = self.of_product.as_ref().map(|own| own.id());
        let bits = [self.length_km, self.days].map(f64::to_bits);
        (self.stated.to_string(), product, bits, draws)
    }
}

/// How many random errors are drawn, and from what.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MonteCarlo {
    /// Number of draws.
    pub draws: u32,
    /// The same seed draws the same errors.
    pub seed: u64,
}

/// How the uncertainty of a budget was reckoned.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct BudgetUncertainty {
    /// The standard error of the flux, as it was stated.
    pub error: String,
    /// The version of the product that holds it; none of a stated one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<String>, nullable = false)]
    pub manifest: Option<ManifestId>,
    /// Correlation length, km; 0: each cell's error is its own.
    pub correlation_length_km: f64,
    /// Correlation time, days; 0: each step's error is its own.
    pub correlation_days: f64,
    /// How the sum over pairs of cells was taken.
    pub scheme: String,
    /// What is assumed.
    pub assumptions: Vec<String>,
    /// Number of draws of the Monte Carlo; none if nothing was drawn.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub draws: Option<u32>,
    /// What its random numbers follow from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub seed: Option<u64>,
}

/// How uncertain the budget of one row is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RowUncertainty {
    /// One standard error of the budget, Tg.
    pub sigma_tg: f64,
    /// What it would be if no two cells or steps had an error in common, Tg.
    pub uncorrelated_tg: f64,
    /// What it would be if all cells and steps had one error in common, Tg.
    pub fully_correlated_tg: f64,
    /// Share of the area and time with a flux that has an error too, percent; what has none adds nothing to sigma.
    pub error_coverage_percent: f64,
    /// The same from random errors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub monte_carlo: Option<RowDraws>,
}

/// Budgets of one row with random errors added.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RowDraws {
    /// Standard deviation of the budgets, Tg.
    pub sigma_tg: f64,
    /// Its own standard error, by the number of draws, Tg.
    pub sigma_error_tg: f64,
    /// The budget that 2.5 % of the draws are below, Tg.
    pub p2_5_tg: f64,
    /// The budget that 97.5 % of the draws are below, Tg.
    pub p97_5_tg: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_shares_numbers_with_units_or_products() {
        let of = |text: &str| text.parse::<StatedError>();
        assert_eq!(of("20%"), Ok(StatedError::Relative { percent: 20.0 }));
        assert_eq!(of(" 7.5 % "), Ok(StatedError::Relative { percent: 7.5 }));
        let absolute = |value, unit: &str| {
            Ok(StatedError::Absolute {
                value,
                unit: unit.to_owned(),
            })
        };
        assert_eq!(of("0.3 mol m-2 year-1"), absolute(0.3, "mol m-2 year-1"));
        assert_eq!(of("1e-9kg m-2 s-1"), absolute(1e-9, "kg m-2 s-1"));
        let product = StatedError::Product("somffn-error".parse().unwrap());
        assert_eq!(of("somffn-error"), Ok(product));
        for (text, wanted) in [
            ("20", "say %"),
            ("-5%", "0 or above"),
            ("1e999%", "0 or above"),
            ("", "use 20%"),
            ("%", "use 20%"),
            ("..5%", "use 20%"),
            ("No Product", "a-z"),
        ] {
            let refused = of(text).unwrap_err().to_string();
            assert!(refused.contains(wanted), "{text}: {refused}");
        }
    }

    #[test]
    fn words_that_do_not_belong_together_are_refused() {
        let asked = ErrorWords {
            error: Some("20%"),
            correlation_length_km: Some(500.0),
            ..ErrorWords::default()
        };
        let own = asked.asked().unwrap().unwrap();
        assert!(own.days.abs() < f64::EPSILON && own.monte_carlo.is_none());
        assert_eq!(ErrorWords::default().asked(), Ok(None));
        let draws = |draws| ErrorWords {
            monte_carlo: Some(draws),
            ..asked
        };
        for (words, wanted) in [
            (
                ErrorWords {
                    error: None,
                    ..asked
                },
                "give the error",
            ),
            (
                ErrorWords {
                    correlation_length_km: None,
                    ..asked
                },
                "correlation length",
            ),
            (
                ErrorWords {
                    correlation_length_km: Some(-1.0),
                    ..asked
                },
                "0 to 1000000 km",
            ),
            (
                ErrorWords {
                    correlation_length_km: Some(f64::NAN),
                    ..asked
                },
                "0 to 1000000 km",
            ),
            (
                ErrorWords {
                    correlation_days: Some(-0.5),
                    ..asked
                },
                "days",
            ),
            (
                ErrorWords {
                    seed: Some(1),
                    ..asked
                },
                "number of draws",
            ),
            (
                ErrorWords {
                    seed: Some(1),
                    ..ErrorWords::default()
                },
                "number of draws",
            ),
            (draws(9), "10 to 10000"),
            (draws(10_001), "10 to 10000"),
        ] {
            let refused = words.asked().unwrap_err().to_string();
            assert!(refused.contains(wanted), "{words:?}: {refused}");
        }
    }
}
