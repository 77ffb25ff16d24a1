//! Statistics of every cell of a product, which are products themselves, by name.

use std::fmt::{Display, Formatter};
use std::str::FromStr;

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::CorrelationStatistic;
use crate::ContractError;
use crate::statistics::Percentile;

/// A statistic over time of each cell by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum MapStatistic {
    /// Mean over time, each step by its length.
    Mean,
    /// The lowest step.
    Min,
    /// The highest step.
    Max,
    /// When the lowest step is: its middle, days from the start of 1970; of equal ones the first.
    MinTime,
    /// The same of the highest one.
    MaxTime,
    /// The value that so much of the time with data lies at or below.
    Percentile(Percentile),
    /// Steps with data.
    Count,
    /// Share of the time with data.
    Coverage,
    /// Standard deviation of the steps about their mean, each once, as of a sample: √(Σ (x - m)² / (n - 1)).
    Spread,
    /// Mean of each month or season over the base period.
    Climatology,
    /// Each step, or each mean of some, less the climatology.
    Anomaly,
    /// Amplitude of the year's wave.
    Amplitude,
    /// When the year's wave is highest, days from the start of the year.
    Phase,
    /// Slope of Theil and Sen through the means of months, their calendar months' means taken off.
    Trend,
    /// Chance of a score of Mann and Kendall as far from none where there is no trend, its variance corrected after Hamed and Rao and after Yue and Wang.
    TrendPValue,
    /// Slope of the line of least squares through the same means.
    LeastSquaresTrend,
    /// Chance of such a slope where there is none, by an effective number of means that allows for autocorrelation.
    LeastSquaresTrendPValue,
    /// How it goes together with another product, over means that both have.
    Correlation(CorrelationStatistic),
}

impl MapStatistic {
    /// All of them, in the order they are offered; of percentiles the median.
    pub const ALL: [Self; 21] = [
        Self::Mean,
        Self::Min,
        Self::Max,
        Self::MinTime,
        Self::MaxTime,
        Self::Percentile(Percentile::MEDIAN),
        Self::Count,
        Self::Coverage,
        Self::Spread,
        Self::Climatology,
        Self::Anomaly,
        Self::Amplitude,
        Self::Phase,
        Self::Trend,
        Self::TrendPValue,
        Self::LeastSquaresTrend,
        Self::LeastSquaresTrendPValue,
        Self::Correlation(CorrelationStatistic::Coefficient),
        Self::Correlation(CorrelationStatistic::PValue),
        Self::Correlation(CorrelationStatistic::Pairs),
        Self::Correlation(CorrelationStatistic::EffectivePairs),
    ];

    /// Its name as part of one of a product: `p97-5`.
    pub fn word(self) -> String {
        self.to_string().replace('.', "-")
    }

    /// Its name, but for percentiles that are not the median.
    fn of_all(self) -> &'static str {
        match self {
            Self::Mean => "mean",
            Self::Min => "min",
            Self::Max => "max",
            Self::MinTime => "min-time",
            Self::MaxTime => "max-time",
            Self::Percentile(_) => "median",
            Self::Count => "count",
            Self::Coverage => "coverage",
            Self::Spread => "spread",
            Self::Climatology => "climatology",
            Self::Anomaly => "anomaly",
            Self::Amplitude => "amplitude",
            Self::Phase => "phase",
            Self::Trend => "trend",
            Self::TrendPValue => "trend-p-value",
            Self::LeastSquaresTrend => "least-squares-trend",
            Self::LeastSquaresTrendPValue => "least-squares-trend-p-value",
            Self::Correlation(of) => of.as_str(),
        }
    }

    /// Is it gathered in months or seasons of the year?
    pub fn has_bins(self) -> bool {
        matches!(self, Self::Climatology | Self::Anomaly)
    }

    /// Is it of a line through means of the steps of time?
    pub fn is_trend(self) -> bool {
        matches!(
            self,
            Self::Trend
                | Self::TrendPValue
                | Self::LeastSquaresTrend
                | Self::LeastSquaresTrendPValue
        )
    }

    /// Is it one of two products?
    pub fn is_of_two(self) -> bool {
        matches!(self, Self::Correlation(_))
    }
}

/// Name on the command line, such as `trend-p-value` or `p97.5`.
impl Display for MapStatistic {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Percentile(percentile) if *percentile != Percentile::MEDIAN => {
                write!(f, "p{percentile}")
            }
            other => f.write_str(other.of_all()),
        }
    }
}

impl Serialize for MapStatistic {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for MapStatistic {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        name.parse().map_err(D::Error::custom)
    }
}

impl FromStr for MapStatistic {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let named = Self::ALL
            .into_iter()
            .find(|statistic| statistic.of_all() == s);
        if let Some(named) = named {
            return Ok(named);
        }
        let is_percentile = |text: &&str| text.starts_with(|c: char| c.is_ascii_digit());
        if let Some(percentile) = s.strip_prefix('p').filter(is_percentile) {
            return Ok(Self::Percentile(percentile.parse()?));
        }
        let names: Vec<_> = Self::ALL
            .iter()
            .map(|statistic| statistic.of_all())
            .collect();
        let names = format!("{} and percentiles such as p97.5", names.join(", "));
        Err(ContractError::invalid("statistic", s, names))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statistics_have_names() {
        for statistic in MapStatistic::ALL {
            assert_eq!(statistic.to_string().parse(), Ok(statistic));
        }
        let percentile: MapStatistic = "p97.5".parse().unwrap();
        assert_eq!(percentile.to_string(), "p97.5");
        assert_eq!("p50".parse(), "median".parse::<MapStatistic>());
        for none in ["p", "phases", "p101", "p9.1234", "mode"] {
            assert!(none.parse::<MapStatistic>().is_err(), "{none}");
        }
        assert_eq!(percentile.word(), "p97-5");
    }

    /// Bytes that are stored in manifests.
    #[test]
    fn stored_names_are_read_and_written_alike() {
        for statistic in MapStatistic::ALL {
            let json = serde_json::to_string(&statistic).unwrap();
            assert_eq!(json, format!("\"{statistic}\""));
            assert_eq!(
                serde_json::from_str::<MapStatistic>(&json).unwrap(),
                statistic
            );
        }
        assert!(serde_json::from_str::<MapStatistic>("\"mode\"").is_err());
    }
}
