//! `/stream`: a WebSocket over which a camera is followed (docs/stream.md).

use axum::extract::State;
use axum::extract::ws::WebSocketUpgrade;
use axum::extract::ws::rejection::WebSocketUpgradeRejection;
use axum::response::Response;

use crate::error::ServerError;
use crate::state::AppState;
use crate::stream::{self, MOST_MESSAGE_BYTES};

/// A WebSocket: states of a camera in, pictures of what it sees out.
///
/// Messages are described in docs/stream.md. A state names a view by its address below `/globe`; the picture of a camera at
/// rest is that view, byte for byte.
#[utoipa::path(
    get,
    path = "/stream",
    operation_id = "stream",
    tag = "pictures",
    responses(
        (status = 101, description = "A WebSocket for as long as both want it"),
        (status = 426, description = "The request asks for no WebSocket"),
    ),
)]
pub(crate) async fn get(
    State(state): State<AppState>,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Result<Response, ServerError> {
    let upgrade = upgrade.map_err(|rejection| ServerError::NoWebSocket {
        reason: rejection.body_text(),
    })?;
    let place = state.streams.take()?;
    Ok(upgrade
        .max_message_size(MOST_MESSAGE_BYTES)
        .max_frame_size(MOST_MESSAGE_BYTES)
        .on_upgrade(move |socket| stream::run(state, socket, place)))
}
