//! The statistics that can be asked for, by the names that people write.

use std::fmt::{Display, Formatter};
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::ContractError;

/// Most statistics of one question.
const MAX_STATISTICS: usize = 32;
/// Parts of a percent that a percentile is told in.
const PARTS: u32 = 1000;

/// A percentile, 0 to 100, to a thousandth of a percent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Percentile(u32);

impl Percentile {
    /// The 50th.
    pub const MEDIAN: Self = Self(50 * PARTS);

    /// Share of all weight that it has below it, as `(part, whole)`.
    pub fn share(self) -> (u32, u32) {
        (self.0, 100 * PARTS)
    }
}

impl FromStr for Percentile {
    type Err = ContractError;

    /// Parses `90` or `97.5`.
    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let bad = || {
            let reason = "a percentile is p0 to p100, with at most three decimals, such as p97.5";
            ContractError::invalid("statistic", &format!("p{s}"), reason)
        };
        let (whole, decimals) = s.split_once('.').unwrap_or((s, ""));
        let digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
        let is_written = !whole.is_empty()
            && whole.len() <= 3
            && decimals.len() <= 3
            && digits(whole)
            && digits(decimals)
            && s.contains('.') != decimals.is_empty();
        if !is_written {
            return Err(bad());
        }
        let number = |text: &str| text.parse::<u32>().map_err(|_no_number| bad());
        let parts = number(whole)? * PARTS + number(&format!("{decimals:0<3}"))?;
        (parts <= 100 * PARTS)
            .then_some(Self(parts))
            .ok_or_else(bad)
    }
}

impl Display for Percentile {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let (whole, rest) = (self.0 / PARTS, self.0 % PARTS);
        if rest == 0 {
            return write!(f, "{whole}");
        }
        let decimals = format!("{rest:03}");
        write!(f, "{whole}.{}", decimals.trim_end_matches('0'))
    }
}

/// A statistic of the values in a bin of time over a geometry. Weights are areas, lengths, or the shares of a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Statistic {
    /// Mean by weight and time.
    Mean,
    /// Integral over the geometry (value x area, or x length), mean over the time with data; of a point its value.
    Sum,
    /// Smallest value of any cell that has weight.
    Min,
    /// Largest value.
    Max,
    /// Standard deviation by weight and time, of the values as they are (the population): √(Σ w (x - m)² / Σ w), w weight times time. Its
    /// divisor is all weight, and not one less than a number of values, as that of a climatology's spread is.
    Std,
    /// The 50th percentile.
    Median,
    /// The smallest value that at least so much of the weight lies at or below.
    Percentile(Percentile),
    /// Values: cells times steps that hold data.
    Count,
    /// Share of the geometry and of the bin's time that holds data, percent.
    Coverage,
}

impl Statistic {
    /// The percentile that it is.
    pub fn percentile(self) -> Option<Percentile> {
        match self {
            Self::Median => Some(Percentile::MEDIAN),
            Self::Percentile(percentile) => Some(percentile),
            Self::Mean
            | Self::Sum
            | Self::Min
            | Self::Max
            | Self::Std
            | Self::Count
            | Self::Coverage => None,
        }
    }

    /// What it is, in a line.
    pub fn what(self) -> String {
        let what = match self {
            Self::Mean => "mean by weight and time",
            Self::Sum => "integral over the geometry, mean over the time with data",
            Self::Min => "smallest value of a cell",
            Self::Max => "largest value of a cell",
            Self::Std => "standard deviation by weight and time, of the population",
            Self::Median => "value with half of the weight at or below it",
            Self::Percentile(p) => {
                return format!("smallest value with at least {p} % of the weight at or below it");
            }
            Self::Count => "cells times steps that hold data",
            Self::Coverage => "share of the geometry and of time that holds data",
        };
        what.to_owned()
    }
}

impl Display for Statistic {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Mean => "mean",
            Self::Sum => "sum",
            Self::Min => "min",
            Self::Max => "max",
            Self::Std => "std",
            Self::Median => "median",
            Self::Percentile(percentile) => return write!(f, "p{percentile}"),
            Self::Count => "count",
            Self::Coverage => "coverage",
        })
    }
}

