//! `/api/products`: every product with its steps, modes and legend, as the viewer and people read them.

use axum::Json;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse as _, Response};
use contract::colour::TransferFunction;
use contract::job::{Mode, View};
use contract::listing::ListedProduct;
use contract::picture::{PictureOptions, PictureRequest};
use contract::time::{Period, TimeMs};
use serde::Serialize;
use utoipa::ToSchema;

use crate::catalogue::Layer;
use crate::edition::Edition;
use crate::error::ServerError;
use crate::extract::{NoOthers, UrlQuery};
use crate::openapi::words;
use crate::request::Beside;
use crate::routes::{globe, tiles};
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
    /// Addresses of its pictures in the usual look, one entry a mode; what they answer may be kept for ever.
    pinned: Vec<PinnedAddresses>,
    /// What its own colours mean.
    legend: Legend,
    /// That of the mode flow, where there is one: speeds.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    flow_legend: Option<Legend>,
}

/// Addresses of one mode's pictures that name version and edition, relative to this server. `{time}` is any instant, ISO 8601
/// UTC. TileJSON has those of tiles in any look, `content-location` of a globe view that of the view.
#[derive(Debug, Serialize, ToSchema)]
struct PinnedAddresses {
    /// The mode.
    #[schema(value_type = words::Mode)]
    mode: Mode,
    /// Map tiles, with `{z}`, `{x}` and `{y}`.
    tiles: String,
    /// The globe; parameters of the camera may follow.
    globe: String,
}

impl PinnedAddresses {
    /// None where the parts of a vector do not fit together.
    fn of(layer: &Layer, mode: Mode) -> Option<Self> {
        let product = &layer.manifest.product;
        let query = |options: PictureOptions, views: &[View]| {
            let request = PictureRequest {
                mode,
                view: *views.first()?,
                time: None,
                options,
            };
            let edition = Edition::of(layer, &request, &Beside::default(), views).ok()?;
            Some(edition.parameters("{time}", layer).join("&"))
        };
        let of_tiles = query(PictureOptions::default(), &tiles::reference_views())?;
        let of_globe = query(
            globe::usual_options().ok()?,
            &globe::reference_views().ok()?,
        )?;
        Some(Self {
            mode,
            tiles: format!("/tiles/{product}/{mode}/{{z}}/{{x}}/{{y}}.png?{of_tiles}"),
            globe: format!("/globe/{product}/{mode}.png?{of_globe}"),
        })
    }
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
        (status = 400, description = "A parameter: there are none", body = crate::error::Refusal),
    ),
)]
pub(crate) async fn list(
    State(state): State<AppState>,
    _no: UrlQuery<NoOthers>,
) -> Result<Response, ServerError> {
    let layers = state.catalogue.layers().await?;
    let products = layers.iter().map(|layer| product(layer)).collect();
    // Its tag is of all that it says (`middleware/tag.rs`): another program says other things of the same versions.
    let headers = [(header::CACHE_CONTROL, "no-cache")];
    Ok((headers, Json(Products { products })).into_response())
}

fn product(layer: &Layer) -> Product {
    let manifest = &layer.manifest;
    let modes = layer.modes().iter();
    let pinned = modes.filter_map(|&mode| PinnedAddresses::of(layer, mode));
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
        pinned: pinned.collect(),
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
