//! `/api/products/{product}/area`.

use axum::http::StatusCode;
use contract::earth::Earth;
use contract::region::Region;
use contract::series::RegionSeriesQuery;
use serde_json::json;
use tile_server::backend::Class;

use crate::app::TestApp;
use crate::doubles::Mood;

fn last(app: &TestApp) -> RegionSeriesQuery {
    app.analyst.areas.lock().unwrap().last().unwrap().clone()
}

#[tokio::test]
async fn each_step_has_its_mean_and_what_it_is_a_mean_of() {
    let app = TestApp::new().await;
    let path = "/api/products/sst/area?region=14n-50n";
    let body = app.get(path).await.json();
    assert_eq!(
        (&body["product"], &body["region"], &body["unit"]),
        (&json!("sst"), &json!("14n-50n"), &json!("°C"))
    );
    assert_eq!(
        (&body["earth"], &body["region_area_m2"]),
        (&json!("wgs84"), &json!(4e12))
    );
    assert!(body["manifest"].as_str().unwrap().starts_with("sst@1-"));
    let series = body["series"].as_array().unwrap();
    assert_eq!(series.len(), 3);
    assert!(series[0]["mean"].is_null());
    let second = json!({"start": "2000-02-01T00:00:00Z", "end": "2000-03-01T00:00:00Z",
        "mid": "2000-02-15T12:00:00Z", "mean": 0.25, "area_m2": 1e12, "coverage_percent": 25.0});
    assert_eq!(series[1], second);
}

#[tokio::test]
async fn every_parameter_reaches_the_analyst_once() {
    let app = TestApp::new().await;
    let path =
        "/api/products/flux/area?region=170,-10,-170,10&from=2000-02&to=2000-03&earth=sphere";
    for _ in 0..2 {
        let body = app.get(path).await.json();
        assert_eq!(body["region"], "170,-10,190,10");
        assert_eq!(body["series"].as_array().unwrap().len(), 1);
    }
    assert_eq!(app.analyst.areas.lock().unwrap().len(), 1, "not remembered");
    let request = last(&app);
    let (west, south, east, north) = (170.0, -10.0, 190.0, 10.0);
    let expected = Region::Box {
        west,
        south,
        east,
        north,
    };
    assert_eq!(request.region, expected);
    assert_eq!(request.earth, Earth::Sphere);
    assert_eq!(
        (request.from, request.to),
        ("2000-02".parse().ok(), "2000-03".parse().ok())
    );
}

#[tokio::test]
async fn what_cannot_be_asked_is_refused_with_what_can() {
    let app = TestApp::new().await;
    for (query, reason) in [
        ("", "/api/regions"),
        ("region=atlantis", "atlantis"),
        ("region=1,2,3", "1,2,3"),
        ("region=0,10,10,0", "latitudes"),
        ("region=global&from=2001", "covers 2000-01-01"),
        (
            "region=global&from=2000-03&to=2000-02",
            "end must come after the start",
        ),
        ("region=global&earth=flat", "flat"),
        ("region=global&step=decade", "step"),
    ] {
        let answer = app.get(&format!("/api/products/sst/area?{query}")).await;
        assert_eq!(answer.status, StatusCode::BAD_REQUEST, "{query}");
        assert!(
            answer.reason().contains(reason),
            "{query}: {}",
            answer.reason()
        );
    }
    assert!(app.analyst.areas.lock().unwrap().is_empty());
}

#[tokio::test]
async fn a_failed_series_is_not_remembered() {
    let app = TestApp::new().await;
    app.analyst.set(Mood::fails(
        Class::Unavailable,
        "the cluster does not answer",
    ));
    let path = "/api/products/sst/area?region=global";
    let answer = app.get(path).await;
    assert_eq!(answer.status, StatusCode::SERVICE_UNAVAILABLE);
    app.analyst.set(Mood::Well);
    assert_eq!(app.get(path).await.status, StatusCode::OK);
}
