//! `/api/regions`.

use axum::http::StatusCode;

use crate::app::TestApp;

#[tokio::test]
async fn every_region_that_is_listed_can_be_asked_for() {
    let app = TestApp::new().await;
    let body = app.get("/api/regions").await.json();
    let regions = body["regions"].as_array().unwrap();
    assert!(regions.len() >= 5);
    for region in regions {
        let (name, bounds) = (
            region["name"].as_str().unwrap(),
            region["bounds_deg"].as_array().unwrap(),
        );
        assert_eq!(bounds.len(), 4, "{name}");
        assert!(!region["title"].as_str().unwrap().is_empty(), "{name}");
        let answer = app
            .get(&format!("/api/products/flux/budget?region={name}"))
            .await;
        assert_eq!(answer.status, StatusCode::OK, "{name}");
    }
}
