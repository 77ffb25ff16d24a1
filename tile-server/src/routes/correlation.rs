//! `/api/products/{product}/correlation`: how the series of two products go together, now and later.

use axum::body::Body;
use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::Response;
use contract::analysis::{Correlation, CorrelationWishes};
use contract::time::TimeStep;
use serde::Deserialize;
use utoipa::IntoParams;

use crate::backend::SeriesQuestion;
use crate::error::ServerError;
use crate::extract::{UrlPath, UrlQuery, parsed, whole_number};
use crate::openapi::words::GeoJson;
use crate::routes::analysis::{PlaceText, SentPlace, SeriesText, answer, version};
use crate::state::AppState;

#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub(crate) struct CorrelationParameters {
    /// The second product.
    #[param(value_type = String)]
    with: Option<String>,
    /// Most steps that one is moved against the other, 0 (the default) to 400.
    #[param(value_type = Option<u32>, maximum = 400)]
    max_lag: Option<String>,
    /// What they are compared in; `month` unless told otherwise. For `native` both need the same periods.
    #[param(value_type = Option<TimeStep>)]
    step: Option<String>,
    /// `true`: the mean of each calendar month is taken off both first.
    #[param(value_type = Option<bool>)]
    deseasonalise: Option<String>,
    /// Least coverage, percent: steps of either that hold data over less of the region's sea, or of the line, are left out, and the answer
    /// says how many; 0 unless told otherwise.
    #[param(value_type = Option<f64>, minimum = 0, maximum = 100)]
    min_coverage: Option<String>,
    /// Longitude of a cell, degrees east, -180 to 360; with `lat`, in place of a region.
    #[param(value_type = Option<f64>)]
    lon: Option<String>,
    /// Latitude of a cell, degrees north.
    #[param(value_type = Option<f64>, minimum = -90, maximum = 90)]
    lat: Option<String>,
    /// `global`, a name that `/api/regions` lists, `west,south,east,north` in degrees, GeoJSON or well-known text, or `MASK:CODE`: the
    /// cells where a landed mask has a code, or what it means, such as `basins:5` or `basins:southern`.
    region: Option<String>,
    /// `LON,LAT;LON,LAT;...` in degrees, GeoJSON or well-known text, in place of a region: the mean along a line, each cell by the length
    /// in it.
    line: Option<String>,
    /// First instant, ISO 8601 UTC; the products' own unless one is given.
    from: Option<String>,
    /// First instant after the period; the products' own unless one is given.
    to: Option<String>,
    /// Figure of the earth for areas and lengths, of a region or a line; `wgs84` unless one is given.
    #[param(value_type = Option<contract::earth::Earth>)]
    earth: Option<String>,
    /// Version, as answers name it, with or without its digest; the newest unless one is given.
    manifest: Option<String>,
    /// Version of the second product; the newest unless one is given.
    with_manifest: Option<String>,
}

impl CorrelationParameters {
    fn place(&self) -> PlaceText<'_> {
        PlaceText {
            lon: self.lon.as_deref(),
            lat: self.lat.as_deref(),
            region: self.region.as_deref(),
            line: self.line.as_deref(),
        }
    }
}

/// The correlation of two products over a region, along a line or at a place, at every lag.
#[utoipa::path(
    get,
    path = "/api/products/{product}/correlation",
    operation_id = "correlation",
    tag = "statistics",
    params(("product" = String, Path, description = "Name of the first product"), CorrelationParameters),
    responses((status = 200, description = "One row for each lag", body = Correlation)),
)]
pub(crate) async fn get(
    State(state): State<AppState>,
    UrlPath(product): UrlPath<String>,
    UrlQuery(asked): UrlQuery<CorrelationParameters>,
) -> Result<Response, ServerError> {
    answered(&state, &product, &asked, None).await
}

/// The same of a region or a line that is sent along: the answer of GET with its text as `region` or `line`.
#[utoipa::path(
    post,
    path = "/api/products/{product}/correlation",
    operation_id = "correlation_of",
    tag = "statistics",
    params(("product" = String, Path, description = "Name of the first product"), CorrelationParameters),
    request_body(
        description = "The region, or the line, in place of the parameter of that name, as GeoJSON of at most 64 MiB and a million vertices",
        content((GeoJson = "application/geo+json"), (GeoJson = "application/json")),
    ),
    responses((status = 200, description = "One row for each lag", body = Correlation)),
)]
pub(crate) async fn post(
    State(state): State<AppState>,
    headers: HeaderMap,
    UrlPath(product): UrlPath<String>,
    UrlQuery(asked): UrlQuery<CorrelationParameters>,
    body: Body,
) -> Result<Response, ServerError> {
    let (sent, _room) = SentPlace::take(&state, &asked.place(), &headers, body).await?;
    answered(&state, &product, &asked, Some(sent)).await
}

async fn answered(
    state: &AppState,
    product: &str,
    asked: &CorrelationParameters,
    sent: Option<SentPlace>,
) -> Result<Response, ServerError> {
    let of = state
        .catalogue
        .version(product, asked.manifest.as_deref())
        .await?;
    let Some(with) = asked.with.as_deref() else {
        let (name, wanted) = ("with", "the name of a second product");
        return Err(ServerError::Missing { name, wanted });
    };
    let with = state
        .catalogue
        .version(with, asked.with_manifest.as_deref())
        .await?;
    let series = SeriesText {
        place: asked.place(),
        period: [asked.from.as_deref(), asked.to.as_deref()],
        earth: asked.earth.as_deref(),
        ocean: None,
        sent,
    };
    let (series, _room) = series.query(state, &of).await?;
    let max_lag = asked.max_lag.as_deref();
    let wishes = CorrelationWishes {
        step: parsed(asked.step.as_deref())?,
        deseasonalise: match asked.deseasonalise.as_deref() {
            None => None,
            Some("false") => Some(false),
            Some("true") => Some(true),
            Some(other) => {
                let valid = "true or false";
                return Err(ServerError::invalid("deseasonalise", other, valid));
            }
        },
        max_lag: max_lag
            .map(|text| whole_number("max_lag", text, "a whole number, 0 to 400"))
            .transpose()?,
        min_coverage: parsed(asked.min_coverage.as_deref())?,
    };
    let query = wishes.query(series, with.manifest.product.clone())?;
    let (of, with) = (version(&of), version(&with));
    answer(state, SeriesQuestion::Correlation { of, with, query }).await
}