impl FromStr for Statistic {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let plain = [
            Self::Mean,
            Self::Sum,
            Self::Min,
            Self::Max,
            Self::Std,
            Self::Median,
            Self::Count,
            Self::Coverage,
        ];
        if let Some(found) = plain.into_iter().find(|one| one.to_string() == s) {
            return Ok(found);
        }
        let number = s
            .strip_prefix('p')
            .filter(|rest| rest.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c)));
        match number {
            Some(number) => number.parse().map(Self::Percentile),
            None => Err(ContractError::invalid(
                "statistic",
                s,
                "use mean, sum, min, max, std, median, count, coverage or a percentile such as p90",
            )),
        }
    }
}

impl TryFrom<String> for Statistic {
    type Error = ContractError;

    fn try_from(s: String) -> Result<Self, Self::Error> {
        s.parse()
    }
}

impl From<Statistic> for String {
    fn from(statistic: Statistic) -> Self {
        statistic.to_string()
    }
}

/// Statistics of a question, in the order of its answer, each once, at least one.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Serialize)]
#[serde(transparent)]
pub struct Statistics(Vec<Statistic>);

impl Statistics {
    /// # Errors
    /// None, or more than 32.
    pub fn new(wanted: impl IntoIterator<Item = Statistic>) -> Result<Self, ContractError> {
        let mut each = vec![];
        for one in wanted {
            if !each.contains(&one) {
                each.push(one);
            }
        }
        if (1..=MAX_STATISTICS).contains(&each.len()) {
            return Ok(Self(each));
        }
        let reason = format!("1 to {MAX_STATISTICS} of them, separated by commas");
        let count = each.len().to_string();
        Err(ContractError::invalid("statistics", &count, reason))
    }

    /// They in their order.
    pub fn iter(&self) -> impl Iterator<Item = Statistic> + '_ {
        self.0.iter().copied()
    }
}

impl Default for Statistics {
    fn default() -> Self {
        Self(vec![Statistic::Mean])
    }
}

impl FromStr for Statistics {
    type Err = ContractError;

    /// Parses `mean,min,p90`.
    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let parts = s.split(',').take(10 * MAX_STATISTICS);
        let each: Result<Vec<Statistic>, _> = parts.map(|part| part.trim().parse()).collect();
        Self::new(each?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_as_they_are_written() {
        for name in [
            "mean", "sum", "min", "max", "std", "median", "count", "coverage", "p0", "p90",
            "p97.5", "p99.999", "p100", "p0.05",
        ] {
            let one: Statistic = name.parse().unwrap();
            assert_eq!(one.to_string(), name);
            let json = serde_json::to_string(&one).unwrap();
            assert_eq!(serde_json::from_str::<Statistic>(&json).unwrap(), one);
        }
    }

    #[test]
    fn what_is_no_statistic_is_refused_with_what_there_is() {
        let reason = |text: &str| text.parse::<Statistic>().unwrap_err().to_string();
        for bad in [
            "p101", "p100.001", "p-1", "p1.", "p.5", "p1.2345", "p1e1", "p+5",
        ] {
            assert!(reason(bad).contains("p0 to p100"), "{bad}");
        }
        for bad in ["", "mode", "Mean", "p", "pop"] {
            assert!(reason(bad).contains("use mean"), "{bad}");
        }
    }

    #[test]
    fn a_list_holds_each_once_in_its_order() {
        let list: Statistics = "p90, mean,p90.0,min".parse().unwrap();
        let names: Vec<String> = list.iter().map(|one| one.to_string()).collect();
        assert_eq!(names, ["p90", "mean", "min"]);
        assert!("".parse::<Statistics>().is_err());
        assert!("mean,,min".parse::<Statistics>().is_err());
        let many: Vec<String> = (0..40).map(|i| format!("p{i}")).collect();
        assert!(many.join(",").parse::<Statistics>().is_err());
    }
}
