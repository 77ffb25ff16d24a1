//! `/metrics`: everything in the registry, as Prometheus text.

use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse as _, Response};
use prometheus::{TEXT_FORMAT, TextEncoder};

use crate::error::ServerError;
use crate::state::AppState;

/// Everything that is counted, as Prometheus text.
#[utoipa::path(
    get,
    path = "/metrics",
    operation_id = "metrics",
    tag = "operation",
    responses((status = 200, description = "Prometheus text format 0.0.4", body = String)),
)]
pub(crate) async fn get(State(state): State<AppState>) -> Result<Response, ServerError> {
    let text = TextEncoder::new().encode_to_string(&state.registry.gather());
    let text = text.map_err(|e| ServerError::Defect {
        what: format!("metrics cannot be written: {e}"),
    })?;
    Ok((
        [
            (header::CONTENT_TYPE, TEXT_FORMAT),
            (header::CACHE_CONTROL, "no-store"),
        ],
        text,
    )
        .into_response())
}
