//! Tags of answers that are made when they are asked for, so that who has one already is not sent it again.
//!
//! An answer is the same bytes as long as nothing new landed that it is about: its tag is the digest of them.

use axum::body::{Body, HttpBody as _, to_bytes};
use axum::extract::Request;
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse as _, Response};
use contract::digest::Digest;

use crate::error::ServerError;
use crate::routes::picture::has_tag;

/// Answers that are larger go without a tag.
const MOST_BYTES: u64 = 64 << 20;

/// Gives a tag to each answer that has none and is to be asked for again every time.
pub(crate) async fn tagged(request: Request, next: Next) -> Result<Response, ServerError> {
    // What HEAD is answered with has no bytes to make a tag of, or none of GET's. POST asks here as GET does.
    let is_post = request.method() == Method::POST;
    if request.method() != Method::GET && !is_post {
        return Ok(next.run(request).await);
    }
    let asked: HeaderMap = request.headers().clone();
    let answer = next.run(request).await;
    let is_to_be_asked_again = answer
        .headers()
        .get(header::CACHE_CONTROL)
        .is_some_and(|value| value == "no-cache");
    let length_bytes = answer.body().size_hint().exact();
    if answer.status() != StatusCode::OK
        || !is_to_be_asked_again
        || answer.headers().contains_key(header::ETAG)
        || length_bytes.is_none_or(|bytes| bytes > MOST_BYTES)
    {
        return Ok(answer);
    }
    let (mut parts, body) = answer.into_parts();
    let content = to_bytes(body, MOST_BYTES as usize).await;
    let content = content.map_err(|e| ServerError::Defect {
        what: format!("an answer that was in memory cannot be read: {e}"),
    })?;
    // Weak: it may be sent compressed or not.
    let tag = format!("W/\"{}\"", Digest::of(&content));
    let value = HeaderValue::try_from(&tag).expect("digits are printable");
    if is_post && has_tag(&asked, &tag) {
        // 304 belongs to GET and HEAD (RFC 9110, 13.1.2).
        let mut unchanged = ServerError::Unchanged.into_response();
        unchanged.headers_mut().insert(header::ETAG, value);
        return Ok(unchanged);
    }
    parts.headers.insert(header::ETAG, value);
    if has_tag(&asked, &tag) {
        parts.headers.remove(header::CONTENT_LENGTH);
        parts.headers.remove(header::CONTENT_TYPE);
        return Ok((StatusCode::NOT_MODIFIED, parts.headers).into_response());
    }
    Ok(Response::from_parts(parts, Body::from(content)))
}
