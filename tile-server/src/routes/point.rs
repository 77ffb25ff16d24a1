//! `/api/products/{product}/point`: the series of the cell at a place, in the unit people read.

use axum::Json;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse as _, Response};
use contract::grid::LonLatDeg;
use contract::manifest::ManifestId;
use contract::product::ProductId;
use serde::{Deserialize, Serialize};

use crate::backend::{Contributed, RowCol};
use crate::error::ServerError;
use crate::extract::{UrlPath, UrlQuery, number};
use crate::routes::products::{StepTimes, bounds_deg, rounded};
use crate::state::AppState;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PointQuery {
    lon: Option<String>,
    lat: Option<String>,
    manifest: Option<String>,
}

#[derive(Debug, Serialize)]
struct PointSeries<'a> {
    product: &'a ProductId,
    manifest: &'a ManifestId,
    unit: &'static str,
    lon: f64,
    lat: f64,
    cell: Cell,
    series: Vec<PointValue>,
}

#[derive(Debug, Serialize)]
struct Cell {
    row: u32,
    col: u32,
    lon: f64,
    lat: f64,
}

#[derive(Debug, Serialize)]
struct PointValue {
    #[serde(flatten)]
    times: StepTimes,
    value: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    contributed: Option<Contributed>,
}

pub(crate) async fn get(
    State(state): State<AppState>,
    UrlPath(product): UrlPath<String>,
    UrlQuery(query): UrlQuery<PointQuery>,
) -> Result<Response, ServerError> {
    let named = query.manifest.as_deref();
    let layer = state.catalogue.version(&product, named).await?;
    let manifest = &layer.manifest;
    let coordinate = |name, text: &Option<String>, wanted| match text.as_deref() {
        Some(text) => number(name, text, wanted),
        None => Err(ServerError::Missing { name, wanted }),
    };
    let lon = coordinate("lon", &query.lon, "degrees east")?;
    let lat = coordinate("lat", &query.lat, "degrees north, -90 to 90")?;
    let place = LonLatDeg::new(lon, lat)?;
    let Some((row, col)) = manifest.grid.cell_at(place) else {
        let [west, south, east, north] = bounds_deg(&manifest.grid);
        let covers = format!("longitudes {west} to {east} and latitudes {south} to {north}");
        return Err(ServerError::OutsideGrid {
            product: manifest.product.to_string(),
            lon,
            lat,
            covers,
        });
    };
    let values = state.analyses.point(&layer, RowCol { row, col }).await?;
    let display = manifest.quantity.display();
    let shown = |stored: f64| stored * display.factor + display.offset;
    let series = manifest
        .steps
        .iter()
        .zip(values)
        .map(|(step, own)| PointValue {
            times: step.period.into(),
            value: own.value.map(shown).filter(|value| value.is_finite()),
            contributed: own.contributed,
        });
    let center = manifest.grid.cell_center(row, col);
    let answer = PointSeries {
        product: &manifest.product,
        manifest: &layer.id,
        unit: display.unit,
        lon: rounded(place.lon),
        lat: rounded(place.lat),
        cell: Cell {
            row,
            col,
            lon: rounded(center.lon),
            lat: rounded(center.lat),
        },
        series: series.collect(),
    };
    Ok(([(header::CACHE_CONTROL, "no-cache")], Json(answer)).into_response())
}
