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

use crate::backend::{AreaRequest, AreaRow};
use crate::error::ServerError;
use crate::extract::{UrlPath, UrlQuery, time};
use crate::routes::budget::{ocean, period, region_name};
use crate::routes::products::StepTimes;
use crate::state::AppState;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct AreaQuery {
    region: Option<String>,
    from: Option<String>,
    to: Option<String>,
    earth: Option<String>,
    ocean: Option<String>,
    manifest: Option<String>,
}

#[derive(Debug, Serialize)]
struct Area<'a> {
    product: &'a ProductId,
    manifest: &'a ManifestId,
    region: String,
    region_area_m2: f64,
    ocean_area_m2: f64,
    ocean_source: &'a str,
    notes: &'a [String],
    earth: Earth,
    unit: &'static str,
    series: Vec<AreaValue>,
}

#[derive(Debug, Serialize)]
struct AreaValue {
    #[serde(flatten)]
    times: StepTimes,
    mean: Option<f64>,
    area_m2: f64,
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
