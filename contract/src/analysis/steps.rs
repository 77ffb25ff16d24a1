//! What two series are compared in, and what a trend is drawn through: steps as they are, or means of months or years.

use std::fmt::{Display, Formatter};
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::ContractError;

/// Length of the means that values are gathered in first.
#[derive(
    Debug,
    Clone,
    Copy,
    PartialEq,
    Eq,
    Hash,
    PartialOrd,
    Ord,
    Default,
    Serialize,
    Deserialize,
    ToSchema,
)]
#[serde(rename_all = "lowercase")]
pub enum MeanStep {
    /// Steps as they are.
    Native,
    /// Calendar months.
    #[default]
    Month,
    /// Calendar years.
    Year,
}

impl MeanStep {
    /// All of them, in the order they are offered.
    pub const ALL: [Self; 3] = [Self::Native, Self::Month, Self::Year];

    /// Name on the command line and in addresses.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Native => "native",
            Self::Month => "month",
            Self::Year => "year",
        }
    }
}

impl Display for MeanStep {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.as_str())
    }
}

impl FromStr for MeanStep {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let named = Self::ALL.into_iter().find(|step| step.as_str() == s);
        named.ok_or_else(|| ContractError::invalid("step", s, "native, month or year"))
    }
}
