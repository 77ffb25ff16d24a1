//! What `/point`, `/line` and `/area` of a product have in common where statistics are asked of them.

use axum::Json;
use axum::http::header;
use axum::response::{IntoResponse as _, Response};
use contract::statistics::{StatisticsAnswer, StatisticsQuery};
use serde::Serialize;
use utoipa::ToSchema;

use crate::catalogue::Layer;
use crate::error::ServerError;
use crate::extract::{parsed, time};
use crate::state::AppState;

/// Statistics or a series, whichever was asked for: never made, it describes answers.
#[derive(Debug, Serialize, ToSchema)]
#[serde(untagged)]
#[expect(clippy::large_enum_variant, reason = "it is never made")]
pub(crate) enum SeriesOrStatistics<S: ToSchema> {
    /// Nothing but the geometry was asked for.
    #[expect(dead_code, reason = "a schema")]
    Series(S),
    /// A statistic, a step or a least coverage was asked for.
    #[expect(dead_code, reason = "a schema")]
    Statistics(StatisticsAnswer),
}

/// What is asked besides a geometry.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Asked<'a> {
    pub(crate) statistic: Option<&'a str>,
    pub(crate) step: Option<&'a str>,
    pub(crate) min_coverage: Option<&'a str>,
    pub(crate) from: Option<&'a str>,
    pub(crate) to: Option<&'a str>,
}

impl Asked<'_> {
    /// Are statistics asked, rather than the series that was always given?
    pub(crate) fn are_statistics(&self) -> bool {
        self.statistic.is_some() || self.step.is_some() || self.min_coverage.is_some()
    }

    /// The question with what is asked.
    pub(crate) fn query(&self, usual: StatisticsQuery) -> Result<StatisticsQuery, ServerError> {
        Ok(StatisticsQuery {
            statistics: parsed(self.statistic)?.unwrap_or_default(),
            step: parsed(self.step)?.unwrap_or_default(),
            min_coverage: parsed(self.min_coverage)?.unwrap_or_default(),
            from: time(self.from)?,
            to: time(self.to)?,
            ..usual
        })
    }
}

/// The answer to a question about a layer.
pub(crate) async fn answer(
    state: &AppState,
    layer: &Layer,
    query: StatisticsQuery,
) -> Result<Response, ServerError> {
    // What cannot be asked waits for no turn.
    let (window, inside) = layer.manifest.steps_inside(query.from, query.to)?;
    let periods = inside.iter().map(|step| step.period);
    query.step.bins(window, periods)?;
    let answer = state.analyses.statistics(layer, query).await?;
    Ok(([(header::CACHE_CONTROL, "no-cache")], Json(&*answer)).into_response())
}
