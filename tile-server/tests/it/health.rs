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
async fn a_server_without_its_renderer_is_ready_and_serves_what_is_stored() {
    let app = TestApp::new().await;
    let (drawn, cold) = ("/tiles/flux/map/1/0/0.png", "/tiles/flux/map/1/1/0.png");
    assert_eq!(app.get(drawn).await.status, StatusCode::OK);
    app.drawer
        .set(Mood::fails(Class::Unavailable, "no render worker is up"));
    let answer = app.get("/readyz").await;
    assert_eq!(answer.status, StatusCode::OK);
    let body = answer.json();
    assert_eq!(body["ready"], true);
    let renderer = part(&body, "renderer");
    assert_eq!(renderer["detail"], "no render worker is up");
    assert_eq!(
        (&renderer["ok"], &renderer["required"]),
        (&Value::Bool(false), &Value::Bool(false))
    );
    // Another server over the same store has nothing in memory.
    let other = TestApp::over(app.store.clone(), |_settings| {});
    other
        .drawer
        .set(Mood::fails(Class::Unavailable, "no render worker is up"));
    for path in [drawn, "/api/products/flux/budget", "/api/products"] {
        assert_eq!(other.get(path).await.status, StatusCode::OK, "{path}");
    }
    let answer = other.get(cold).await;
    assert_eq!(answer.status, StatusCode::SERVICE_UNAVAILABLE);
    assert_eq!(answer.header("retry-after"), "5");
    assert_eq!(answer.reason(), "no render worker is up");
    let live = app.get("/healthz").await;
    assert_eq!(
        (live.status, live.text().as_str()),
        (StatusCode::OK, "ok\n")
    );
}

#[tokio::test]
async fn a_server_that_ends_is_not_ready_whatever_its_parts_say() {
    let app = TestApp::new().await;
    assert_eq!(app.get("/readyz").await.status, StatusCode::OK);
    app.state.news.close();
    let answer = app.get("/readyz").await;
    assert_eq!(answer.status, StatusCode::SERVICE_UNAVAILABLE);
    let body = answer.json();
    assert_eq!(
        (&body["ready"], &part(&body, "store")["ok"]),
        (&Value::Bool(false), &Value::Bool(true))
    );
    assert_eq!(part(&body, "server")["ok"], false);
    assert_eq!(app.get("/healthz").await.status, StatusCode::OK);
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
