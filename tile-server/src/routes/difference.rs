//! `/api/products/{product}/difference`: the mean of two periods, versions or products, one less the other.

use axum::body::Body;
use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::Response;
use contract::analysis::{Difference, DifferenceWishes};
use serde::Deserialize;
use utoipa::IntoParams;

use crate::backend::SeriesQuestion;
use crate::error::ServerError;
use crate::extract::{UrlPath, UrlQuery, parsed};
use crate::openapi::words::GeoJson;
use crate::routes::analysis::{PlaceText, SentPlace, SeriesText, answer, version};
use crate::state::AppState;

#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub(crate) struct DifferenceParameters {
    /// Years, both part of it: `2001/2005`; all that are covered unless given.
    period: Option<String>,
    /// Version, as answers name it, with or without its digest; the newest unless one is given.
    manifest: Option<String>,
    /// Product that is taken off; the same one unless given.
    minus: Option<String>,
    /// Its years; the same ones unless given.
    minus_period: Option<String>,
    /// Its version; the newest unless one is given.
    minus_manifest: Option<String>,
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
    /// Figure of the earth for areas and lengths, of a region or a line; `wgs84` unless one is given.
    #[param(value_type = Option<contract::earth::Earth>)]
    earth: Option<String>,
}

impl DifferenceParameters {
    fn place(&self) -> PlaceText<'_> {
        PlaceText {
            lon: self.lon.as_deref(),
            lat: self.lat.as_deref(),
            region: self.region.as_deref(),
            line: self.line.as_deref(),
        }
    }
}

/// The mean over time of one product, version or period less that of another, with its standard error.
#[utoipa::path(
    get,
    path = "/api/products/{product}/difference",
    operation_id = "difference",
    tag = "statistics",
    params(("product" = String, Path, description = "Name of the product"), DifferenceParameters),
    responses((status = 200, description = "Both means and their difference", body = Difference)),
)]
pub(crate) async fn get(
    State(state): State<AppState>,
    UrlPath(product): UrlPath<String>,
    UrlQuery(asked): UrlQuery<DifferenceParameters>,
) -> Result<Response, ServerError> {
    answered(&state, &product, &asked, None).await
}

/// The same of a region or a line that is sent along: the answer of GET with its text as `region` or `line`.
#[utoipa::path(
    post,
    path = "/api/products/{product}/difference",
    operation_id = "difference_of",
    tag = "statistics",
    params(("product" = String, Path, description = "Name of the product"), DifferenceParameters),
    request_body(
        description = "The region, or the line, in place of the parameter of that name, as GeoJSON of at most 64 MiB and a million vertices",
        content((GeoJson = "application/geo+json"), (GeoJson = "application/json")),
    ),
    responses((status = 200, description = "Both means and their difference", body = Difference)),
)]
pub(crate) async fn post(
    State(state): State<AppState>,
    headers: HeaderMap,
    UrlPath(product): UrlPath<String>,
    UrlQuery(asked): UrlQuery<DifferenceParameters>,
    body: Body,
) -> Result<Response, ServerError> {
    let (sent, _room) = SentPlace::take(&state, &asked.place(), &headers, body).await?;
    answered(&state, &product, &asked, Some(sent)).await
}

async fn answered(
    state: &AppState,
    product: &str,
    asked: &DifferenceParameters,
    sent: Option<SentPlace>,
) -> Result<Response, ServerError> {
    let of = state
        .catalogue
        .version(product, asked.manifest.as_deref())
        .await?;
    let other = asked.minus.as_deref().unwrap_or(product);
    let minus = state
        .catalogue
        .version(other, asked.minus_manifest.as_deref())
        .await?;
    let series = SeriesText {
        place: asked.place(),
        period: [None, None],
        earth: asked.earth.as_deref(),
        ocean: None,
        sent,
    };
    let (series, _room) = series.query(state, &of).await?;
    let wishes = DifferenceWishes {
        period: parsed(asked.period.as_deref())?,
        minus_period: parsed(asked.minus_period.as_deref())?,
    };
    let [series, other] = wishes.sides(&series, minus.manifest.product.clone());
    let question = SeriesQuestion::Difference {
        of: (version(&of), series),
        minus: (version(&minus), other),
        min_coverage: parsed(asked.min_coverage.as_deref())?.unwrap_or_default(),
    };
    answer(state, question).await
}
