//! `/api/products`: every product with its steps, modes and legend, as the viewer and people read them.

use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse as _, Response};
use contract::colour::TransferFunction;
use contract::digest::Digest;
use contract::job::Mode;
use contract::listing::ListedProduct;
use contract::time::{Period, TimeMs};
use serde::Serialize;
use utoipa::ToSchema;

use crate::catalogue::Layer;
use crate::error::ServerError;
use crate::openapi::words;
use crate::routes::picture::has_tag;
use crate::state::AppState;
use legend::Legend;

#[derive(Debug, Serialize, ToSchema)]
struct Products {
    /// By name.
    products: Vec<Product>,
}

/// One product, with what it takes to show it: `shown = stored * display_factor + display_offset`.
#[derive(Debug, Serialize, ToSchema)]
struct Product {
    #[serde(flatten)]
    listed: ListedProduct,
    /// Unit of the stored values.
    stored_unit: &'static str,
    /// Shown units in a stored unit.
    display_factor: f64,
    /// Shown units, added after the factor.
    display_offset: f64,
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
struct StepTimes {
    /// First instant.
    start: TimeMs,
    /// First instant after it.
    end: TimeMs,
    /// Middle.
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
        (status = 200, description = "All products", body = Products, headers(("etag" = String, description = "Weak; changes with any version"))),
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

fn product(layer: &Layer) -> Product {
    let manifest = &layer.manifest;
    let display = manifest.quantity.display();
    Product {
        listed: ListedProduct::of(manifest, layer.id.clone()),
        stored_unit: manifest.quantity.unit(),
        display_factor: display.factor,
        display_offset: display.offset,
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
