//! `/api/products/{product}/budget`: the carbon a region gave off, by month, by year or in all.

use std::sync::Arc;

use axum::Json;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse as _, Response};
use contract::budget::{BudgetAnswer, BudgetQuery, BudgetStep};
use contract::earth::Earth;
use contract::manifest::Manifest;
use contract::region::Cells;
use serde::Deserialize;
use utoipa::IntoParams;

use crate::error::ServerError;
use crate::extract::{UrlPath, UrlQuery, parsed, time};
use crate::state::AppState;

#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub(crate) struct BudgetParameters {
    /// `global` (the default), a name that `/api/regions` lists, `west,south,east,north` in degrees, GeoJSON or
    /// well-known text.
    region: Option<String>,
    /// First instant, ISO 8601 UTC; the product's own unless one is given.
    from: Option<String>,
    /// First instant after the period; the product's own unless one is given.
    to: Option<String>,
    /// What a row covers; `total` unless told otherwise.
    #[param(value_type = Option<BudgetStep>)]
    step: Option<String>,
    /// Figure of the earth for areas; `wgs84` unless one is given.
    #[param(value_type = Option<Earth>)]
    earth: Option<String>,
    /// How cells on the coast count; `whole` unless told otherwise.
    #[param(value_type = Option<Cells>)]
    cells: Option<String>,
    /// Landed product whose cells say how much of them is sea or land, in place of Natural Earth.
    ocean: Option<String>,
    /// Version, as answers name it; the newest unless one is given.
    manifest: Option<String>,
}

/// The carbon budget of a region: by month, by year or in all, with its coverage and what gaps would add.
#[utoipa::path(
    get,
    path = "/api/products/{product}/budget",
    operation_id = "budget",
    tag = "statistics",
    params(("product" = String, Path, description = "Name of a carbon flux or of accumulated carbon"), BudgetParameters),
    responses((status = 200, description = "One row for each step of time", body = BudgetAnswer)),
)]
pub(crate) async fn get(
    State(state): State<AppState>,
    UrlPath(product): UrlPath<String>,
    UrlQuery(asked): UrlQuery<BudgetParameters>,
) -> Result<Response, ServerError> {
    let named = asked.manifest.as_deref();
    let layer = state.catalogue.version(&product, named).await?;
    let region = asked.region.as_deref().unwrap_or("global");
    let query = BudgetQuery {
        from: time(asked.from.as_deref())?,
        to: time(asked.to.as_deref())?,
        step: parsed(asked.step.as_deref())?.unwrap_or_default(),
        earth: parsed(asked.earth.as_deref())?.unwrap_or_default(),
        cells: parsed(asked.cells.as_deref())?.unwrap_or_default(),
        ocean: ocean(&state, asked.ocean.as_deref()).await?,
        ..BudgetQuery::new(layer.manifest.product.clone(), region.parse()?)
    };
    // What cannot be asked waits for no turn.
    query.steps(&layer.manifest)?;
    let answer = state.analyses.budget(&layer, query).await?;
    Ok(([(header::CACHE_CONTROL, "no-cache")], Json(&*answer)).into_response())
}

/// The newest version of the product that says what is sea.
pub(crate) async fn ocean(
    state: &AppState,
    product: Option<&str>,
) -> Result<Option<Arc<Manifest>>, ServerError> {
    let Some(product) = product else {
        return Ok(None);
    };
    let layer = state.catalogue.version(product, None).await?;
    Ok(Some(Arc::clone(&layer.manifest)))
}
