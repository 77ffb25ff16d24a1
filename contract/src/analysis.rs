//! What is made of series: climatology, anomaly, trend, season, extremes; correlation of two; latitude or longitude against
//! time; differences. Questions and answers, the same on the command line and over HTTP.

mod along_line;
mod base;
mod bins;
mod climatology;
mod correlation;
mod correlation_statistic;
mod difference;
mod extremes;
mod hovmoller;
mod map;
mod map_correlation;
mod map_statistic;
mod season;
mod trend;
mod wishes;

use std::fmt::{Display, Formatter};
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::ContractError;
use crate::cited::Cited;
use crate::grid::LonLatDeg;
use crate::product::ProductId;
use crate::series::{Cell, RegionSeriesQuery};
use crate::statistics::MinCoverage;
use crate::time::{TimeMs, TimeStep};

pub use along_line::LineSeriesQuery;
pub use base::BasePeriod;
pub use bins::CalendarBins;
pub use climatology::{Anomalies, AnomalyRow, Climatology, ClimatologyRow};
pub use correlation::{Correlation, CorrelationQuery, CorrelationRow};
pub use correlation_statistic::CorrelationStatistic;
pub use difference::{Difference, DifferenceSide};
pub use extremes::{Extreme, Extremes, Percentile};
pub use hovmoller::{Along, Hovmoller, HovmollerBand, HovmollerQuery, HovmollerRow};
pub use map::MapOptions;
pub use map_correlation::MapCorrelation;
pub use map_statistic::MapStatistic;
pub use season::{Harmonic, Season};
pub use trend::{LeastSquaresTrend, MannKendall, TheilSenTrend, Trend, TrendValue};
pub use wishes::{
    AnalysisWishes, CorrelationWishes, DifferenceWishes, HovmollerWishes, SeriesWishes,
};

/// One thing that is made of a series.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, ToSchema,
)]
#[serde(rename_all = "lowercase")]
pub enum AnalysisPart {
    /// Mean, spread and count of each part of the year.
    Climatology,
    /// How far each step is from the climatology.
    Anomaly,
    /// Change with time, and whether it is more than chance.
    Trend,
    /// Amplitude and phase of the year and the half-year.
    Season,
    /// Highest and lowest steps with their dates, and percentiles.
    Extremes,
}

impl AnalysisPart {
    /// All of them, in the order they are offered.
    pub const ALL: [Self; 5] = [
        Self::Climatology,
        Self::Anomaly,
        Self::Trend,
        Self::Season,
        Self::Extremes,
    ];

    /// Name on the command line and in addresses.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Climatology => "climatology",
            Self::Anomaly => "anomaly",
            Self::Trend => "trend",
            Self::Season => "season",
            Self::Extremes => "extremes",
        }
    }
}

impl Display for AnalysisPart {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.as_str())
    }
}

impl FromStr for AnalysisPart {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let named = Self::ALL.into_iter().find(|part| part.as_str() == s);
        named.ok_or_else(|| {
            let valid = "climatology, anomaly, trend, season or extremes, several with commas";
            ContractError::invalid("analysis", s, valid)
        })
    }
}

/// What is asked of a series.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AnalysisOptions {
    /// What is made of it: something, in the order of [`AnalysisPart`], nothing twice.
    pub parts: Vec<AnalysisPart>,
    /// Years of the climatology; all that the series covers if absent.
    pub base: Option<BasePeriod>,
    /// Parts of the year.
    pub bins: CalendarBins,
    /// Means that a trend is drawn through.
    pub trend_step: TimeStep,
    /// Least share of a region's sea, or of a line, that a step must hold data over; those with less are left out.
    pub min_coverage: MinCoverage,
}

impl AnalysisOptions {
    /// Means that trends, correlations and Hovmöller diagrams are made of where nothing is said.
    pub const USUAL_STEP: TimeStep = TimeStep::Month;

    /// Some parts with the usual options.
    ///
    /// # Errors
    /// No part at all.
    pub fn new(mut parts: Vec<AnalysisPart>) -> Result<Self, ContractError> {
        parts.sort_unstable();
        parts.dedup();
        if parts.is_empty() {
            let valid = "give one of climatology, anomaly, trend, season, extremes";
            return Err(ContractError::invalid("analysis", "", valid));
        }
        Ok(Self {
            parts,
            base: None,
            bins: CalendarBins::default(),
            trend_step: Self::USUAL_STEP,
            min_coverage: MinCoverage::default(),
        })
    }
}

