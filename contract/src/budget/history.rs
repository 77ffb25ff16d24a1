//! One budget over the versions of its product: what was known when, and what changed it.

use std::str::FromStr;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::ContractError;
use crate::manifest::{AskedVersion, ManifestId};
use crate::product::ProductId;
use crate::time::TimeMs;

/// Which version is asked for: the one of a name, or the newest of an instant.
#[derive(Debug, Clone, PartialEq)]
pub enum AsOf {
    /// By its name, with or without its digest.
    Version(AskedVersion),
    /// The newest that was published then.
    Instant(TimeMs),
}

impl FromStr for AsOf {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        if s.contains('@') {
            return s.parse().map(Self::Version);
        }
        s.parse().map(Self::Instant).map_err(|_no_time| {
            let reason = "use an instant such as 2026-03-01, which is its first moment (UTC), or a version as answers name \
                          it, such as takahashi09-flux@12 or takahashi09-flux@12-0a1b2c3d";
            ContractError::invalid("version", s, reason)
        })
    }
}

impl AsOf {
    /// What is said where the first version that is kept is younger.
    pub fn before_first(product: &ProductId, instant: TimeMs, first: TimeMs) -> ContractError {
        let reason =
            format!("the first version of {product} that is kept was published at {first}");
        ContractError::invalid("version as of", &instant.to_string(), reason)
    }

    /// What is said where the version of then is gone, and an older one, of this number, is kept.
    pub fn gone(product: &ProductId, instant: TimeMs, older: u64) -> ContractError {
        let reason = format!(
            "the version of {product} of then is not kept any more; of those before it version {older} is, and may be asked for by its number"
        );
        ContractError::invalid("version as of", &instant.to_string(), reason)
    }
}

/// The same budget by the versions of a product that changed it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct BudgetHistory {
    /// Product.
    pub product: ProductId,
    /// The region by its name, or as `west,south,east,north`.
    pub region: String,
    /// Unit of `budget_tg` and `difference_tg`, `Tg C`.
    pub unit: String,
    /// Versions that are kept, whether they changed the budget or not.
    pub version_count: u64,
    /// What to know of the dates, and of what is the newest in all rows.
    pub notes: Vec<String>,
    /// The first version that is kept, and each one that changed what the question reads, oldest first.
    pub versions: Vec<VersionBudget>,
}

/// The budget by one version.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct VersionBudget {
    /// The version.
    #[schema(value_type = String)]
    pub manifest: ManifestId,
    /// When it was written to the store.
    pub published: TimeMs,
    /// What it changed of what the question reads, in words.
    pub changed: String,
    /// Steps in the period that the version before did not have.
    pub steps_added: u64,
    /// Steps whose values it replaced.
    pub steps_replaced: u64,
    /// Steps that it has no more.
    pub steps_removed: u64,
    /// First instant of the period; none where it holds no step in it.
    #[schema(required)]
    pub start: Option<TimeMs>,
    /// First instant after it.
    #[schema(required)]
    pub end: Option<TimeMs>,
    /// Carbon that left the sea, kg, exact, as decimal text; none where it holds no step in the period.
    #[schema(required)]
    pub budget_kg: Option<String>,
    /// The same in Tg.
    #[schema(required)]
    pub budget_tg: Option<f64>,
    /// One standard error of it, Tg, if uncertainty was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub sigma_tg: Option<f64>,
    /// How far it is from the one before, Tg; none of the first.
    #[schema(required)]
    pub difference_tg: Option<f64>,
    /// Share of the region's sea and of the period that holds data, percent.
    #[schema(required)]
    pub coverage_percent: Option<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_version_is_named_or_dated() {
        let of = |text: &str| text.parse::<AsOf>();
        for name in ["p@3-56d19b9b", "p@3"] {
            assert_eq!(of(name), Ok(AsOf::Version(name.parse().unwrap())));
        }
        let day = "2026-03-01T00:00:00Z".parse().unwrap();
        assert_eq!(of("2026-03-01"), Ok(AsOf::Instant(day)));
        for bad in ["", "3", "p@", "p@x", "p@3-56", "yesterday"] {
            let refused = of(bad).unwrap_err().to_string();
            assert!(refused.contains('@'), "{bad}: {refused}");
        }
    }
}
