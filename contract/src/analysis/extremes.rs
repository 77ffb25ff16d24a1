//! Highest and lowest steps, and percentiles.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::time::TimeMs;

/// The ends of a series.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Extremes {
    /// Highest first; of equal ones the earliest first.
    pub highest: Vec<Extreme>,
    /// Lowest first; of equal ones the earliest first.
    pub lowest: Vec<Extreme>,
    /// Between two values straight in rank: the p-th lies at p (n - 1) / 100 of n values from the lowest on, definition 7 of
    /// Hyndman and Fan (1996), doi:10.1080/00031305.1996.10473566.
    pub percentiles: Vec<Percentile>,
}

/// A step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Extreme {
    /// First instant that it covers.
    pub start: TimeMs,
    /// First instant after it.
    pub end: TimeMs,
    /// Its value, in the answer's unit.
    pub value: f64,
}

/// What a share of values lies below.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Percentile {
    /// The share, percent.
    pub percent: f64,
    /// The value, in the answer's unit.
    pub value: f64,
}
