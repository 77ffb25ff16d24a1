//! Counts and times every request by its route.

use std::pin::Pin;
use std::task::{Context, Poll};
use std::time::Instant;

use axum::body::{Body, Bytes, HttpBody};
use axum::extract::{MatchedPath, Request, State};
use axum::http::{Method, StatusCode};
use axum::middleware::Next;
use axum::response::Response;
use http_body::{Frame, SizeHint};
use prometheus::{Histogram, IntCounter, IntGauge};

use crate::error::Away;
use crate::state::AppState;

/// The route of what is no route: the viewer's files and unknown addresses.
const FILES: &str = "viewer";

/// One request under way; counted out even if the client goes away.
struct UnderWay(IntGauge);

impl UnderWay {
    fn enter(gauge: &IntGauge) -> Self {
        gauge.inc();
        Self(gauge.clone())
    }
}

impl Drop for UnderWay {
    fn drop(&mut self) {
        self.0.dec();
    }
}

/// Counts the request when it comes, its answer when it begins and its bytes as they go.
pub(crate) async fn count(State(state): State<AppState>, request: Request, next: Next) -> Response {
    let metrics = &state.metrics;
    let started_at = Instant::now();
    let matched = request.extensions().get::<MatchedPath>().cloned();
    let route = matched.as_ref().map_or(FILES, MatchedPath::as_str);
    let under_way = UnderWay::enter(&metrics.in_flight.with_label_values(&[route]));
    let method = method_label(request.method());
    let is_logged = tracing::enabled!(tracing::Level::DEBUG);
    let path = is_logged.then(|| request.uri().path().to_owned());
    let response = next.run(request).await;
    let duration = started_at.elapsed();
    let status = response.status();
    metrics
        .requests
        .with_label_values(&[route, method, outcome_label(&response)])
        .inc();
    metrics
        .request_duration_s
        .with_label_values(&[route])
        .observe(duration.as_secs_f64());
    tracing::debug!(
        http.route = route,
        http.path = path,
        status = status.as_u16(),
        duration_ms = duration.as_secs_f64() * 1e3,
        "{method} {status}"
    );
    let bytes = metrics.sent_bytes.with_label_values(&[route]);
    let sending = Sending {
        begun: Instant::now(),
        duration_s: metrics.send_duration_s.with_label_values(&[route]),
    };
    response.map(|body| {
        Body::new(Sent {
            body,
            bytes,
            _sending: sending,
            _under_way: under_way,
        })
    })
}

/// An answer on its way; timed until its body is dropped, which is when its connection has taken the last byte or is gone.
struct Sending {
    begun: Instant,
    duration_s: Histogram,
}

impl Drop for Sending {
    fn drop(&mut self) {
        self.duration_s.observe(self.begun.elapsed().as_secs_f64());
    }
}

/// A body that counts its bytes as they go; the request is under way until the last one is gone.
struct Sent {
    body: Body,
    bytes: IntCounter,
    _sending: Sending,
    _under_way: UnderWay,
}

impl HttpBody for Sent {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        let polled = Pin::new(&mut self.body).poll_frame(cx);
        if let Poll::Ready(Some(Ok(frame))) = &polled {
            self.bytes
                .inc_by(frame.data_ref().map_or(0, Bytes::len) as u64);
        }
        polled
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    /// Known lengths stay known, so that clients are told them.
    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

/// Methods are free text to HTTP: only those with a meaning here become a label.
fn method_label(method: &Method) -> &'static str {
    match *method {
        Method::GET => "GET",
        Method::HEAD => "HEAD",
        Method::POST => "POST",
        Method::OPTIONS => "OPTIONS",
        _ => "other",
    }
}

/// The words that all services count by. A server that is not ready, as `/readyz` says it, counts as busy: nothing failed.
fn outcome_label(answer: &Response) -> &'static str {
    let is_away = answer.extensions().get::<Away>().is_some();
    match answer.status() {
        StatusCode::SERVICE_UNAVAILABLE if is_away => "retryable",
        StatusCode::SERVICE_UNAVAILABLE => "busy",
        status if status.is_server_error() => "failed",
        status if status.is_client_error() => "refused",
        _ => "ok",
    }
}
