//! `/api/events`.

use std::time::Duration;

use axum::body::{Body, BodyDataStream};
use axum::http::{HeaderMap, Request, StatusCode};
use contract::quantity::Quantity;
use contract::time::Period;
use futures::StreamExt as _;
use serde_json::Value;
use tower::ServiceExt as _;

use crate::app::TestApp;

/// Longer than anything here takes, also on a busy machine.
const LIMIT: Duration = Duration::from_secs(20);

/// One who listens to `/api/events`.
pub(crate) struct Viewer {
    pub(crate) headers: HeaderMap,
    body: BodyDataStream,
    text: String,
}

/// What a viewer is told.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Told {
    pub(crate) id: u64,
    pub(crate) data: Value,
}

impl Viewer {
    pub(crate) async fn new(app: &TestApp, last: Option<u64>) -> Self {
        let mut request = Request::builder().uri("/api/events");
        if let Some(last) = last {
            request = request.header("last-event-id", last.to_string());
        }
        let request = request.body(Body::empty()).unwrap();
        let answer = app.router.clone().oneshot(request).await.unwrap();
        assert_eq!(answer.status(), StatusCode::OK);
        let (parts, body) = answer.into_parts();
        Self {
            headers: parts.headers,
            body: body.into_data_stream(),
            text: String::new(),
        }
    }

    /// The next event, none if the stream ended; anything that is no product event fails.
    pub(crate) async fn next(&mut self) -> Option<Told> {
        while !self.text.contains("\n\n") {
            let frame = tokio::time::timeout(LIMIT, self.body.next())
                .await
                .expect("nothing was told")?;
            self.text += std::str::from_utf8(&frame.unwrap()).unwrap();
        }
        let text = std::mem::take(&mut self.text);
        let (event, rest) = text.split_once("\n\n").unwrap();
        let field = |name: &str| {
            let line = event.lines().find_map(|line| line.strip_prefix(name));
            line.unwrap_or_else(|| panic!("no {name} in {event}"))
        };
        assert_eq!(field("event: "), "product");
        let told = Told {
            id: field("id: ").parse().unwrap(),
            data: serde_json::from_str(field("data: ")).unwrap(),
        };
        self.text = String::from(rest);
        Some(told)
    }
}

#[tokio::test]
async fn viewers_are_told_of_a_new_version() {
    let app = TestApp::new().await;
    let mut viewer = Viewer::new(&app, None).await;
    let manifest = app.land("sst", Quantity::SeaSurfaceTemperature, 2).await;
    let touched = Period::month(2000, 3).unwrap();
    app.state.news.tell(manifest.clone(), vec![touched]);
    let told = viewer.next().await.unwrap();
    assert_eq!(told.data["product"], "sst");
    assert_eq!(told.data["manifest"], manifest.to_string());
    assert_eq!(
        told.data["touched"],
        serde_json::json!([{"start": "2000-03-01T00:00:00Z", "end": "2000-04-01T00:00:00Z"}])
    );
}

#[tokio::test]
async fn the_stream_is_one_that_nobody_keeps_or_collects() {
    let app = TestApp::new().await;
    let viewer = Viewer::new(&app, None).await;
    let header = |name| viewer.headers.get(name).unwrap().to_str().unwrap();
    assert!(header("content-type").starts_with("text/event-stream"));
    assert_eq!(header("cache-control"), "no-store");
    assert_eq!(header("x-accel-buffering"), "no");
    assert!(!viewer.headers.contains_key("content-encoding"));
}

#[tokio::test]
async fn who_comes_back_is_told_what_was_missed() {
    let app = TestApp::new().await;
    let manifest = app.land("sst", Quantity::SeaSurfaceTemperature, 2).await;
    let mut first = Viewer::new(&app, None).await;
    for _ in 0..3 {
        app.state.news.tell(manifest.clone(), vec![]);
    }
    let told = [
        first.next().await.unwrap(),
        first.next().await.unwrap(),
        first.next().await.unwrap(),
    ];
    let mut again = Viewer::new(&app, Some(told[0].id)).await;
    assert_eq!(again.next().await.as_ref(), Some(&told[1]));
    assert_eq!(again.next().await.as_ref(), Some(&told[2]));
    let mut new = Viewer::new(&app, None).await;
    app.state.news.tell(manifest, vec![]);
    assert_eq!(new.next().await.unwrap().id, told[2].id + 1);
}

#[tokio::test]
async fn a_nonsense_number_is_that_of_a_newcomer() {
    let app = TestApp::new().await;
    for last in ["x", "-1", "99999999999999999999999"] {
        let request = Request::builder()
            .uri("/api/events")
            .header("last-event-id", last)
            .body(Body::empty())
            .unwrap();
        let answer = app.router.clone().oneshot(request).await.unwrap();
        assert_eq!(answer.status(), StatusCode::OK, "{last}");
    }
}

#[tokio::test]
async fn listeners_beyond_the_limit_are_asked_to_come_later() {
    let app = TestApp::new().await;
    let mut all = vec![];
    while let Ok(listener) = app.state.news.listen(None) {
        all.push(listener);
        assert!(all.len() < 100_000, "there is no limit");
    }
    let answer = app.get("/api/events").await;
    assert_eq!(answer.status, StatusCode::SERVICE_UNAVAILABLE);
    assert_eq!(answer.header("retry-after"), "5");
    drop(all);
    Viewer::new(&app, None).await;
}

#[tokio::test]
async fn a_stream_ends_with_its_server() {
    let app = TestApp::new().await;
    let mut viewer = Viewer::new(&app, None).await;
    app.state.news.close();
    assert_eq!(viewer.next().await, None);
    let answer = app.get("/api/events").await;
    assert_eq!(answer.status, StatusCode::SERVICE_UNAVAILABLE);
}
