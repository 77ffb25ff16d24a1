//! How a product was computed from others: enough to compute it again, and to cite it.

mod map_request;

use std::fmt::{Display, Formatter};
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::ContractError;
use crate::analysis::{CorrelationStatistic, MapStatistic};
use crate::manifest::ManifestId;
use crate::region::KeptRegion;
use crate::time::{TimeMs, TimeStep};

pub use map_request::MapRequest;

/// A computation and what it read.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Computed {
    /// What was done.
    pub how: Computation,
    /// What with; at least one.
    pub inputs: Vec<ComputedInput>,
    /// First instant that was asked for; the first of the inputs if none was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from: Option<TimeMs>,
    /// First instant after the period that was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to: Option<TimeMs>,
    /// What else a statistic of every cell was asked with; absent of all else, and of correlations of before it was kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub map: Option<MapRequest>,
}

impl Computed {
    /// Is it made anew by itself when there is a newer version of what it was made of?
    pub fn follows(&self) -> bool {
        let is_kept = |map: &MapRequest| map.region.as_ref().is_none_or(KeptRegion::is_whole);
        let map = self.map.as_ref();
        self.how.is_by_step() || map.is_some_and(|map| is_kept(map) && !map.once)
    }
}

/// What is done in every cell, of every step or over all of them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Computation {
    /// Arithmetic over the inputs by name.
    Expression {
        /// SQL's expressions, with the functions of `fluxglobe derive functions`.
        expression: String,
    },
    /// The one input brought to another grid.
    Regrid {
        /// How.
        method: Regridding,
        /// Least share of a cell that must be covered by data, 0 to 1.
        min_coverage: f64,
    },
    /// How the two inputs go together over time: one step of all of theirs.
    Correlation {
        /// What of it.
        statistic: CorrelationStatistic,
        /// Steps that the second is read after the first.
        lag_steps: i32,
        /// Means that it is made of.
        step: TimeStep,
        /// Was the mean of each calendar month taken off both first?
        deseasonalised: bool,
        /// Share of the pairs that there could be that a cell must have, percent.
        least_percent: u8,
    },
    /// A statistic over time of the one input: all of its steps make one of the result, or the few of a year, or, of anomalies, all.
    Statistic {
        /// Which.
        statistic: MapStatistic,
        /// Means that a trend is drawn through.
        step: TimeStep,
        /// Share of the time, or of a bin's steps, that must hold data for a cell to have a value, percent.
        least_percent: u8,
    },
}

impl Computation {
    /// The statistic over time that it is of one input; none of anything else.
    pub fn statistic(&self) -> Option<MapStatistic> {
        match self {
            Self::Statistic { statistic, .. } => Some(*statistic),
            Self::Expression { .. } | Self::Regrid { .. } | Self::Correlation { .. } => None,
        }
    }

    /// Is a step of the result made of one step of each input, so that it is computed again when one changes?
    pub fn is_by_step(&self) -> bool {
        match self {
            Self::Expression { .. } | Self::Regrid { .. } => true,
            Self::Correlation { .. } | Self::Statistic { .. } => false,
        }
    }
}

/// How values are brought from one grid to another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Regridding {
    /// The cell that holds the centre.
    Nearest,
    /// Between the centres of four cells, linear in latitude and longitude.
    Bilinear,
    /// The mean over the cell, by exact area of overlap on WGS84: integrals stay what they are.
    Conservative,
}

impl Regridding {
    /// Every method.
    pub const ALL: [Self; 3] = [Self::Nearest, Self::Bilinear, Self::Conservative];
}

impl Display for Regridding {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Nearest => "nearest",
            Self::Bilinear => "bilinear",
            Self::Conservative => "conservative",
        })
    }
}

impl FromStr for Regridding {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let found = Self::ALL.into_iter().find(|it| it.to_string() == s);
        found.ok_or_else(|| {
            let valid = "use nearest, bilinear or conservative";
            ContractError::invalid("method of regridding", s, valid)
        })
    }
}

/// A product that was read, under the name that it has in an expression.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ComputedInput {
    /// Name.
    pub name: String,
    /// The version that was read.
    pub manifest: ManifestId,
    /// Which of its steps belongs to a step of the result.
    #[serde(default, skip_serializing_if = "Matching::is_same_period")]
    pub matching: Matching,
}

