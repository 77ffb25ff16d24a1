//! What is said of how two products go together in a cell, by name.

use serde::{Deserialize, Serialize};

/// What is said of the correlation of two products in a cell: a number of what is said of two series.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CorrelationStatistic {
    /// Pearson's.
    Coefficient,
    /// Chance of one as far from none where there is none, by the effective pairs.
    PValue,
    /// Pairs of values.
    Pairs,
    /// Pairs that are worth one of their own, as autocorrelation leaves them.
    EffectivePairs,
}

impl CorrelationStatistic {
    /// Name on the command line.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Coefficient => "correlation",
            Self::PValue => "correlation-p-value",
            Self::Pairs => "correlation-pairs",
            Self::EffectivePairs => "correlation-effective-pairs",
        }
    }
}
