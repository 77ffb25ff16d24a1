//! `/api/products/{product}/hovmoller`: latitude or longitude against time.

use axum::extract::State;
use axum::response::Response;
use contract::analysis::{Hovmoller, HovmollerWishes};
use contract::time::TimeStep;
use serde::Deserialize;
use utoipa::IntoParams;

use crate::backend::SeriesQuestion;
use crate::error::ServerError;
use crate::extract::{UrlPath, UrlQuery, number, parsed, time};
use crate::routes::analysis::{answer, version};
use crate::state::AppState;

#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub(crate) struct HovmollerParameters {
    /// What bands lie along: `lat` or `lon`.
    #[param(value_type = contract::analysis::Along)]
    along: Option<String>,
    /// Height or width of a band, degrees; the least of 1, 2, 5, 10 that is no less than a cell unless given.
    #[param(value_type = Option<f64>)]
    band: Option<String>,
    /// What a row covers; `month` unless told otherwise. `total` is the profile of the bands over all the period.
    #[param(value_type = Option<TimeStep>)]
    step: Option<String>,
    /// `global`, a named region that is a box, or `west,south,east,north` in degrees: cells whose middles lie in it; all of
    /// the grid unless given.
    region: Option<String>,
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
    let of = state
        .catalogue
        .version(&product, asked.manifest.as_deref())
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
        region: parsed(asked.region.as_deref())?,
        step: parsed(asked.step.as_deref())?,
        from: time(asked.from.as_deref())?,
        to: time(asked.to.as_deref())?,
        earth: parsed(asked.earth.as_deref())?,
    };
    let query = wishes.query(of.manifest.product.clone(), along)?;
    // What cannot be asked waits for no turn.
    of.manifest.steps_inside(query.from, query.to)?;
    let of = version(&of);
    answer(&state, SeriesQuestion::Hovmoller { of, query }).await
}
