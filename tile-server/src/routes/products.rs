//! `/api/products`: every product with its steps, modes and legend, as the viewer and people read them.

use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse as _, Response};
use contract::colour::TransferFunction;
use contract::digest::Digest;
use contract::grid::Grid;
use contract::job::Mode;
use contract::manifest::ManifestId;
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::time::{Period, TimeMs};
use serde::Serialize;
use utoipa::ToSchema;

use crate::catalogue::Layer;
use crate::error::ServerError;
use crate::legend::Legend;
use crate::openapi::words;
use crate::routes::picture::has_tag;
use crate::state::AppState;

#[derive(Debug, Serialize, ToSchema)]
struct Products<'a> {
    /// By name.
    products: Vec<Product<'a>>,
}

/// One product. `shown = stored * display_factor + display_offset`.
#[derive(Debug, Serialize, ToSchema)]
struct Product<'a> {
    /// Name.
    #[schema(value_type = String)]
    id: &'a ProductId,
    /// For people.
    title: &'a str,
    /// What its values are.
    #[schema(value_type = words::Quantity)]
    quantity: Quantity,
    /// Unit of the stored values.
    unit: &'static str,
    /// Unit that people read: that of series, means and legends.
    display_unit: &'static str,
    /// Display units in a stored unit.
    display_factor: f64,
    /// Display units, added after the factor.
    display_offset: f64,
    /// Made up, not observed.
    synthetic: bool,
    /// Who made it, to be cited.
    source: &'a str,
    /// Its newest version.
    #[schema(value_type = String)]
    manifest: &'a ManifestId,
    /// The version it was computed from; none where it was ingested.
    #[schema(value_type = Option<String>, required)]
    derived_from: Option<&'a ManifestId>,
    /// West, south, east, north, degrees; east may pass 180.
    #[schema(value_type = (f64, f64, f64, f64))]
    bounds: [f64; 4],
    /// In the order of time.
    steps: Vec<StepTimes>,
    /// Ways it can be drawn.
    #[schema(value_type = Vec<words::Mode>)]
    modes: &'static [Mode],
    /// What its own colours mean.
    legend: Legend,
    /// That of the mode flow, where there is one: speeds.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    flow_legend: Option<Legend>,
}

/// When a step holds.
#[derive(Debug, Serialize, ToSchema)]
pub(crate) struct StepTimes {
    /// First instant, ISO 8601 UTC.
    #[schema(value_type = String, format = DateTime)]
    start: TimeMs,
    /// First instant after it.
    #[schema(value_type = String, format = DateTime)]
    end: TimeMs,
    /// Middle.
    #[schema(value_type = String, format = DateTime)]
    mid: TimeMs,
}

impl From<Period> for StepTimes {
    fn from(period: Period) -> Self {
        Self {
            start: period.start,
            end: period.end,
            mid: period.mid(),
        }
    }
}

/// Every product with its newest version, steps, modes and legend.
#[utoipa::path(
    get,
    path = "/api/products",
    operation_id = "products",
    tag = "catalogue",
    responses(
        (status = 200, description = "All products", body = Products<'static>, headers(("etag" = String, description = "Weak; changes with any version"))),
        (status = 304, description = "The copy that `If-None-Match` names is still right"),
    ),
)]
pub(crate) async fn list(
    State(state): State<AppState>,
    asked: HeaderMap,
) -> Result<Response, ServerError> {
    let layers = state.catalogue.layers().await?;
    let names: Vec<_> = layers
        .iter()
        .map(|layer| (&layer.id, layer.accumulated.as_ref().map(|lift| &lift.id)))
        .collect();
    // Weak: the same list may be sent compressed or not.
    let tag = format!("W/\"{}\"", Digest::of_json(&names));
    let headers = [
        (header::ETAG, tag.clone()),
        (header::CACHE_CONTROL, "no-cache".to_owned()),
    ];
    if has_tag(&asked, &tag) {
        return Ok((StatusCode::NOT_MODIFIED, headers).into_response());
    }
    let products = layers.iter().map(|layer| product(layer)).collect();
    Ok((headers, Json(Products { products })).into_response())
}

fn product(layer: &Layer) -> Product<'_> {
    let manifest = &layer.manifest;
    let display = manifest.quantity.display();
    Product {
        id: &manifest.product,
        title: &manifest.title,
        quantity: manifest.quantity,
        unit: manifest.quantity.unit(),
        display_unit: display.unit,
        display_factor: display.factor,
        display_offset: display.offset,
        synthetic: manifest.synthetic,
        source: &manifest.source,
        manifest: &layer.id,
        derived_from: manifest.derived_from.as_ref(),
        bounds: bounds_deg(&manifest.grid),
        steps: manifest
            .steps
            .iter()
            .map(|step| step.period.into())
            .collect(),
        modes: layer.modes(),
        legend: Legend::of(
            manifest.quantity,
            &TransferFunction::default_for(manifest.quantity),
        ),
        flow_legend: layer
            .northward
            .as_ref()
            .map(|_part| Legend::of_speed(manifest.quantity)),
    }
}

/// West, south, east, north of a grid, degrees, without the noise of its steps' sum; east may pass 180.
pub(crate) fn bounds_deg(grid: &Grid) -> [f64; 4] {
    let [west, south, east, north] = grid.bounds_deg().map(rounded);
    [west, south.max(-90.0), east, north.min(90.0)]
}

/// A number for people without the noise that arithmetic adds to it: nine decimals, 0.1 mm for degrees.
pub(crate) fn rounded(number: f64) -> f64 {
    (number * 1e9).round() / 1e9
}
