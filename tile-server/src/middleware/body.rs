//! The limit on what may be sent along with a request.
//!
//! Not `tower_http::limit`: it answers in plain text, where every refusal of this server is a `Refusal`.

use axum::extract::Request;
use axum::http::header;
use axum::middleware::Next;
use axum::response::Response;

use crate::error::ServerError;

/// Nothing here reads a body; some clients send a few bytes all the same.
const BODY_BYTES: u64 = 4096;

/// Refuses requests that announce a large body; bodies of unknown length are never read.
pub(crate) async fn limit(request: Request, next: Next) -> Result<Response, ServerError> {
    let length = request.headers().get(header::CONTENT_LENGTH);
    let bytes: Option<u64> = length.and_then(|length| length.to_str().ok()?.parse().ok());
    if bytes.is_some_and(|bytes| bytes > BODY_BYTES) {
        return Err(ServerError::BodyTooLarge {
            limit_bytes: BODY_BYTES,
        });
    }
    Ok(next.run(request).await)
}
