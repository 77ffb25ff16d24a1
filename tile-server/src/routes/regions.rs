//! `/api/regions`: the regions that have a name.

use axum::Json;
use contract::region::NAMED_REGIONS;
use serde::Serialize;

#[derive(Debug, Serialize)]
pub(crate) struct Regions {
    regions: Vec<Named>,
}

#[derive(Debug, Serialize)]
struct Named {
    name: &'static str,
    title: &'static str,
    bounds: [f64; 4],
}

pub(crate) async fn list() -> Json<Regions> {
    let named = NAMED_REGIONS.iter().map(|r| Named {
        name: r.name,
        title: r.title,
        bounds: r.bounds_deg,
    });
    Json(Regions {
        regions: named.collect(),
    })
}
