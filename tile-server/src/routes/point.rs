//! `/api/products/{product}/point`: the series of the cell at a place, in the unit people read.

use axum::Json;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse as _, Response};
use contract::grid::LonLatDeg;
use contract::series::PointSeries;
use serde::Deserialize;
use utoipa::IntoParams;

use crate::error::ServerError;
use crate::extract::{UrlPath, UrlQuery, number};
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
    /// Version, as answers name it; the newest unless one is given.
    manifest: Option<String>,
}

/// The series of the cell at a place.
#[utoipa::path(
    get,
    path = "/api/products/{product}/point",
    operation_id = "point",
    tag = "statistics",
    params(("product" = String, Path, description = "Name of the product"), PointParameters),
    responses((status = 200, description = "One value for each step", body = PointSeries)),
)]
pub(crate) async fn get(
    State(state): State<AppState>,
    UrlPath(product): UrlPath<String>,
    UrlQuery(asked): UrlQuery<PointParameters>,
) -> Result<Response, ServerError> {
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
    let series = state.analyses.point(&layer, place).await?;
    Ok(([(header::CACHE_CONTROL, "no-cache")], Json(series)).into_response())
}
