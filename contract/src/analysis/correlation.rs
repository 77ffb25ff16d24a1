//! How two series go together, now and later.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::{AnalysisOptions, SeriesPlace, SeriesQuery};
use crate::ContractError;
use crate::cited::Cited;
use crate::product::ProductId;
use crate::statistics::MinCoverage;
use crate::time::{TimeMs, TimeStep};

/// Most steps that one series is moved against the other.
const MAX_LAG: u32 = 400;

/// May one series be moved so many steps against the other?
///
/// # Errors
/// More than 400.
pub(super) fn check_lag(steps: u32) -> Result<(), ContractError> {
    if steps <= MAX_LAG {
        return Ok(());
    }
    let reason = format!("0 to {MAX_LAG} steps");
    Err(ContractError::invalid("lag", &steps.to_string(), reason))
}

/// What is asked of two products.
#[derive(Debug, Clone, PartialEq)]
pub struct CorrelationQuery {
    /// Where, and the first product.
    pub series: SeriesQuery,
    /// The second.
    pub with: ProductId,
    /// What they are compared in; `native` needs the same periods of both, and lags need them at equal distances.
    pub step: TimeStep,
    /// Is the mean of each calendar month taken off both first?
    pub deseasonalise: bool,
    /// Most steps that one is moved against the other, at most 400.
    pub max_lag: u32,
    /// Least share of a region's sea, or of a line, that a step of either must hold data over; those with less are left out.
    pub min_coverage: MinCoverage,
}

impl CorrelationQuery {
    /// A question with lags from `-max_lag` to `max_lag` steps.
    ///
    /// # Errors
    /// More than 400.
    pub fn new(series: SeriesQuery, with: ProductId, max_lag: u32) -> Result<Self, ContractError> {
        check_lag(max_lag)?;
        Ok(Self {
            series,
            with,
            step: AnalysisOptions::USUAL_STEP,
            deseasonalise: false,
            max_lag,
            min_coverage: MinCoverage::default(),
        })
    }
}

/// How two series go together.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Correlation {
    /// The first product.
    pub first: Cited,
    /// The second product.
    pub second: Cited,
    /// What the first series is of.
    #[serde(flatten)]
    pub place: SeriesPlace,
    /// What they are compared in.
    pub step: TimeStep,
    /// Was the mean of each calendar month taken off both first?
    pub deseasonalised: bool,
    /// First instant that both cover.
    pub start: TimeMs,
    /// First instant after it.
    pub end: TimeMs,
    /// Least share of a region's sea, or of a line, that a step of either had to hold data over, percent.
    #[serde(default)]
    pub min_coverage_percent: f64,
    /// Steps of the first and of the second that hold data over less than that, and were left out.
    #[serde(default)]
    pub left_out_counts: [u64; 2],
    /// What may surprise: steps that cover little or were left out, lags without a correlation. What is said of one side alone begins with
    /// `first` or `second`.
    pub notes: Vec<String>,
    /// One for each lag, from the second leading to the first leading.
    pub rows: Vec<CorrelationRow>,
    /// The lag of the correlation that is furthest from none; none where no lag has any.
    #[schema(required)]
    pub strongest_lag_steps: Option<i32>,
}

/// The correlation at a lag.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct CorrelationRow {
    /// Steps that the second is read after the first: above zero the first leads.
    pub lag_steps: i32,
    /// Pairs of values.
    pub count: u64,
    /// Pearson's; none with fewer than three pairs, or where one side does not vary.
    #[schema(required)]
    pub correlation: Option<f64>,
    /// Why there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub undefined: Option<String>,
    /// n (1 - r r') / (1 + r r') of n pairs, with each series' correlation with its next step where the product is above zero
    /// (Bretherton et al. 1999, doi:10.1175/1520-0442(1999)012<1990:TENOSD>2.0.CO;2).
    #[schema(required)]
    pub effective_count: Option<f64>,
    /// Chance of one as far from none; Student's t with two less than the effective pairs. For this lag alone: of many
    /// lags some pass by chance.
    #[schema(required)]
    pub p_value: Option<f64>,
}
