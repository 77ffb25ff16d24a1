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
use utoipa::{IntoParams, ToSchema};

use crate::backend::ObservationQuestion;
use crate::error::ServerError;
use crate::extract::{UrlPath, UrlQuery, time, whole_number};
use crate::openapi::words;
use crate::state::AppState;

/// Observations of one answer unless told otherwise, and at most.
const LIMIT: u32 = 2000;
const MOST: u32 = 10_000;

#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub(crate) struct SeriesQuery {
    /// What was measured, such as `sea_surface_temperature`; everything unless one is given.
    property: Option<String>,
    /// First instant, ISO 8601 UTC.
    from: Option<String>,
    /// First instant after the period.
    to: Option<String>,
    /// Most observations of the answer; 2000 unless told otherwise.
    #[param(value_type = Option<u32>, minimum = 1, maximum = 10000)]
    limit: Option<String>,
    /// Where the answer before ended: its `next`.
    after: Option<String>,
}

/// What a platform measured.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = MeasuredSeries)]
struct Answer {
    /// Data set.
    #[schema(value_type = String)]
    dataset: ProductId,
    /// Name in it.
    platform: String,
    /// In the order of time.
    series: Vec<Measured>,
    /// What to ask with (`after`) for those after them; none where these are the last.
    #[schema(required)]
    next: Option<String>,
}

/// One measurement.
#[derive(Debug, Serialize, ToSchema)]
struct Measured {
    /// When, ISO 8601 UTC.
    #[schema(value_type = String, format = DateTime)]
    time: TimeMs,
    /// Longitude, degrees east, -180 to 180.
    lon: f64,
    /// Latitude, degrees north.
    lat: f64,
    /// Below the sea surface, m; negative above it.
    depth_m: f64,
    /// What was measured: a CF standard name where there is one.
    property: String,
    /// In `unit`.
    value: f64,
    /// In udunits spelling; `1` for plain numbers.
    unit: String,
    /// May it be trusted?
    #[schema(value_type = words::Quality)]
    quality: Quality,
}

/// What a buoy, ship, station or profile measured, a page at a time.
#[utoipa::path(
    get,
    path = "/api/observations/{dataset}/{platform}",
    operation_id = "observations",
    tag = "observations",
    params(
        ("dataset" = String, Path, description = "Data set"),
        ("platform" = String, Path, description = "Name in it"),
        SeriesQuery,
    ),
    responses((status = 200, description = "One page", body = Answer)),
)]
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
