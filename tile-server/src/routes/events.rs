//! `/api/events`: news of new versions as server-sent events.

use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;

use axum::extract::State;
use axum::http::{HeaderMap, HeaderName, header};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse as _, Response};
use futures::Stream;

use crate::error::ServerError;
use crate::live::Item;
use crate::state::AppState;

/// A comment is sent this often, so that nobody between takes the silence for an end.
const HEARTBEAT: Duration = Duration::from_secs(15);

/// News of new versions from now on, as server-sent events named `product`.
///
/// The data of each is one `News`; with `Last-Event-ID` those missed since are told first. A comment comes every 15 s.
#[utoipa::path(
    get,
    path = "/api/events",
    operation_id = "events",
    tag = "catalogue",
    params(("Last-Event-ID" = Option<u64>, Header, description = "Number of the last event that was received")),
    responses((status = 200, description = "Events for as long as the client listens", body = Item, content_type = "text/event-stream")),
)]
pub(crate) async fn get(
    State(state): State<AppState>,
    headers: HeaderMap,
) -> Result<Response, ServerError> {
    let last = headers
        .get("last-event-id")
        .and_then(|id| id.to_str().ok()?.parse().ok());
    let listener = state.news.listen(last)?;
    let stream = futures::stream::unfold(listener, |mut listener| async move {
        let item = listener.next().await?;
        Some((Ok::<_, Infallible>(event(&item)), listener))
    });
    Ok(respond(stream))
}

fn event(item: &Arc<Item>) -> Event {
    let data = serde_json::to_string(item.as_ref()).expect("an item has string keys only");
    Event::default()
        .event("product")
        .id(item.id.to_string())
        .data(data)
}

fn respond(stream: impl Stream<Item = Result<Event, Infallible>> + Send + 'static) -> Response {
    let sse = Sse::new(stream).keep_alive(KeepAlive::new().interval(HEARTBEAT).text("still here"));
    let headers = [
        (header::CACHE_CONTROL, "no-store"),
        // A proxy that collects an answer before it hands it on would keep the news to itself.
        (HeaderName::from_static("x-accel-buffering"), "no"),
    ];
    (headers, sse).into_response()
}
