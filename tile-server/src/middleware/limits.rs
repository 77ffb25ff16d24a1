//! Limits of every request: how long an answer may take, and how much may be sent along.

use std::time::Duration;

use axum::extract::{Request, State};
use axum::http::header;
use axum::middleware::Next;
use axum::response::Response;

use crate::error::ServerError;
use crate::state::AppState;

/// Nothing here reads a body; some clients send a few bytes all the same.
const BODY_BYTES: u64 = 4096;

/// Ends a request that takes too long. What it waited for goes on only if somebody else waits for it too.
pub(crate) async fn time(
    State(state): State<AppState>,
    request: Request,
    next: Next,
) -> Result<Response, ServerError> {
    let limit_s = state.settings.request_limit_s;
    let answer = tokio::time::timeout(Duration::from_secs(limit_s), next.run(request)).await;
    answer.map_err(|_elapsed| ServerError::TimedOut { limit_s })
}

/// Refuses requests that announce a large body; bodies of unknown length are never read.
pub(crate) async fn body(request: Request, next: Next) -> Result<Response, ServerError> {
    let length = request
        .headers()
        .get(header::CONTENT_LENGTH)
        .and_then(|length| length.to_str().ok());
    if length
        .and_then(|length| length.parse::<u64>().ok())
        .is_some_and(|bytes| bytes > BODY_BYTES)
    {
        return Err(ServerError::BodyTooLarge {
            limit_bytes: BODY_BYTES,
        });
    }
    Ok(next.run(request).await)
}
