//! `/api/products/{product}/point`: the series of the cell at a place, in the unit people read; or
//! statistics of it by bins of time.

use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::Response;
use contract::geometry::Sampling;
use contract::grid::LonLatDeg;
use contract::rows::RowsForm;
use contract::series::PointSeries;
use contract::statistics::{PointQuestion, StatisticsWishes};
use contract::time::TimeStep;
use serde::Deserialize;
use utoipa::IntoParams;

use crate::error::ServerError;
use crate::extract::{UrlPath, UrlQuery, number, parsed};
use crate::routes::statistics::{SeriesOrStatistics, StatisticsText, answer, form, response};
use crate::state::AppState;

#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub(crate) struct PointParameters {
    /// Longitude, degrees east, -180 to 360.
    #[param(value_type = f64)]
    lon: Option<String>,
    /// Latitude, degrees north.
    #[param(value_type = f64, minimum = -90, maximum = 90)]
    lat: Option<String>,
    /// Statistics, separated by commas: `mean`, `sum`, `min`, `max`, `std`, `median`, `count`, `coverage`, and percentiles such
    /// as `p90`. With this, `step`, `min_coverage`, `from`, `to` or `sampling` the answer is a `StatisticsAnswer`.
    statistic: Option<String>,
    /// What a row of statistics covers; `native` unless told otherwise.
    #[param(value_type = Option<TimeStep>)]
    step: Option<String>,
    /// Least coverage, percent: rows of statistics with less have no values; 0 unless told otherwise.
    #[param(value_type = Option<f64>, minimum = 0, maximum = 100)]
    min_coverage: Option<String>,
    /// First instant of statistics, ISO 8601 UTC; the product's own unless one is given.
    from: Option<String>,
    /// First instant after the period; the product's own unless one is given.
    to: Option<String>,
    /// What the value at the place is: that of its cell, or bilinear of the four around it; `cell` unless told otherwise.
    #[param(value_type = Option<Sampling>)]
    sampling: Option<String>,
    /// Form of the answer: `json`, or its rows alone as `csv` or `arrow`, a file of Arrow; by the header `Accept` unless one is given.
    #[param(value_type = Option<RowsForm>)]
    format: Option<String>,
    /// Version, as answers name it, with or without its digest; the newest unless one is given.
    manifest: Option<String>,
}

/// The series of the cell at a place.
#[utoipa::path(
    get,
    path = "/api/products/{product}/point",
    operation_id = "point",
    tag = "statistics",
    params(("product" = String, Path, description = "Name of the product"), PointParameters),
    responses((
        status = 200,
        description = "One value for each step; statistics where they are asked for",
        content(
            (inline(SeriesOrStatistics<PointSeries>) = "application/json"),
            (String = "text/csv"),
            ("application/vnd.apache.arrow.file"),
        ),
    )),
)]
pub(crate) async fn get(
    State(state): State<AppState>,
    headers: HeaderMap,
    UrlPath(product): UrlPath<String>,
    UrlQuery(asked): UrlQuery<PointParameters>,
) -> Result<Response, ServerError> {
    let form = form(asked.format.as_deref(), &headers)?;
    let named = asked.manifest.as_deref();
    let layer = state.catalogue.version(&product, named).await?;
    let coordinate = |name, text: &Option<String>, wanted| match text.as_deref() {
        Some(text) => number(name, text, wanted),
        None => Err(ServerError::Missing { name, wanted }),
    };
    let lon = coordinate("lon", &asked.lon, "degrees east")?;
    let lat = coordinate("lat", &asked.lat, "degrees north, -90 to 90")?;
    let place = LonLatDeg::new(lon, lat)?;
    // What cannot be asked waits for no turn.
    layer.manifest.cell_inside(place)?;
    let text = StatisticsText {
        statistic: asked.statistic.as_deref(),
        step: asked.step.as_deref(),
        min_coverage: asked.min_coverage.as_deref(),
        from: asked.from.as_deref(),
        to: asked.to.as_deref(),
        earth: None,
    };
    let wishes = StatisticsWishes {
        sampling: parsed(asked.sampling.as_deref())?,
        ..text.wishes()?
    };
    let product = layer.manifest.product.clone();
    let place = match wishes.at_point(product, place) {
        PointQuestion::Statistics(query) => return answer(&state, &layer, query, form).await,
        PointQuestion::Series(place) => place,
    };
    let content = state.analyses.point(&layer, place, form).await?;
    Ok(response(content, form))
}
