//! A render job as an answer: the PNG, or "your copy is still right", with the headers caches go by.

use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse as _, Response};
use contract::job::RenderJob;

use crate::error::ServerError;
use crate::metrics::Source;
use crate::state::AppState;

/// An address means "the newest version", so a copy may be used unasked only as long as nobody minds a late change.
const CACHE_CONTROL: &str = "public, max-age=60";

/// The picture of a job. The entity tag is the job's digest: the same job is the same picture, byte for byte, so a
/// client that has it is answered without drawing or reading anything.
pub(crate) async fn respond(
    state: &AppState,
    asked: &HeaderMap,
    job: RenderJob,
) -> Result<Response, ServerError> {
    let tag = format!("\"{}\"", job.digest());
    let headers = [
        (header::ETAG, tag.clone()),
        (header::CACHE_CONTROL, CACHE_CONTROL.to_owned()),
    ];
    if has_tag(asked, &tag) {
        state.metrics.hit(Source::Client);
        return Ok((StatusCode::NOT_MODIFIED, headers).into_response());
    }
    let picture = state.pictures.get(job).await?;
    Ok((headers, [(header::CONTENT_TYPE, "image/png")], picture).into_response())
}

/// Does `If-None-Match` name the tag? Weak comparison, as RFC 9110, 13.1.2 asks for.
pub(crate) fn has_tag(asked: &HeaderMap, tag: &str) -> bool {
    let tag = tag.trim_start_matches("W/");
    let lists = asked
        .get_all(header::IF_NONE_MATCH)
        .into_iter()
        .filter_map(|value| value.to_str().ok());
    lists
        .flat_map(|list| list.split(','))
        .any(|one| one.trim().trim_start_matches("W/") == tag)
}
