//! `/api/palettes`: the palettes that a look can name, with their colours as legends have them.

use axum::Json;
use contract::colour::Palette;
use serde::Serialize;

use crate::legend::evenly_placed;

#[derive(Debug, Serialize)]
pub(crate) struct Palettes {
    palettes: Vec<Named>,
}

#[derive(Debug, Serialize)]
struct Named {
    name: &'static str,
    /// Place and colour, straight in between.
    stops: Vec<(f64, String)>,
}

pub(crate) async fn list() -> Json<Palettes> {
    let named = Palette::ALL.iter().map(|palette| Named {
        name: palette.as_str(),
        stops: evenly_placed(palette.stops().iter()),
    });
    Json(Palettes {
        palettes: named.collect(),
    })
}
