//! `/api/products/{product}/area`: the mean of a product over a region, step by step, with what it is a mean of; or other
//! statistics of it.

use axum::body::Body;
use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::Response;
use contract::earth::Earth;
use contract::region::{AskedRegion, Cells};
use contract::rows::RowsForm;
use contract::series::RegionSeries;
use contract::statistics::{RegionQuestion, StatisticsWishes};
use contract::time::TimeStep;
use serde::Deserialize;
use utoipa::IntoParams;

use crate::error::ServerError;
use crate::extract::{UrlPath, UrlQuery, left_out, parsed};
use crate::masks;
use crate::openapi::words::GeoJson;
use crate::routes::budget::ocean;
use crate::routes::statistics::{SeriesOrStatistics, StatisticsText, answer, form, response};
use crate::state::AppState;

#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub(crate) struct AreaParameters {
    /// `global`, a name that `/api/regions` lists, `west,south,east,north` in degrees, GeoJSON or well-known text, or `MASK:CODE`: the
    /// cells where a landed mask has a code, or what it means, such as `basins:5` or `basins:southern`.
    #[param(value_type = String)]
    region: Option<String>,
    /// First instant, ISO 8601 UTC; the product's own unless one is given.
    from: Option<String>,
    /// First instant after the period; the product's own unless one is given.
    to: Option<String>,
    /// Figure of the earth for areas; `wgs84` unless one is given.
    #[param(value_type = Option<Earth>)]
    earth: Option<String>,
    /// Landed product whose cells say how much of them is sea or land, in place of Natural Earth.
    ocean: Option<String>,
    /// Statistics, separated by commas: `mean`, `sum`, `min`, `max`, `std`, `median`, `count`, `coverage`, and percentiles such
    /// as `p90`. With this, `step` or `min_coverage` the answer is a `StatisticsAnswer`.
    statistic: Option<String>,
    /// What a row of statistics covers; `native` unless told otherwise.
    #[param(value_type = Option<TimeStep>)]
    step: Option<String>,
    /// Least coverage, percent: rows of statistics with less have no values; 0 unless told otherwise.
    #[param(value_type = Option<f64>, minimum = 0, maximum = 100)]
    min_coverage: Option<String>,
    /// How cells on the coast count in statistics; `whole` unless told otherwise.
    #[param(value_type = Option<Cells>)]
    cells: Option<String>,
    /// Form of the answer: `json`, or its rows alone as `csv` or `arrow`, a file of Arrow; by the header `Accept` unless one is given.
    #[param(value_type = Option<RowsForm>)]
    format: Option<String>,
    /// Version, as answers name it, with or without its digest; the newest unless one is given.
    manifest: Option<String>,
}

/// The mean over a region at every step, with its coverage.
#[utoipa::path(
    get,
    path = "/api/products/{product}/area",
    operation_id = "area",
    tag = "statistics",
    params(("product" = String, Path, description = "Name of the product"), AreaParameters),
    responses((
        status = 200,
        description = "One mean for each step; statistics where they are asked for",
        content(
            (inline(SeriesOrStatistics<RegionSeries>) = "application/json"),
            (String = "text/csv"),
            ("application/vnd.apache.arrow.file"),
        ),
    )),
)]
pub(crate) async fn get(
    State(state): State<AppState>,
    headers: HeaderMap,
    UrlPath(product): UrlPath<String>,
    UrlQuery(asked): UrlQuery<AreaParameters>,
) -> Result<Response, ServerError> {
    let Some(region) = asked.region.as_deref() else {
        return Err(ServerError::Missing {
            name: "region",
            wanted: "global, a name that /api/regions lists, west,south,east,north in degrees, GeoJSON or WKT text, or MASK:CODE",
        });
    };
    let (region, _room) = masks::region(&state, region).await?;
    answered(&state, &headers, &product, &asked, region).await
}

/// The same of a region that is sent along: the answer of GET with its text as `region`.
#[utoipa::path(
    post,
    path = "/api/products/{product}/area",
    operation_id = "area_of",
    tag = "statistics",
    params(("product" = String, Path, description = "Name of the product"), AreaParameters),
    request_body(
        description = "The region in place of the parameter of that name, as GeoJSON of at most 64 MiB and a million vertices",
        content((GeoJson = "application/geo+json"), (GeoJson = "application/json")),
    ),
    responses((
        status = 200,
        description = "One mean for each step; statistics where they are asked for",
        content(
            (inline(SeriesOrStatistics<RegionSeries>) = "application/json"),
            (String = "text/csv"),
            ("application/vnd.apache.arrow.file"),
        ),
    )),
)]
pub(crate) async fn post(
    State(state): State<AppState>,
    headers: HeaderMap,
    UrlPath(product): UrlPath<String>,
    UrlQuery(asked): UrlQuery<AreaParameters>,
    body: Body,
) -> Result<Response, ServerError> {
    left_out(&[("region", asked.region.is_some())])?;
    let sent = state.bodies.take(&headers, body).await?;
    let (region, _room) = sent.read(|text| Ok(text.parse::<AskedRegion>()?)).await?;
    answered(&state, &headers, &product, &asked, region).await
}

async fn answered(
    state: &AppState,
    headers: &HeaderMap,
    product: &str,
    asked: &AreaParameters,
    region: AskedRegion,
) -> Result<Response, ServerError> {
    let form = form(asked.format.as_deref(), headers)?;
    let named = asked.manifest.as_deref();
    let layer = state.catalogue.version(product, named).await?;
    let text = StatisticsText {
        statistic: asked.statistic.as_deref(),
        step: asked.step.as_deref(),
        min_coverage: asked.min_coverage.as_deref(),
        from: asked.from.as_deref(),
        to: asked.to.as_deref(),
        earth: asked.earth.as_deref(),
    };
    let wishes = StatisticsWishes {
        cells: parsed(asked.cells.as_deref())?,
        ocean: ocean(state, asked.ocean.as_deref()).await?,
        ..text.wishes()?
    };
    let product = layer.manifest.product.clone();
    let query = match wishes.over_region(product, region) {
        RegionQuestion::Statistics(query) => return answer(state, &layer, query, form).await,
        RegionQuestion::Series(query) => query,
    };
    // What cannot be asked waits for no turn.
    layer.manifest.steps_inside(query.from, query.to)?;
    let content = state.analyses.area(&layer, query, form).await?;
    Ok(response(content, form))
}
