//! The part of a net flux that rivers account for: carbon that they bring into the sea and that leaves it to the air again, which
//! is none of what people added.

use std::str::FromStr;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::ContractError;
use crate::manifest::{Manifest, ManifestId};
use crate::product::ProductId;

/// Largest flux that is taken, Tg a year: some hundred times what any estimate says.
const MAX_TG_PER_YEAR: f64 = 1e5;
/// Longest source, bytes.
const MAX_SOURCE_BYTES: usize = 300;

/// Outgassing of river carbon as somebody states it.
#[derive(Debug, Clone, PartialEq)]
pub enum StatedRiver {
    /// Of the whole region, at all times alike.
    Rate {
        /// Tg of carbon a year of 365.25 days, positive out of the sea.
        tg_per_year: f64,
        /// Its standard error, Tg a year, if one is stated.
        sigma_tg_per_year: Option<f64>,
    },
    /// A carbon flux, summed over the same region and time.
    Product(ProductId),
}

impl FromStr for StatedRiver {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let bad = || {
            let reason = format!(
                "use Tg of carbon a year out of the sea, at most {MAX_TG_PER_YEAR} either way, such as 650 or 650+-300, or a product"
            );
            ContractError::invalid("river flux", s, reason)
        };
        let text = s.trim();
        if text.starts_with(|c: char| c.is_ascii_alphabetic()) {
            return text.parse().map(Self::Product);
        }
        let number = |text: &str| {
            let value: f64 = text.trim().parse().map_err(|_no_number| bad())?;
            (value.abs() <= MAX_TG_PER_YEAR)
                .then_some(value)
                .ok_or_else(bad)
        };
        let parts = text.split_once("+-").or_else(|| text.split_once('±'));
        let Some((rate, sigma)) = parts else {
            return Ok(Self::Rate {
                tg_per_year: number(text)?,
                sigma_tg_per_year: None,
            });
        };
        Ok(Self::Rate {
            tg_per_year: number(rate)?,
            sigma_tg_per_year: Some(number(sigma).ok().filter(|s| *s >= 0.0).ok_or_else(bad)?),
        })
    }
}

/// Outgassing of river carbon that is taken off a budget.
#[derive(Debug, Clone, PartialEq)]
pub struct AskedRiver {
    /// As it was stated.
    pub stated: StatedRiver,
    /// Where the number is from, in the asker's words; a product has its own.
    pub source: Option<String>,
    /// The version of the product that is stated; whoever asks looks it up ([`Self::product`]).
    pub of_product: Option<Arc<Manifest>>,
}

impl AskedRiver {
    /// The question of words; none if there are none.
    ///
    /// # Errors
    /// No valid words, a number without a source, a source without a number.
    pub fn asked(flux: Option<&str>, source: Option<&str>) -> Result<Option<Self>, ContractError> {
        let source = source.map(str::trim).filter(|source| !source.is_empty());
        let Some(flux) = flux else {
            return match source {
                Some(source) => Err(ContractError::invalid(
                    "river source",
                    source,
                    "it is that of a river flux: give that too",
                )),
                None => Ok(None),
            };
        };
        let stated: StatedRiver = flux.parse()?;
        match (&stated, source) {
            (StatedRiver::Rate { .. }, None) => Err(ContractError::invalid(
                "river flux",
                flux,
                "say where the number is from: give the river source too",
            )),
            (StatedRiver::Product(_), Some(source)) => Err(ContractError::invalid(
                "river source",
                source,
                "a product has a source of its own: leave it out",
            )),
            (_, Some(source))
                if source.len() > MAX_SOURCE_BYTES || source.chars().any(char::is_control) =>
            {
                let reason = format!("one line of at most {MAX_SOURCE_BYTES} bytes");
                Err(ContractError::invalid("river source", source, reason))
            }
            (_, source) => Ok(Some(Self {
                source: source.map(str::to_owned),
                stated,
                of_product: None,
            })),
        }
    }

    /// The product whose newest version is to be looked up.
    pub fn product(&self) -> Option<&ProductId> {
        match &self.stated {
            StatedRiver::Product(product) => Some(product),
            StatedRiver::Rate { .. } => None,
        }
    }

    /// All that an answer depends on, for keys of answers.
    pub fn key(&self) -> impl Serialize + use<> {
        let bits = match &self.stated {
            StatedRiver::Rate {
                tg_per_year,
                sigma_tg_per_year,
            } => Some((tg_per_year.to_bits(), sigma_tg_per_year.map(f64::to_bits))),
            StatedRiver::Product(_) => None,
        };
        let product = self.of_product.as_ref().map(|own| own.id());
        (bits, product, self.source.clone())
    }
}

/// The river flux that was taken off, and where it is from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RiverFlux {
    /// Where it is from, in the words of who asked, or as its product cites it.
    pub source: String,
    /// Tg of carbon a year of 365.25 days, positive out of the sea; none of a product.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub tg_per_year: Option<f64>,
    /// Its standard error, Tg a year, if one was stated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub sigma_tg_per_year: Option<f64>,
    /// The version of the product that was summed; none of a number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<String>, nullable = false)]
    pub manifest: Option<ManifestId>,
    /// What the rows hold.
    pub meaning: String,
}

/// A row less the river flux.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RowRiver {
    /// Outgassing of river carbon in the row's time, Tg.
    pub river_tg: f64,
    /// The budget less that, Tg: of a net flux of today the anthropogenic part.
    pub anthropogenic_tg: f64,
    /// One standard error of it, Tg: that of the budget and that of the river flux, if it has one, as independent. None where that
    /// of the budget was not asked for.
    #[schema(required)]
    pub sigma_tg: Option<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_river_flux_is_a_number_with_a_source_or_a_product() {
        let of = |flux, source| AskedRiver::asked(Some(flux), source);
        let rate = |tg_per_year, sigma_tg_per_year| StatedRiver::Rate {
            tg_per_year,
            sigma_tg_per_year,
        };
        let source = Some("Regnier et al. (2022)");
        let stated = |flux| of(flux, source).unwrap().unwrap().stated;
        assert_eq!(stated("650"), rate(650.0, None));
        assert_eq!(stated("650+-300"), rate(650.0, Some(300.0)));
        assert_eq!(stated("-10 ± 2.5"), rate(-10.0, Some(2.5)));
        let product = of("rivers", None).unwrap().unwrap();
        assert_eq!(product.product().unwrap().as_str(), "rivers");
        assert_eq!(AskedRiver::asked(None, None), Ok(None));
        for (flux, source, wanted) in [
            (Some("650"), None, "where the number is from"),
            (Some("650"), Some("  "), "where the number is from"),
            (Some("650+-x"), source, "650+-300"),
            (Some("650+--1"), source, "650+-300"),
            (Some("nan"), source, "leave it out"),
            (Some("1e9"), source, "at most"),
            (Some("rivers"), source, "leave it out"),
            (None, source, "give that too"),
            (Some("1"), Some("a\nb"), "one line"),
        ] {
            let refused = AskedRiver::asked(flux, source).unwrap_err().to_string();
            assert!(refused.contains(wanted), "{flux:?}: {refused}");
        }
    }
}
