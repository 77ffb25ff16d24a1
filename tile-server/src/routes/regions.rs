//! `/api/regions`: the regions that have a name.

use axum::Json;
use contract::region::NAMED_REGIONS;
use serde::Serialize;
use utoipa::ToSchema;

use crate::extract::{NoOthers, UrlQuery};

#[derive(Debug, Serialize, ToSchema)]
pub(crate) struct Regions {
    /// In the order they are offered.
    regions: Vec<Named>,
}

/// A region with a name.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = Region)]
struct Named {
    /// As the parameter `region` takes it.
    name: &'static str,
    /// For people.
    title: &'static str,
    /// West, south, east, north, degrees; west greater than east crosses the date line.
    #[schema(value_type = (f64, f64, f64, f64))]
    bounds_deg: [f64; 4],
}

/// Regions with a name.
#[utoipa::path(
    get,
    path = "/api/regions",
    operation_id = "regions",
    tag = "catalogue",
    responses(
        (status = 200, description = "All of them", body = Regions),
        (status = 400, description = "A parameter: there are none", body = crate::error::Refusal),
    ),
)]
pub(crate) async fn list(_no: UrlQuery<NoOthers>) -> Json<Regions> {
    let named = NAMED_REGIONS.iter().map(|r| Named {
        name: r.name,
        title: r.title,
        bounds_deg: r.bounds_deg,
    });
    Json(Regions {
        regions: named.collect(),
    })
}
