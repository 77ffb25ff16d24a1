//! Mean, spread and count of each part of the year, and how far steps are from them.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::{BasePeriod, CalendarBins};
use crate::time::TimeMs;

/// A climatology. Every step with data counts once; it belongs to the bin of its middle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Climatology {
    /// Parts of the year.
    pub bins: CalendarBins,
    /// Years that it stands for.
    pub base: BasePeriod,
    /// One for each part of the year, also where it holds no data.
    pub rows: Vec<ClimatologyRow>,
}

/// What the steps of a part of the year have in common.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ClimatologyRow {
    /// `January`, `December to February`, `29 February`.
    pub bin: String,
    /// Mean of its steps, in the answer's unit; none without data.
    #[schema(required)]
    pub mean: Option<f64>,
    /// Standard deviation of its steps, each once, as of a sample: √(Σ (x - m)² / (n - 1)); none of fewer than two.
    #[schema(required)]
    pub spread: Option<f64>,
    /// Steps with data.
    pub count: u64,
    /// Years that have one.
    pub years: u64,
}

/// How far steps are from a climatology.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Anomalies {
    /// Parts of the year of the climatology.
    pub bins: CalendarBins,
    /// Years of the climatology.
    pub base: BasePeriod,
    /// One for each step in the order of time.
    pub rows: Vec<AnomalyRow>,
}

/// A step beside the climatology.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct AnomalyRow {
    /// First instant that it covers.
    pub start: TimeMs,
    /// First instant after it.
    pub end: TimeMs,
    /// The middle.
    pub mid: TimeMs,
    /// Value of the step; none without data.
    #[schema(required)]
    pub value: Option<f64>,
    /// Mean of its part of the year; none where the base period has no data there.
    #[schema(required)]
    pub normal: Option<f64>,
    /// Value less normal.
    #[schema(required)]
    pub anomaly: Option<f64>,
    /// The same in spreads of its part of the year; none where that is unknown or nothing.
    #[schema(required)]
    pub standardised: Option<f64>,
}
