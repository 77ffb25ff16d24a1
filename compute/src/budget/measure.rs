//! What is summed over the cells of a region.

use contract::time::Period;
use serde::{Deserialize, Serialize};

/// What is summed over cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Measure {
    /// Flux x area x time: a mass, kg.
    Mass,
    /// Value x area: what a mean is made of.
    Mean,
}

impl Measure {
    /// What values of a step are multiplied with besides the area. Of the whole step: parts of it are shared out afterwards, exactly.
    pub(crate) fn seconds(self, period: Period) -> f64 {
        match self {
            Self::Mass => period.seconds(),
            Self::Mean => 1.0,
        }
    }
}
