//! `/api/check`.

use axum::http::StatusCode;
use serde_json::json;
use tile_server::backend::{Check, CheckRow};

use crate::app::TestApp;

#[tokio::test]
async fn without_published_values_there_is_nothing_to_show() {
    let app = TestApp::new().await;
    let answer = app.get("/api/check").await;
    assert_eq!(answer.status, StatusCode::OK);
    assert_eq!(answer.json(), json!(null));
}

#[tokio::test]
async fn a_comparison_is_shown_as_it_was_made() {
    let app = TestApp::new().await;
    let row = CheckRow {
        what: "Global".to_owned(),
        period: "year".to_owned(),
        published: -1.4,
        ours: -1.404,
        unit: "Pg C".to_owned(),
        difference_percent: None,
    };
    *app.analyst.check.lock().unwrap() = Some(Check {
        rows: vec![row],
        note: "A note.".to_owned(),
    });
    let expected = json!({"note": "A note.", "rows": [{"what": "Global", "period": "year", "published": -1.4,
        "ours": -1.404, "unit": "Pg C", "difference_percent": null}]});
    assert_eq!(app.get("/api/check").await.json(), expected);
}
