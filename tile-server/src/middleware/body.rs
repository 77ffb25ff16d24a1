//! The limit on what may be sent along with a request.
//!
//! Not `tower_http::limit`: it answers in plain text, where every refusal of this server is a `Refusal`.

use axum::extract::{Request, State};
use axum::http::Method;
use axum::middleware::Next;
use axum::response::Response;

use crate::bodies;
use crate::error::ServerError;

/// What an address takes besides its parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Takes {
    Nothing,
    /// By POST.
    Geometries,
}

/// Nothing that is asked with an address alone reads a body; some clients send a few bytes all the same.
const BESIDES_BYTES: u64 = 4096;

/// Refuses requests that announce a large body; those of unknown length are read by nobody but who takes geometries, to a limit.
pub(crate) async fn limit(
    State(takes): State<Takes>,
    request: Request,
    next: Next,
) -> Result<Response, ServerError> {
    let limit_bytes = match takes {
        Takes::Geometries if request.method() == Method::POST => bodies::BODY_BYTES,
        Takes::Geometries | Takes::Nothing => BESIDES_BYTES,
    };
    if bodies::announced(request.headers()).is_some_and(|bytes| bytes > limit_bytes) {
        return Err(ServerError::BodyTooLarge { limit_bytes });
    }
    Ok(next.run(request).await)
}
