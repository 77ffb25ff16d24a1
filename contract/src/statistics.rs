//! Statistics of a product over a geometry, by bins of time: as they are asked for and answered, the same on the command
//! line and over HTTP.

mod statistic;
mod wishes;

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::ContractError;
use crate::cited::Cited;
use crate::earth::Earth;
use crate::geometry::{AskedGeometry, Geometry};
use crate::manifest::Manifest;
use crate::product::ProductId;
use crate::region::Cells;
use crate::time::{Period, TimeMs, TimeStep};

pub use statistic::{Percentile, Statistic, Statistics};
pub use wishes::{PointQuestion, RegionQuestion, StatisticsWishes};

/// What statistics are asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct StatisticsQuery {
    /// Product, of any quantity.
    pub product: ProductId,
    /// Where.
    pub geometry: Geometry,
    /// What the answer calls the geometry.
    pub geometry_name: String,
    /// Which, in the order of the answer, each once.
    pub statistics: Statistics,
    /// What a row covers.
    pub step: TimeStep,
    /// First instant; the product's first if absent.
    pub from: Option<TimeMs>,
    /// First instant after the asked period; the product's end if absent.
    pub to: Option<TimeMs>,
    /// Figure of the earth.
    pub earth: Earth,
    /// How cells on the coast count, in regions.
    pub cells: Cells,
    /// A version of a product on the same grid that says how much of every cell is sea or land; Natural Earth if absent.
    pub ocean: Option<Arc<Manifest>>,
    /// Rows whose coverage is below this have no values, percent.
    pub min_coverage: MinCoverage,
}

impl StatisticsQuery {
    /// What a row covers where nothing is said.
    pub const USUAL_STEP: TimeStep = TimeStep::Native;

    /// The usual question about a geometry: the mean at every step.
    pub fn new(product: ProductId, asked: AskedGeometry) -> Self {
        Self {
            product,
            geometry: asked.geometry,
            geometry_name: asked.name,
            statistics: Statistics::default(),
            step: Self::USUAL_STEP,
            from: None,
            to: None,
            earth: Earth::default(),
            cells: Cells::default(),
            ocean: None,
            min_coverage: MinCoverage::default(),
        }
    }
}

/// Rounding of areas and times that make a coverage, percent.
const SLACK_PERCENT: f64 = 1e-6;

/// Least coverage of a row that has values, percent, 0 to 100.
#[derive(Debug, Clone, Copy, Default, PartialEq, PartialOrd, Serialize)]
#[serde(transparent)]
pub struct MinCoverage(f64);

impl MinCoverage {
    /// # Errors
    /// Not within 0 to 100.
    pub fn new(percent: f64) -> Result<Self, ContractError> {
        if (0.0..=100.0).contains(&percent) {
            Ok(Self(percent))
        } else {
            let text = percent.to_string();
            let reason = "a share in percent, 0 to 100";
            Err(ContractError::invalid("least coverage", &text, reason))
        }
    }

    /// It in percent.
    pub fn percent(self) -> f64 {
        self.0
    }

    /// Is so much covered? What is a quotient of sums may be a hair below all.
    pub fn is_met(self, percent: f64) -> bool {
        percent >= self.0 - SLACK_PERCENT
    }
}

impl std::str::FromStr for MinCoverage {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        // What is no number is told as one out of range.
        let number = s.trim_end_matches('%').trim().parse().unwrap_or(f64::NAN);
        let reason = "a share in percent, 0 to 100";
        Self::new(number).map_err(|_out| ContractError::invalid("least coverage", s, reason))
    }
}

/// Statistics of a product over a geometry, with all that is needed to cite them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct StatisticsAnswer {
    /// What it is to be cited with.
    #[serde(flatten)]
    pub cited: Cited,
    /// `point`, `line` or `area`.
    pub kind: String,
    /// The geometry by its name, or as it was asked for.
    pub geometry: String,
    /// What a row covers.
    pub step: TimeStep,
    /// Figure of the earth.
    pub earth: Earth,
    /// How cells on the coast counted.
    pub cells: Cells,
    /// Each statistic with its unit and what it means.
    pub statistics: Vec<StatisticNote>,
    /// What coverage is a share of.
    pub coverage_basis: String,
    /// How large the geometry is, wherever the grid lies: area in m², length in m; 1 for a point.
    pub size: f64,
    /// Unit of `size`: `m²`, `m` or `1`.
    pub size_unit: String,
    /// Rows whose coverage is below this have no values, percent.
    pub min_coverage_percent: f64,
    /// What says which part of a cell is sea; none for points and lines.
    #[schema(required)]
    pub ocean_source: Option<String>,
    /// How the geometry was taken where that may surprise.
    pub notes: Vec<String>,
    /// Rows in the order of time, one for every bin of the period, also where it holds nothing.
    pub rows: Vec<StatisticsRow>,
}

/// A statistic of an answer.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct StatisticNote {
    /// Name that it has in rows.
    pub name: String,
    /// Unit of its numbers.
    pub unit: String,
    /// What it is, in a line.
    pub what: String,
}

/// Statistics of one bin of time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct StatisticsRow {
    /// First instant.
    pub start: TimeMs,
    /// First instant after it.
    pub end: TimeMs,
    /// The middle.
    pub mid: TimeMs,
    /// By the statistic's name, in its unit; null where nothing holds data, or too little does.
    pub values: BTreeMap<String, Option<f64>>,
    /// Middle of the step that an extreme was found in, the first if there are several.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub found_at: BTreeMap<String, TimeMs>,
    /// Share of the geometry and of the row's time that holds data, percent.
    pub coverage_percent: f64,
    /// Steps of the product that reach into the row.
    pub step_count: u32,
    /// There are data, but less than the least coverage: its values are withheld.
    pub is_withheld: bool,
}

impl StatisticsAnswer {
    /// A statistic of every row as a series: what each covers, and the value where there is one.
    pub fn series(&self, statistic: Statistic) -> Vec<(Period, Option<f64>)> {
        let name = statistic.to_string();
        let value = |row: &StatisticsRow| row.values.get(&name).copied().flatten();
        let period = |row: &StatisticsRow| Period {
            start: row.start,
            end: row.end,
        };
        let rows = self.rows.iter();
        rows.map(|row| (period(row), value(row))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_least_coverage_is_a_percentage() {
        let of = |text: &str| text.parse::<MinCoverage>().map(MinCoverage::percent);
        assert_eq!(of("50"), Ok(50.0));
        assert_eq!(of("12.5%"), Ok(12.5));
        for bad in ["", "-1", "100.1", "half", "NaN", "inf"] {
            assert!(of(bad).is_err(), "{bad}");
        }
    }
}
