//! The means of a product over two periods, of two versions of it, or of two products.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::SeriesPlace;
use crate::cited::Cited;
use crate::time::TimeMs;

/// A difference of two means over time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Difference {
    /// What it is a difference at.
    #[serde(flatten)]
    pub place: SeriesPlace,
    /// Unit of the means and of their difference.
    pub unit: String,
    /// What something is taken off from.
    pub of: DifferenceSide,
    /// What is taken off.
    pub minus: DifferenceSide,
    /// Mean of the first less mean of the second, in the answer's unit; none where one side has no data.
    #[schema(required)]
    pub difference: Option<f64>,
    /// One standard error, by the spread of each side's steps about its mean seasons and their effective number.
    #[schema(required)]
    pub standard_error: Option<f64>,
    /// Chance of one as far from none (Welch 1947, doi:10.1093/biomet/34.1-2.28).
    #[schema(required)]
    pub p_value: Option<f64>,
    /// Least share of a region's sea, or of a line, that a step of either side had to hold data over, percent.
    #[serde(default)]
    pub min_coverage_percent: f64,
    /// What may surprise. What is said of one side alone begins with `of` or `minus`.
    pub notes: Vec<String>,
}

/// One of the two.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct DifferenceSide {
    /// What it is to be cited with.
    #[serde(flatten)]
    pub cited: Cited,
    /// First instant that counts.
    pub start: TimeMs,
    /// First instant after it.
    pub end: TimeMs,
    /// Steps with data that were not left out.
    pub count: u64,
    /// Steps that hold data over less than the least coverage, and were left out.
    #[serde(default)]
    pub left_out_count: u64,
    /// Mean over time, each step by its time in the asked period; none without data.
    #[schema(required)]
    pub mean: Option<f64>,
    /// Effective number of steps.
    #[schema(required)]
    pub effective_count: Option<f64>,
}
