//! What the layer that compresses leaves unsaid: why nothing is sent, and that a copy is of one of two answers.

use axum::BoxError;
use axum::body::{Body, Bytes, HttpBody};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse as _, Response};

use crate::error::ServerError;

/// An answer as that layer gives it, with what it has not told.
pub(crate) fn told<B>(answer: axum::http::Response<B>) -> Response
where
    B: HttpBody<Data = Bytes> + Send + 'static,
    B::Error: Into<BoxError>,
{
    let status = answer.status();
    let mut answer = match status {
        // Nobody else answers so: it is any answer, whole, with another status.
        StatusCode::NOT_ACCEPTABLE => ServerError::NoEncoding.into_response(),
        _ => answer.map(Body::new),
    };
    let is_told_apart = match status {
        StatusCode::NOT_ACCEPTABLE => true,
        // What was sent may have been compressed, of which an answer without a body shows nothing (RFC 9110, 15.4.5).
        StatusCode::NOT_MODIFIED => !has_strong_tag(answer.headers()),
        _ => false,
    };
    if is_told_apart {
        let by = HeaderValue::from_static("accept-encoding");
        answer.headers_mut().append(header::VARY, by);
    }
    answer
}

/// Is it the same byte for byte, compressed for nobody?
fn has_strong_tag(headers: &HeaderMap) -> bool {
    let tag = headers.get(header::ETAG);
    tag.is_some_and(|tag| tag.as_bytes().starts_with(b"\""))
}
