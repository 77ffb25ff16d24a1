//! `/api/palettes`: the palettes that a look can name, with their colours as legends have them.

use axum::Json;
use contract::colour::Palette;
use serde::Serialize;
use utoipa::ToSchema;

use crate::extract::{NoOthers, UrlQuery};
use crate::openapi::words;
use legend::evenly_placed;

#[derive(Debug, Serialize, ToSchema)]
pub(crate) struct Palettes {
    /// In the order they are offered.
    palettes: Vec<Named>,
}

/// A palette with its colours.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = PaletteColours)]
struct Named {
    /// As the parameter `palette` takes it.
    #[schema(value_type = words::Palette)]
    name: &'static str,
    /// Place from 0 to 1 and colour (`#rrggbb`), straight in between.
    stops: Vec<(f64, String)>,
}

/// Palettes that a look can name.
#[utoipa::path(
    get,
    path = "/api/palettes",
    operation_id = "palettes",
    tag = "catalogue",
    responses(
        (status = 200, description = "All of them", body = Palettes),
        (status = 400, description = "A parameter: there are none", body = crate::error::Refusal),
    ),
)]
pub(crate) async fn list(_no: UrlQuery<NoOthers>) -> Json<Palettes> {
    let named = Palette::ALL.iter().map(|palette| Named {
        name: palette.as_str(),
        stops: evenly_placed(palette.stops().iter()),
    });
    Json(Palettes {
        palettes: named.collect(),
    })
}
