//! `/api/observations/{dataset}/{platform}`: what a buoy, ship, station or profile measured, a page at a time.

use axum::Json;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse as _, Response};
use contract::observation::Quality;
use contract::product::ProductId;
use contract::region::Region;
use contract::time::TimeMs;
use serde::{Deserialize, Serialize};

use crate::backend::ObservationQuestion;
use crate::error::ServerError;
use crate::extract::{UrlPath, UrlQuery, time, whole_number};
use crate::state::AppState;

/// Observations of one answer unless told otherwise, and at most.
const LIMIT: u32 = 2000;
const MOST: u32 = 10_000;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SeriesQuery {
    property: Option<String>,
    from: Option<String>,
    to: Option<String>,
    limit: Option<String>,
    after: Option<String>,
}

#[derive(Debug, Serialize)]
struct Answer {
    dataset: ProductId,
    platform: String,
    series: Vec<Measured>,
    /// What to ask with (`after`) for those after them.
    next: Option<String>,
}

#[derive(Debug, Serialize)]
struct Measured {
    time: TimeMs,
    lon: f64,
    lat: f64,
    depth_m: f64,
    property: String,
    value: f64,
    unit: String,
    quality: Quality,
}

pub(crate) async fn get(
    State(state): State<AppState>,
    UrlPath((dataset, platform)): UrlPath<(String, String)>,
    UrlQuery(query): UrlQuery<SeriesQuery>,
) -> Result<Response, ServerError> {
    let observer = state.observer.get().ok_or(ServerError::NoObservations)?;
    let limit = match query.limit.as_deref() {
        Some(text) => whole_number("limit", text, "1 to 10000")?,
        None => LIMIT,
    };
    if !(1..=MOST).contains(&limit) {
        return Err(ServerError::invalid(
            "limit",
            &limit.to_string(),
            "1 to 10000",
        ));
    }
    let dataset: ProductId = dataset.parse()?;
    let question = ObservationQuestion {
        region: "global".parse::<Region>()?,
        from: time(query.from.as_deref())?,
        to: time(query.to.as_deref())?,
        datasets: vec![dataset.clone()],
        platforms: vec![platform.clone()],
        kinds: vec![],
        properties: query.property.into_iter().collect(),
        worst: Quality::Bad,
        limit,
        after: query.after,
    };
    let page = observer.observations(&question).await?;
    let measured = |o: contract::observation::Observation| Measured {
        time: o.time,
        lon: o.lon_deg,
        lat: o.lat_deg,
        depth_m: o.depth_m,
        property: o.property,
        value: o.value,
        unit: o.unit,
        quality: o.quality,
    };
    let answer = Answer {
        dataset,
        platform,
        series: page.observations.into_iter().map(measured).collect(),
        next: page.next,
    };
    Ok(([(header::CACHE_CONTROL, "no-cache")], Json(answer)).into_response())
}
