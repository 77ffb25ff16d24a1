//! `/api/products/{product}/line`: statistics of a product along a line, each cell by the length of the line in it.

use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::Response;
use contract::earth::Earth;
use contract::geometry::AskedGeometry;
use contract::rows::RowsForm;
use contract::statistics::StatisticsAnswer;
use contract::time::TimeStep;
use serde::Deserialize;
use utoipa::IntoParams;

use crate::error::ServerError;
use crate::extract::{UrlPath, UrlQuery};
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
    /// Version, as answers name it; the newest unless one is given.
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
    let form = form(own.format.as_deref(), &headers)?;
    let layer = state
        .catalogue
        .version(&product, own.manifest.as_deref())
        .await?;
    let Some(line) = own.line.as_deref() else {
        return Err(ServerError::Missing {
            name: "line",
            wanted: "LON,LAT;LON,LAT;... in degrees, GeoJSON or WKT text",
        });
    };
    let text = StatisticsText {
        statistic: own.statistic.as_deref(),
        step: own.step.as_deref(),
        min_coverage: own.min_coverage.as_deref(),
        from: own.from.as_deref(),
        to: own.to.as_deref(),
        earth: own.earth.as_deref(),
    };
    let product = layer.manifest.product.clone();
    let query = text.wishes()?.query(product, AskedGeometry::line(line)?);
    answer(&state, &layer, query, form).await
}
