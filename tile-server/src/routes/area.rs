//! `/api/products/{product}/area`: the mean of a product over a region, step by step, with what it is a mean of.

use axum::Json;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse as _, Response};
use contract::earth::Earth;
use contract::series::{RegionSeries, RegionSeriesQuery};
use serde::Deserialize;
use utoipa::IntoParams;

use crate::error::ServerError;
use crate::extract::{UrlPath, UrlQuery, parsed, time};
use crate::routes::budget::ocean;
use crate::state::AppState;

#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub(crate) struct AreaParameters {
    /// `global`, a name that `/api/regions` lists, `west,south,east,north` in degrees, GeoJSON or well-known text.
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
    /// Version, as answers name it; the newest unless one is given.
    manifest: Option<String>,
}

/// The mean over a region at every step, with its coverage.
#[utoipa::path(
    get,
    path = "/api/products/{product}/area",
    operation_id = "area",
    tag = "statistics",
    params(("product" = String, Path, description = "Name of the product"), AreaParameters),
    responses((status = 200, description = "One mean for each step", body = RegionSeries)),
)]
pub(crate) async fn get(
    State(state): State<AppState>,
    UrlPath(product): UrlPath<String>,
    UrlQuery(asked): UrlQuery<AreaParameters>,
) -> Result<Response, ServerError> {
    let named = asked.manifest.as_deref();
    let layer = state.catalogue.version(&product, named).await?;
    let Some(region) = asked.region.as_deref() else {
        return Err(ServerError::Missing {
            name: "region",
            wanted: "global, a name that /api/regions lists, west,south,east,north in degrees, GeoJSON or WKT text",
        });
    };
    let query = RegionSeriesQuery {
        from: time(asked.from.as_deref())?,
        to: time(asked.to.as_deref())?,
        earth: parsed(asked.earth.as_deref())?.unwrap_or_default(),
        ocean: ocean(&state, asked.ocean.as_deref()).await?,
        ..RegionSeriesQuery::new(layer.manifest.product.clone(), region.parse()?)
    };
    // What cannot be asked waits for no turn.
    layer.manifest.steps_inside(query.from, query.to)?;
    let series = state.analyses.area(&layer, query).await?;
    Ok(([(header::CACHE_CONTROL, "no-cache")], Json(&*series)).into_response())
}
