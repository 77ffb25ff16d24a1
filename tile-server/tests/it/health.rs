//! `/healthz` and `/readyz`.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use axum::http::StatusCode;
use serde_json::Value;
use tile_server::backend::Class;

use crate::app::TestApp;
use crate::doubles::{Log, Mood};

fn part(body: &Value, name: &str) -> Value {
    body["checks"]
        .as_array()
        .unwrap()
        .iter()
        .find(|part| part["name"] == name)
        .unwrap()
        .clone()
}

#[tokio::test]
async fn a_server_with_all_its_parts_is_ready() {
    let app = TestApp::new().await;
    let answer = app.get("/readyz").await;
    assert_eq!(answer.status, StatusCode::OK);
    let body = answer.json();
    assert_eq!(body["ready"], true);
    assert_eq!(part(&body, "store")["detail"], "products: 3");
    assert_eq!(part(&body, "renderer")["ok"], true);
    let viewer = part(&body, "viewer");
    assert_eq!(
        (&viewer["ok"], &viewer["required"]),
        (&Value::Bool(false), &Value::Bool(false))
    );
}

#[tokio::test]
async fn a_server_without_its_renderer_lives_but_is_not_ready() {
    let app = TestApp::new().await;
    app.drawer
        .set(Mood::fails(Class::Unavailable, "no graphics adapter"));
    let answer = app.get("/readyz").await;
    assert_eq!(answer.status, StatusCode::SERVICE_UNAVAILABLE);
    let body = answer.json();
    assert_eq!(body["ready"], false);
    assert_eq!(part(&body, "renderer")["detail"], "no graphics adapter");
    let live = app.get("/healthz").await;
    assert_eq!(
        (live.status, live.text().as_str()),
        (StatusCode::OK, "ok\n")
    );
}

#[tokio::test]
async fn a_server_without_its_log_or_its_observations_says_so_and_serves_on() {
    let app = TestApp::new().await.observing();
    let log = Arc::new(Log::default());
    drop(app.state.live(log.clone()));
    let body = app.get("/readyz").await.json();
    assert_eq!(part(&body, "event log")["ok"], true);
    assert_eq!(part(&body, "observations")["ok"], true);
    log.is_away.store(true, Ordering::SeqCst);
    app.observer
        .set(Mood::fails(Class::Unavailable, "the database is away"));
    let answer = app.get("/readyz").await;
    assert_eq!(
        answer.status,
        StatusCode::OK,
        "tiles are served without them"
    );
    let body = answer.json();
    assert_eq!(part(&body, "event log")["ok"], false);
    assert_eq!(
        part(&body, "observations")["detail"],
        "the database is away"
    );
    assert_eq!(part(&body, "store")["ok"], true);
    assert!(!answer.text().contains("secret"), "{}", answer.text());
}
