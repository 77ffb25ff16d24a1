//! `/api/products/{product}/point`: the series of the cell at a place, in the unit people read.

use axum::Json;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse as _, Response};
use contract::grid::LonLatDeg;
use contract::manifest::ManifestId;
use contract::product::ProductId;
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};

use crate::backend::{Contributed, RowCol};
use crate::error::ServerError;
use crate::extract::{UrlPath, UrlQuery, number};
use crate::routes::products::{StepTimes, bounds_deg, rounded};
use crate::state::AppState;

#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub(crate) struct PointQuery {
    /// Longitude, degrees east, -180 to 360.
    #[param(value_type = f64)]
    lon: Option<String>,
    /// Latitude, degrees north.
    #[param(value_type = f64, minimum = -90, maximum = 90)]
    lat: Option<String>,
    /// Version, as answers name it; the newest unless one is given.
    manifest: Option<String>,
}

/// The series of a cell.
#[derive(Debug, Serialize, ToSchema)]
struct PointSeries<'a> {
    /// Name of the product.
    #[schema(value_type = String)]
    product: &'a ProductId,
    /// Version that was read, to be cited.
    #[schema(value_type = String)]
    manifest: &'a ManifestId,
    /// Unit of the values, the one that people read.
    unit: &'static str,
    /// Longitude that was asked for, degrees east.
    lon: f64,
    /// Latitude that was asked for, degrees north.
    lat: f64,
    /// The cell that the place lies in.
    cell: Cell,
    /// One value for each step, in the order of time.
    series: Vec<PointValue>,
}

/// A cell of a product's grid.
#[derive(Debug, Serialize, ToSchema)]
struct Cell {
    /// Row, 0 is the northernmost.
    row: u32,
    /// Column, eastwards.
    col: u32,
    /// Longitude of its centre, degrees east.
    lon: f64,
    /// Latitude of its centre, degrees north.
    lat: f64,
}

/// The value of a step.
#[derive(Debug, Serialize, ToSchema)]
struct PointValue {
    #[serde(flatten)]
    times: StepTimes,
    /// None where there is no data.
    #[schema(required)]
    value: Option<f64>,
    /// What a sum of accumulated carbon holds; only where it is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    contributed: Option<Contributed>,
}

/// The series of the cell at a place.
#[utoipa::path(
    get,
    path = "/api/products/{product}/point",
    operation_id = "point",
    tag = "statistics",
    params(("product" = String, Path, description = "Name of the product"), PointQuery),
    responses((status = 200, description = "One value for each step", body = PointSeries<'static>)),
)]
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
