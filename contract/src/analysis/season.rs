//! The year and the half-year in a series.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Amplitude and phase of the year and the half-year, by least squares over steps of any length. A step is taken as the mean
/// over its period, so that long steps do not flatten the wave.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Season {
    /// Mean without the waves, in the answer's unit.
    pub mean: f64,
    /// Was a straight line in time fitted along? From two years on.
    pub has_trend: bool,
    /// The year.
    pub annual: Harmonic,
    /// The half-year.
    pub semi_annual: Harmonic,
    /// Share of the variance about the mean (or the line) that both waves explain, percent.
    pub explained_percent: f64,
    /// Standard deviation of what they leave, of a sample: √(Σ x² / (n - 1)).
    pub residual_spread: f64,
    /// Steps with data.
    pub count: u64,
}

/// A wave.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Harmonic {
    /// Half of what lies between its highest and its lowest value, in the answer's unit.
    pub amplitude: f64,
    /// When it is highest for the first time in a year: days from its start, a year of 365.25 days counted from 2000-01-01.
    pub highest_after_days: f64,
}
