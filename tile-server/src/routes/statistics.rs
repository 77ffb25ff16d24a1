//! What `/point`, `/line` and `/area` of a product have in common where statistics are asked of them.

use axum::http::{HeaderMap, header};
use axum::response::{IntoResponse as _, Response};
use bytes::Bytes;
use contract::rows::RowsForm;
use contract::statistics::{StatisticsAnswer, StatisticsQuery, StatisticsWishes};
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

/// What `/point`, `/line` and `/area` may be asked besides a geometry.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct StatisticsText<'a> {
    pub(crate) statistic: Option<&'a str>,
    pub(crate) step: Option<&'a str>,
    pub(crate) min_coverage: Option<&'a str>,
    pub(crate) from: Option<&'a str>,
    pub(crate) to: Option<&'a str>,
    pub(crate) earth: Option<&'a str>,
}

impl StatisticsText<'_> {
    /// What it means.
    pub(crate) fn wishes(&self) -> Result<StatisticsWishes, ServerError> {
        Ok(StatisticsWishes {
            statistics: parsed(self.statistic)?,
            step: parsed(self.step)?,
            min_coverage: parsed(self.min_coverage)?,
            from: time(self.from)?,
            to: time(self.to)?,
            earth: parsed(self.earth)?,
            ..StatisticsWishes::default()
        })
    }
}

/// The answer to a question about a layer.
pub(crate) async fn answer(
    state: &AppState,
    layer: &Layer,
    query: StatisticsQuery,
    form: RowsForm,
) -> Result<Response, ServerError> {
    // What cannot be asked waits for no turn.
    let (window, inside) = layer.manifest.steps_inside(query.from, query.to)?;
    let periods = inside.iter().map(|step| step.period);
    query.step.bins(window, periods)?;
    let content = state.analyses.statistics(layer, query, form).await?;
    Ok(response(content, form))
}

/// The form that is asked for by name or, where none is, by the header `Accept`.
pub(crate) fn form(format: Option<&str>, headers: &HeaderMap) -> Result<RowsForm, ServerError> {
    if let Some(form) = parsed(format)? {
        return Ok(form);
    }
    let accept = headers.get(header::ACCEPT);
    let accept = accept.and_then(|value| value.to_str().ok());
    Ok(RowsForm::accepted(accept.unwrap_or_default()))
}

/// An answer in a form.
pub(crate) fn response(content: Bytes, form: RowsForm) -> Response {
    let headers = [
        (header::CACHE_CONTROL, "no-cache"),
        (header::CONTENT_TYPE, form.media_type()),
        (header::VARY, "accept"),
    ];
    (headers, content).into_response()
}
