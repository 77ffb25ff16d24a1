//! `/api/products/{product}/hovmoller`: latitude or longitude against time.

use axum::body::Body;
use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::Response;
use contract::analysis::{Hovmoller, HovmollerWishes};
use contract::region::AskedRegion;
use contract::time::TimeStep;
use serde::Deserialize;
use utoipa::IntoParams;

use crate::backend::SeriesQuestion;
use crate::error::ServerError;
use crate::extract::{UrlPath, UrlQuery, left_out, number, parsed, time};
use crate::masks;
use crate::openapi::words::GeoJson;
use crate::routes::analysis::{answer, version};
use crate::state::AppState;

#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub(crate) struct HovmollerParameters {
    /// What bands lie along: `lat` or `lon`.
    #[param(value_type = contract::analysis::Along)]
    along: Option<String>,
    /// Height or width of a band, degrees; no less than a cell; the least of 1, 2, 5, 10 that is so unless given.
    #[param(value_type = Option<f64>)]
    band: Option<String>,
    /// What a row covers; `month` unless told otherwise. `total` is the profile of the bands over all the period.
    #[param(value_type = Option<TimeStep>)]
    step: Option<String>,
    /// `global`, a name that `/api/regions` lists, `west,south,east,north` in degrees, GeoJSON or well-known text, or `MASK:CODE`: the
    /// cells where a landed mask has a code, or what it means, such as `basins:5` or `basins:southern`. Of a box the cells count whose
    /// middles lie in it, of all else every cell by its share; all of the grid unless given.
    region: Option<String>,
    /// Least coverage, percent: means of bands with less are left out, and the answer says how many and what coverage is a share of; 0
    /// unless told otherwise.
    #[param(value_type = Option<f64>, minimum = 0, maximum = 100)]
    min_coverage: Option<String>,
    /// First instant, ISO 8601 UTC; the product's own unless one is given.
    from: Option<String>,
    /// First instant after the period; the product's own unless one is given.
    to: Option<String>,
    /// Figure of the earth for areas; `wgs84` unless one is given.
    #[param(value_type = Option<contract::earth::Earth>)]
    earth: Option<String>,
    /// Version, as answers name it, with or without its digest; the newest unless one is given.
    manifest: Option<String>,
}

/// Means of bands of latitude or longitude, step by step.
#[utoipa::path(
    get,
    path = "/api/products/{product}/hovmoller",
    operation_id = "hovmoller",
    tag = "statistics",
    params(("product" = String, Path, description = "Name of the product"), HovmollerParameters),
    responses((status = 200, description = "One row for each step, one mean in it for each band", body = Hovmoller)),
)]
pub(crate) async fn get(
    State(state): State<AppState>,
    UrlPath(product): UrlPath<String>,
    UrlQuery(asked): UrlQuery<HovmollerParameters>,
) -> Result<Response, ServerError> {
    let (region, _room) = masks::some_region(&state, asked.region.as_deref()).await?;
    answered(&state, &product, &asked, region).await
}

/// The same of a region that is sent along: the answer of GET with its text as `region`.
#[utoipa::path(
    post,
    path = "/api/products/{product}/hovmoller",
    operation_id = "hovmoller_of",
    tag = "statistics",
    params(("product" = String, Path, description = "Name of the product"), HovmollerParameters),
    request_body(
        description = "The region in place of the parameter of that name, as GeoJSON of at most 64 MiB and a million vertices",
        content((GeoJson = "application/geo+json"), (GeoJson = "application/json")),
    ),
    responses((status = 200, description = "One row for each step, one mean in it for each band", body = Hovmoller)),
)]
pub(crate) async fn post(
    State(state): State<AppState>,
    headers: HeaderMap,
    UrlPath(product): UrlPath<String>,
    UrlQuery(asked): UrlQuery<HovmollerParameters>,
    body: Body,
) -> Result<Response, ServerError> {
    left_out(&[("region", asked.region.is_some())])?;
    let sent = state.bodies.take(&headers, body).await?;
    let (region, _room) = sent.read(|text| Ok(text.parse::<AskedRegion>()?)).await?;
    answered(&state, &product, &asked, Some(region)).await
}

async fn answered(
    state: &AppState,
    product: &str,
    asked: &HovmollerParameters,
    region: Option<AskedRegion>,
) -> Result<Response, ServerError> {
    let of = state
        .catalogue
        .version(product, asked.manifest.as_deref())
        .await?;
    let Some(along) = parsed(asked.along.as_deref())? else {
        let (name, wanted) = ("along", "lat or lon");
        return Err(ServerError::Missing { name, wanted });
    };
    let band = asked
        .band
        .as_deref()
        .map(|band| number("band", band, "degrees"));
    let wishes = HovmollerWishes {
        band_deg: band.transpose()?,
        region,
        step: parsed(asked.step.as_deref())?,
        from: time(asked.from.as_deref())?,
        to: time(asked.to.as_deref())?,
        earth: parsed(asked.earth.as_deref())?,
        min_coverage: parsed(asked.min_coverage.as_deref())?,
    };
    let query = wishes.query(of.manifest.product.clone(), along);
    // What cannot be asked waits for no turn.
    of.manifest.steps_inside(query.from, query.to)?;
    let of = version(&of);
    answer(state, SeriesQuestion::Hovmoller { of, query }).await
}
