//! `/api/products/{product}/line`: statistics of a product along a line, each cell by the length of the line in it.

use axum::body::Body;
use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::Response;
use contract::earth::Earth;
use contract::geometry::AskedLine;
use contract::rows::RowsForm;
use contract::statistics::StatisticsAnswer;
use contract::time::TimeStep;
use serde::Deserialize;
use utoipa::IntoParams;

use crate::error::ServerError;
use crate::extract::{UrlPath, UrlQuery, left_out};
use crate::openapi::words::GeoJson;
use crate::routes::statistics::{StatisticsText, answer, form};
use crate::state::AppState;

#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub(crate) struct LineParameters {
    /// `LON,LAT;LON,LAT;...` in degrees, GeoJSON or well-known text; a great circle from each vertex to the next.
    #[param(value_type = String)]
    line: Option<String>,
    /// Statistics, separated by commas: `mean`, `sum`, `min`, `max`, `std`, `median`, `count`, `coverage`, and percentiles such
    /// as `p90`; `mean` unless told otherwise.
    statistic: Option<String>,
    /// What a row covers; `native` unless told otherwise.
    #[param(value_type = Option<TimeStep>)]
    step: Option<String>,
    /// First instant, ISO 8601 UTC; the product's own unless one is given.
    from: Option<String>,
    /// First instant after the period; the product's own unless one is given.
    to: Option<String>,
    /// Least coverage, percent: rows with less have no values; 0 unless told otherwise.
    #[param(value_type = Option<f64>, minimum = 0, maximum = 100)]
    min_coverage: Option<String>,
    /// Figure of the earth for lengths; `wgs84` unless one is given.
    #[param(value_type = Option<Earth>)]
    earth: Option<String>,
    /// Form of the answer: `json`, or its rows alone as `csv` or `arrow`, a file of Arrow; by the header `Accept` unless one is given.
    #[param(value_type = Option<RowsForm>)]
    format: Option<String>,
    /// Version, as answers name it, with or without its digest; the newest unless one is given.
    manifest: Option<String>,
}

/// Statistics along a line, by length.
#[utoipa::path(
    get,
    path = "/api/products/{product}/line",
    operation_id = "line",
    tag = "statistics",
    params(("product" = String, Path, description = "Name of the product"), LineParameters),
    responses((
        status = 200,
        description = "One row for each bin of time",
        content(
            (StatisticsAnswer = "application/json"),
            (String = "text/csv"),
            ("application/vnd.apache.arrow.file"),
        ),
    )),
)]
pub(crate) async fn get(
    State(state): State<AppState>,
    headers: HeaderMap,
    UrlPath(product): UrlPath<String>,
    UrlQuery(own): UrlQuery<LineParameters>,
) -> Result<Response, ServerError> {
    let Some(line) = own.line.as_deref() else {
        return Err(ServerError::Missing {
            name: "line",
            wanted: "LON,LAT;LON,LAT;... in degrees, GeoJSON or WKT text",
        });
    };
    let line = line.parse()?;
    answered(&state, &headers, &product, &own, line).await
}

/// The same along a line that is sent along: the answer of GET with its text as `line`.
#[utoipa::path(
    post,
    path = "/api/products/{product}/line",
    operation_id = "line_of",
    tag = "statistics",
    params(("product" = String, Path, description = "Name of the product"), LineParameters),
    request_body(
        description = "The line in place of the parameter of that name, as GeoJSON of at most 64 MiB and a million vertices",
        content((GeoJson = "application/geo+json"), (GeoJson = "application/json")),
    ),
    responses((
        status = 200,
        description = "One row for each bin of time",
        content(
            (StatisticsAnswer = "application/json"),
            (String = "text/csv"),
            ("application/vnd.apache.arrow.file"),
        ),
    )),
)]
pub(crate) async fn post(
    State(state): State<AppState>,
    headers: HeaderMap,
    UrlPath(product): UrlPath<String>,
    UrlQuery(own): UrlQuery<LineParameters>,
    body: Body,
) -> Result<Response, ServerError> {
    left_out(&[("line", own.line.is_some())])?;
    let sent = state.bodies.take(&headers, body).await?;
    let (line, _room) = sent.read(|text| Ok(text.parse::<AskedLine>()?)).await?;
    answered(&state, &headers, &product, &own, line).await
}

async fn answered(
    state: &AppState,
    headers: &HeaderMap,
    product: &str,
    own: &LineParameters,
    line: AskedLine,
) -> Result<Response, ServerError> {
    let form = form(own.format.as_deref(), headers)?;
    let layer = state
        .catalogue
        .version(product, own.manifest.as_deref())
        .await?;
    let text = StatisticsText {
        statistic: own.statistic.as_deref(),
        step: own.step.as_deref(),
        min_coverage: own.min_coverage.as_deref(),
        from: own.from.as_deref(),
        to: own.to.as_deref(),
        earth: own.earth.as_deref(),
    };
    let product = layer.manifest.product.clone();
    let query = text.wishes()?.query(product, line.into());
    answer(state, &layer, query, form).await
}