/// Which step of an input belongs to a period.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Matching {
    /// That of the very same period.
    #[default]
    SamePeriod,
    /// The one that holds all of it: a month for each of its days.
    Containing,
    /// That of the same month of the one year that the input has: a climatology.
    MonthOfYear,
    /// The one step that there is, at any time: a mask.
    AnyTime,
}

impl Matching {
    #[expect(clippy::trivially_copy_pass_by_ref, reason = "serde calls it so")]
    fn is_same_period(&self) -> bool {
        *self == Self::SamePeriod
    }
}

impl FromStr for Matching {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        match s {
            "same-period" => Ok(Self::SamePeriod),
            "containing" => Ok(Self::Containing),
            "climatology" => Ok(Self::MonthOfYear),
            "any-time" => Ok(Self::AnyTime),
            _ => {
                let valid = "use same-period, containing (its months hold in all of their days), climatology (its one year holds in every year) \
                             or any-time (its one step holds always)";
                Err(ContractError::invalid("matching of periods", s, valid))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bytes that are stored in manifests.
    #[test]
    fn stored_bytes_are_read_and_written_alike() {
        let json = r#"{"how":{"kind":"expression","expression":"a * 2"},"inputs":[{"name":"a","manifest":"p@1-00000000"},{"name":"b","manifest":"q@2-00000000","matching":"month_of_year"}]}"#;
        let computed: Computed = serde_json::from_str(json).unwrap();
        assert_eq!(serde_json::to_string(&computed).unwrap(), json);
        let json = r#"{"how":{"kind":"regrid","method":"conservative","min_coverage":0.5},"inputs":[{"name":"p","manifest":"p@1-00000000"}]}"#;
        let computed: Computed = serde_json::from_str(json).unwrap();
        assert_eq!(serde_json::to_string(&computed).unwrap(), json);
        let json = r#"{"how":{"kind":"correlation","statistic":"p_value","lag_steps":-2,"step":"month","deseasonalised":true,"least_percent":50},"inputs":[{"name":"first","manifest":"p@1-00000000"},{"name":"second","manifest":"q@2-00000000"}],"from":"2001-01-01T00:00:00Z"}"#;
        let computed: Computed = serde_json::from_str(json).unwrap();
        assert_eq!(serde_json::to_string(&computed).unwrap(), json);
        assert!(!computed.how.is_by_step());
        // Of before the rest of a request was kept.
        assert!(computed.map.is_none() && !computed.follows());
        let json = r#"{"how":{"kind":"correlation","statistic":"coefficient","lag_steps":0,"step":"month","deseasonalised":false,"least_percent":50},"inputs":[{"name":"first","manifest":"p@1-00000000"},{"name":"second","manifest":"q@2-00000000"}],"map":{"bins":"month"}}"#;
        let computed: Computed = serde_json::from_str(json).unwrap();
        assert_eq!(serde_json::to_string(&computed).unwrap(), json);
        assert!(computed.follows());
        let json = r#"{"how":{"kind":"statistic","statistic":"p97.5","step":"year","least_percent":80},"inputs":[{"name":"source","manifest":"p@1-00000000"}],"to":"2001-01-01T00:00:00Z","map":{"base":"1991/2020","bins":"season","region":{"name":"here","shape":{"box":"0,1,2,3"}},"once":true}}"#;
        let mut computed: Computed = serde_json::from_str(json).unwrap();
        assert_eq!(serde_json::to_string(&computed).unwrap(), json);
        assert!(!computed.how.is_by_step() && !computed.follows());
        let map = computed.map.as_mut().unwrap();
        map.once = false;
        assert!(computed.follows());
        // The region has too many corners to have been kept.
        let map = computed.map.as_mut().unwrap();
        map.region = serde_json::from_str(r#"{"name":"here"}"#).unwrap();
        assert!(!computed.follows());
    }

    #[test]
    fn methods_are_read_as_they_are_written() {
        for method in Regridding::ALL {
            assert_eq!(method.to_string().parse::<Regridding>().unwrap(), method);
        }
        assert!("cubic".parse::<Regridding>().is_err());
        assert!("monthly".parse::<Matching>().is_err());
        assert_eq!("climatology".parse(), Ok(Matching::MonthOfYear));
        assert_eq!("containing".parse(), Ok(Matching::Containing));
    }
}
