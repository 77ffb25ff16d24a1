//! `/api/products/{product}/area`: the mean of a product over a region, step by step, with what it is a mean of.

use std::sync::Arc;

use axum::Json;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse as _, Response};
use contract::earth::Earth;
use contract::manifest::ManifestId;
use contract::product::ProductId;
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};

use crate::backend::{AreaRequest, AreaRow};
use crate::error::ServerError;
use crate::extract::{UrlPath, UrlQuery, time};
use crate::openapi::words;
use crate::routes::budget::{ocean, period, region_name};
use crate::routes::products::StepTimes;
use crate::state::AppState;

#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub(crate) struct AreaQuery {
    /// `global`, a name that `/api/regions` lists, `west,south,east,north` in degrees, GeoJSON or well-known text.
    #[param(value_type = String)]
    region: Option<String>,
    /// First instant, ISO 8601 UTC; the product's own unless one is given.
    from: Option<String>,
    /// First instant after the period; the product's own unless one is given.
    to: Option<String>,
    /// Figure of the earth for areas; `wgs84` unless one is given.
    #[param(value_type = Option<words::Earth>)]
    earth: Option<String>,
    /// Landed product whose cells say how much of them is sea or land, in place of Natural Earth.
    ocean: Option<String>,
    /// Version, as answers name it; the newest unless one is given.
    manifest: Option<String>,
}

/// The mean of a product over a region, step by step.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = AreaSeries)]
struct Area<'a> {
    /// Name of the product.
    #[schema(value_type = String)]
    product: &'a ProductId,
    /// Version that was read, to be cited.
    #[schema(value_type = String)]
    manifest: &'a ManifestId,
    /// The region by its name, or as `west,south,east,north`.
    region: String,
    /// Area of the region, land included, m².
    region_area_m2: f64,
    /// Area of the sea in it, m².
    ocean_area_m2: f64,
    /// What said how much of each cell is sea.
    ocean_source: &'a str,
    /// How the region was taken where that may surprise.
    notes: &'a [String],
    /// Figure of the earth for areas.
    #[schema(value_type = words::Earth)]
    earth: Earth,
    /// Unit of the means, the one that people read.
    unit: &'static str,
    /// One value for each step in the period, in the order of time.
    series: Vec<AreaValue>,
}

/// The mean of a step.
#[derive(Debug, Serialize, ToSchema)]
struct AreaValue {
    #[serde(flatten)]
    times: StepTimes,
    /// Over the cells with data, each by its area; none where no cell has any.
    #[schema(required)]
    mean: Option<f64>,
    /// Area with data, m².
    area_m2: f64,
    /// Share of the region's sea with data, percent.
    coverage_percent: f64,
}

impl From<&AreaRow> for AreaValue {
    fn from(row: &AreaRow) -> Self {
        Self {
            times: row.period.into(),
            mean: row.mean.filter(|mean| mean.is_finite()),
            area_m2: row.area_m2,
            coverage_percent: row.coverage_percent,
        }
    }
}

/// The mean over a region at every step, with its coverage.
#[utoipa::path(
    get,
    path = "/api/products/{product}/area",
    operation_id = "area",
    tag = "statistics",
    params(("product" = String, Path, description = "Name of the product"), AreaQuery),
    responses((status = 200, description = "One mean for each step", body = Area<'static>)),
)]
pub(crate) async fn get(
    State(state): State<AppState>,
    UrlPath(product): UrlPath<String>,
    UrlQuery(query): UrlQuery<AreaQuery>,
) -> Result<Response, ServerError> {
    let named = query.manifest.as_deref();
    let layer = state.catalogue.version(&product, named).await?;
    let manifest = &layer.manifest;
    let (from, to) = (time(query.from.as_deref())?, time(query.to.as_deref())?);
    let Some(asked) = query.region.as_deref() else {
        return Err(ServerError::Missing {
            name: "region",
            wanted: "global, a name that /api/regions lists, west,south,east,north in degrees, GeoJSON or WKT text",
        });
    };
    let request = AreaRequest {
        manifest: Arc::clone(manifest),
        region: asked.parse()?,
        period: period(&layer, from, to)?,
        earth: query
            .earth
            .as_deref()
            .map_or(Ok(Earth::default()), str::parse)?,
        ocean: ocean(&state, query.ocean.as_deref()).await?,
    };
    let (region, earth) = (region_name(asked, &request.region), request.earth);
    let series = state.analyses.area(&layer, request).await?;
    let answer = Area {
        product: &manifest.product,
        manifest: &layer.id,
        region,
        region_area_m2: series.region_area_m2,
        ocean_area_m2: series.ocean_area_m2,
        ocean_source: &series.ocean_source,
        notes: &series.notes,
        earth,
        unit: manifest.quantity.display().unit,
        series: series.rows.iter().map(AreaValue::from).collect(),
    };
    Ok(([(header::CACHE_CONTROL, "no-cache")], Json(answer)).into_response())
}