/// The series that is analysed.
#[derive(Debug, Clone, PartialEq)]
pub enum SeriesQuery {
    /// Of the cell at a place.
    Cell {
        /// Product.
        product: ProductId,
        /// The place.
        place: LonLatDeg,
        /// First instant; the product's first if absent.
        from: Option<TimeMs>,
        /// First instant after the asked period; the product's end if absent.
        to: Option<TimeMs>,
    },
    /// Of the mean over a region.
    Region(RegionSeriesQuery),
    /// Of the mean along a line.
    Line(LineSeriesQuery),
}

impl SeriesQuery {
    /// Product.
    pub fn product(&self) -> &ProductId {
        match self {
            Self::Cell { product, .. } => product,
            Self::Region(query) => &query.product,
            Self::Line(query) => &query.product,
        }
    }

    /// First instant, and the first one after the asked period.
    pub fn window(&self) -> (Option<TimeMs>, Option<TimeMs>) {
        match self {
            Self::Cell { from, to, .. } => (*from, *to),
            Self::Region(query) => (query.from, query.to),
            Self::Line(query) => (query.from, query.to),
        }
    }

    /// The same of another product.
    #[must_use]
    pub fn of_product(&self, other: ProductId) -> Self {
        let mut query = self.clone();
        match &mut query {
            Self::Cell { product, .. } => *product = other,
            Self::Region(query) => query.product = other,
            Self::Line(query) => query.product = other,
        }
        query
    }

    /// The same in some years; as it is without any.
    #[must_use]
    pub fn in_years(&self, years: Option<BasePeriod>) -> Self {
        match years.map(BasePeriod::period) {
            Some(period) => self.within(Some(period.start), Some(period.end)),
            None => self.clone(),
        }
    }

    /// The same over another period.
    #[must_use]
    pub fn within(&self, from: Option<TimeMs>, to: Option<TimeMs>) -> Self {
        let mut query = self.clone();
        match &mut query {
            Self::Cell {
                from: own_from,
                to: own_to,
                ..
            } => (*own_from, *own_to) = (from, to),
            Self::Region(query) => (query.from, query.to) = (from, to),
            Self::Line(query) => (query.from, query.to) = (from, to),
        }
        query
    }
}

/// What a series is of.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SeriesPlace {
    /// The region that it is the mean over; none of a cell or a line.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub region: Option<String>,
    /// The line that it is the mean along; none of a cell or a region.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub line: Option<String>,
    /// The cell; none of a region or a line.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub cell: Option<Cell>,
}

/// What was asked for and cannot be said.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Refused {
    /// What.
    pub part: AnalysisPart,
    /// Why.
    pub reason: String,
}

/// What was made of a series, with all that is needed to cite it. Parts that were not asked for are absent.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SeriesAnalysis {
    /// What it is to be cited with.
    #[serde(flatten)]
    pub cited: Cited,
    /// What the series is of.
    #[serde(flatten)]
    pub place: SeriesPlace,
    /// First instant that was read.
    pub start: TimeMs,
    /// First instant after it.
    pub end: TimeMs,
    /// Steps that were read.
    pub step_count: u64,
    /// Steps of them that hold data and were not left out.
    pub value_count: u64,
    /// Least share of a region's sea, or of a line, that a step had to hold data over, percent.
    #[serde(default)]
    pub min_coverage_percent: f64,
    /// Steps that hold data over less than that, and were left out.
    #[serde(default)]
    pub left_out_count: u64,
    /// What may surprise: how the region or line was taken, steps that cover little of it or were left out, steps without data.
    pub notes: Vec<String>,
    /// What was asked for and cannot be said, and why.
    pub refused: Vec<Refused>,
    /// Mean, spread and count of each part of the year.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub climatology: Option<Climatology>,
    /// How far each step is from the climatology.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub anomaly: Option<Anomalies>,
    /// Change with time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub trend: Option<Trend>,
    /// Amplitude and phase.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub season: Option<Season>,
    /// Highest, lowest, percentiles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub extremes: Option<Extremes>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_asked_for_by_name_and_once() {
        for part in AnalysisPart::ALL {
            assert_eq!(part.as_str().parse(), Ok(part));
        }
        assert!("mean".parse::<AnalysisPart>().is_err());
        assert!(AnalysisOptions::new(vec![]).is_err());
        let twice = vec![
            AnalysisPart::Trend,
            AnalysisPart::Anomaly,
            AnalysisPart::Trend,
        ];
        let options = AnalysisOptions::new(twice).unwrap();
        assert_eq!(options.parts, [AnalysisPart::Anomaly, AnalysisPart::Trend]);
    }
}
