//! `/healthz` and `/readyz`.

use axum::http::StatusCode;
use serde_json::Value;
use tile_server::backend::Class;

use crate::app::TestApp;
use crate::doubles::Mood;

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
