//! Statistics of every cell of a product, which are products themselves.

use std::fmt::{Display, Formatter};
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::{BasePeriod, CalendarBins};
use crate::ContractError;
use crate::product::ProductId;
use crate::time::TimeMs;

/// A statistic over time of each cell by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MapStatistic {
    /// Mean over time, each step by its length.
    Mean,
    /// Standard deviation of the steps about their mean, divided by one less than their number.
    Spread,
    /// Mean of each month or season over the base period.
    Climatology,
    /// Each step less the climatology.
    Anomaly,
    /// Amplitude of the year's wave.
    Amplitude,
    /// When the year's wave is highest, days from the start of the year.
    Phase,
    /// Slope of Theil and Sen through the means of months, their calendar months' means taken off.
    Trend,
    /// Chance of a score of Mann and Kendall as far from none where there is no trend, its variance corrected after Hamed and Rao.
    TrendPValue,
}

impl MapStatistic {
    /// All of them, in the order they are offered.
    pub const ALL: [Self; 8] = [
        Self::Mean,
        Self::Spread,
        Self::Climatology,
        Self::Anomaly,
        Self::Amplitude,
        Self::Phase,
        Self::Trend,
        Self::TrendPValue,
    ];

    /// Name on the command line, and what the name of its product ends with.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Mean => "mean",
            Self::Spread => "spread",
            Self::Climatology => "climatology",
            Self::Anomaly => "anomaly",
            Self::Amplitude => "amplitude",
            Self::Phase => "phase",
            Self::Trend => "trend",
            Self::TrendPValue => "trend-p-value",
        }
    }

    /// Is it gathered in months or seasons of the year?
    pub fn has_bins(self) -> bool {
        matches!(self, Self::Climatology | Self::Anomaly)
    }
}

impl Display for MapStatistic {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.as_str())
    }
}

impl FromStr for MapStatistic {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let named = Self::ALL
            .into_iter()
            .find(|statistic| statistic.as_str() == s);
        named.ok_or_else(|| {
            let names: Vec<_> = Self::ALL
                .iter()
                .map(|statistic| statistic.as_str())
                .collect();
            ContractError::invalid("statistic", s, names.join(", "))
        })
    }
}

/// What is derived.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct MapOptions {
    /// Of each cell.
    pub statistic: MapStatistic,
    /// Years of the climatology; all that the product covers if absent.
    pub base: Option<BasePeriod>,
    /// Months or seasons, of what has bins.
    pub bins: CalendarBins,
    /// First instant of the steps that are read, or of anomalies written; the product's first if absent.
    pub from: Option<TimeMs>,
    /// First instant after them; the product's end if absent.
    pub to: Option<TimeMs>,
    /// Share of the time, of a bin's steps or of the months that must hold data for a cell to have a value, percent.
    pub least_percent: u8,
    /// Product that it becomes; `PRODUCT-STATISTIC` if absent.
    #[serde(skip)]
    pub name: Option<ProductId>,
}

impl MapOptions {
    /// The usual options.
    pub fn new(statistic: MapStatistic) -> Self {
        Self {
            statistic,
            base: None,
            bins: CalendarBins::default(),
            from: None,
            to: None,
            least_percent: 50,
            name: None,
        }
    }

    /// The product that the statistic of a product becomes.
    ///
    /// # Errors
    /// The name would be too long, is the product's own, or is kept for accumulated carbon.
    pub fn target(&self, product: &ProductId) -> Result<ProductId, ContractError> {
        let name = match &self.name {
            Some(name) => name.clone(),
            None => format!("{product}-{}", self.statistic).parse()?,
        };
        if name == *product || name.as_str().ends_with("-accumulated") {
            let reason = "a statistic needs a name of its own, which does not end in -accumulated";
            return Err(ContractError::invalid("product", name.as_str(), reason));
        }
        Ok(name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statistics_have_names_and_so_have_their_products() {
        for statistic in MapStatistic::ALL {
            assert_eq!(statistic.as_str().parse(), Ok(statistic));
        }
        assert!("median".parse::<MapStatistic>().is_err());
        let product: ProductId = "sst".parse().unwrap();
        let mut options = MapOptions::new(MapStatistic::TrendPValue);
        assert_eq!(
            options.target(&product).unwrap().as_str(),
            "sst-trend-p-value"
        );
        for taken in ["sst", "flux-accumulated"] {
            options.name = Some(taken.parse().unwrap());
            assert!(options.target(&product).is_err(), "{taken}");
        }
    }
}
