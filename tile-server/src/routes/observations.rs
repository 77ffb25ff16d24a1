//! `/api/observations/{dataset}/{platform}`: what a buoy, ship, station or profile measured, a page at a time.

use axum::Json;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse as _, Response};
use contract::observation::{Filter, MAX_LIMIT, Page, Quality};
use contract::product::ProductId;
use serde::Deserialize;
use utoipa::IntoParams;

use crate::backend::Observe;
use crate::error::ServerError;
use crate::extract::{UrlPath, UrlQuery, parsed, time, whole_number};
use crate::state::AppState;

/// Observations of one answer unless told otherwise.
const LIMIT: u32 = 2000;

#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub(crate) struct ObservationParameters {
    /// What was measured, such as `sea_surface_temperature`; everything unless one is given.
    property: Option<String>,
    /// First instant, ISO 8601 UTC.
    from: Option<String>,
    /// First instant after the period.
    to: Option<String>,
    /// Worst quality that is still wanted; all are unless one is given.
    #[param(value_type = Option<Quality>)]
    worst: Option<String>,
    /// Most observations of the answer; 2000 unless told otherwise.
    #[param(value_type = Option<u32>, minimum = 1, maximum = 10000)]
    limit: Option<String>,
    /// Where the answer before ended: its `next`.
    after: Option<String>,
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
        ObservationParameters,
    ),
    responses((status = 200, description = "One page", body = Page)),
)]
pub(crate) async fn get(
    State(state): State<AppState>,
    UrlPath((dataset, platform)): UrlPath<(String, String)>,
    UrlQuery(asked): UrlQuery<ObservationParameters>,
) -> Result<Response, ServerError> {
    let observer = state.observer.get().ok_or(ServerError::NoObservations)?;
    let dataset: ProductId = dataset.parse()?;
    let limit = match asked.limit.as_deref() {
        Some(text) => whole_number("limit", text, "1 to 10000")?,
        None => LIMIT,
    };
    if !(1..=MAX_LIMIT).contains(&limit) {
        return Err(ServerError::invalid(
            "limit",
            &limit.to_string(),
            "1 to 10000",
        ));
    }
    let filter = Filter {
        from: time(asked.from.as_deref())?,
        to: time(asked.to.as_deref())?,
        datasets: vec![dataset.clone()],
        platforms: vec![platform],
        properties: asked.property.into_iter().collect(),
        worst: parsed(asked.worst.as_deref())?.unwrap_or(Quality::Bad),
        limit,
        after: asked.after,
        ..Filter::default()
    };
    let _pass = state
        .observing
        .enter()
        .await
        .inspect_err(|_busy| state.metrics.refused.inc())?;
    let page = observer.observations(&filter).await?;
    if page.observations.is_empty() {
        check_dataset(observer.as_ref(), &dataset).await?;
    }
    Ok(([(header::CACHE_CONTROL, "no-cache")], Json(page)).into_response())
}

/// # Errors
/// There are no observations of this data set; those that there are.
pub(crate) async fn check_dataset(
    observer: &dyn Observe,
    dataset: &ProductId,
) -> Result<(), ServerError> {
    let known = observer.datasets().await?;
    if known.contains(dataset) {
        return Ok(());
    }
    Err(ServerError::UnknownDataset {
        name: dataset.clone(),
        known,
    })
}
