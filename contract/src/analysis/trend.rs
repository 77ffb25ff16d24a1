//! Change with time, two ways, and whether it is more than chance.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::time::{TimeMs, TimeStep};

/// A month and a day, ms.
const LONGEST_MONTH_MS: i64 = 32 * 86_400_000;

/// Trends of a series. Where steps are no longer than months, or as long as seasons, the mean of each calendar month, or season, is taken off first, so that a
/// season that begins or ends early is no trend.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Trend {
    /// Unit of every slope.
    pub slope_unit: String,
    /// Means that it is drawn through; of months those that hold data over half of their time, of seasons and years over half of each of their months.
    pub step: TimeStep,
    /// Was the mean of each calendar month, or season, taken off first?
    pub deseasonalised: bool,
    /// Number of values.
    pub count: u64,
    /// From the first to the last value, years of 365.25 days.
    pub years: f64,
    /// Where the lines hold their middle: the mean instant of the values.
    pub mid: TimeMs,
    /// Mean of the values, in the answer's unit, season included.
    pub mean: f64,
    /// By least squares.
    pub least_squares: LeastSquaresTrend,
    /// By the median of the slopes of all pairs.
    pub theil_sen: TheilSenTrend,
    /// Is there a trend in either direction?
    pub mann_kendall: MannKendall,
    /// What the lines are drawn through, seasons taken off about the mean where they are; steps without data are absent.
    pub values: Vec<TrendValue>,
}

impl Trend {
    /// What the means are of that were taken off first; none where values are as they are.
    pub fn parts_taken_off(&self) -> Option<&'static str> {
        let step = self.values.first();
        let length_ms = step.map_or(0, |step| step.end.ms() - step.start.ms());
        let is_month = length_ms <= LONGEST_MONTH_MS;
        self.deseasonalised
            .then_some(if is_month { "calendar month" } else { "season" })
    }
}

/// A value that a trend is drawn through.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct TrendValue {
    /// First instant that it covers.
    pub start: TimeMs,
    /// First instant after it.
    pub end: TimeMs,
    /// In the answer's unit.
    pub value: f64,
}

/// A line by least squares, its uncertainty with an effective number of values: n (1 - r) / (1 + r), r the correlation of
/// residuals with their next ones where that is above zero (Santer et al. 2000, doi:10.1029/1999JD901105).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct LeastSquaresTrend {
    /// Change in ten years of 365.25 days.
    pub slope_per_decade: f64,
    /// One standard error; none where too few values are effective.
    #[schema(required)]
    pub standard_error_per_decade: Option<f64>,
    /// Lower end of the interval that holds it with 95 %.
    #[schema(required)]
    pub lower_per_decade: Option<f64>,
    /// Upper end.
    #[schema(required)]
    pub upper_per_decade: Option<f64>,
    /// Chance of a slope as steep where there is none; Student's t with two less than the effective values.
    #[schema(required)]
    pub p_value: Option<f64>,
    /// Correlation of residuals with their next ones.
    pub lag1_autocorrelation: f64,
    /// Effective number of values.
    pub effective_count: f64,
}

/// The median of the slopes of all pairs of values, exact (Theil 1950; Sen 1968, doi:10.1080/01621459.1968.10480934), and
/// Sen's interval with the variance that allows for autocorrelation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct TheilSenTrend {
    /// Change in ten years of 365.25 days.
    pub slope_per_decade: f64,
    /// Lower end of the interval that holds it with 95 %.
    pub lower_per_decade: f64,
    /// Upper end.
    pub upper_per_decade: f64,
    /// Median of the values less the slope times the time from `mid`: what the line holds there.
    pub at_mid: f64,
}

/// The test of Mann and Kendall, its variance corrected for autocorrelation (Hamed and Rao 1998,
/// doi:10.1016/S0022-1694(97)00125-X), with that of the ranks of the detrended values from one step to the next, where it is beyond 95 % of chance, and its
/// powers at longer lags (Yue and Wang 2004, doi:10.1023/B:WARM.0000043140.61082.60).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct MannKendall {
    /// Pairs that rise less pairs that fall.
    pub score: i64,
    /// Score over the number of pairs, -1 to 1.
    pub tau: f64,
    /// What the variance of the score was multiplied with; never below 1.
    pub variance_correction: f64,
    /// Score in standard deviations.
    pub z: f64,
    /// Chance of as high a score in either direction where there is no trend.
    pub p_value: f64,
}
