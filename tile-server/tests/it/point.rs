//! `/api/products/{product}/point`.

use axum::http::StatusCode;
use serde_json::json;
use tile_server::backend::Class;

use crate::app::TestApp;
use crate::doubles::Mood;

#[tokio::test]
async fn a_series_is_that_of_the_cell_in_the_unit_people_read() {
    let app = TestApp::new().await;
    let body = app
        .get("/api/products/sst/point?lon=12.3&lat=-3.2")
        .await
        .json();
    assert_eq!(
        (&body["product"], &body["unit"]),
        (&json!("sst"), &json!("°C"))
    );
    assert_eq!(
        body["cell"],
        json!({"row": 6, "col": 19, "lon_deg": 15.0, "lat_deg": -5.0})
    );
    let asked = (&body["lon_deg"], &body["lat_deg"]);
    assert_eq!(asked, (&json!(12.3), &json!(-3.2)));
    let series = body["series"].as_array().unwrap();
    assert_eq!(series.len(), 3);
    let value = series[1]["value"].as_f64().unwrap();
    assert!((value - 6.01).abs() < 1e-9, "{value}");
    assert_eq!(series[1]["start"], "2000-02-01T00:00:00Z");
    assert_eq!(series[1]["mid"], "2000-02-15T12:00:00Z");
    assert!(body["manifest"].as_str().unwrap().starts_with("sst@1-"));
}

#[tokio::test]
async fn a_place_is_read_once_for_all_who_ask_for_it_and_failures_are_not_remembered() {
    let app = TestApp::new().await;
    let asked = || app.analyst.points.lock().unwrap().len();
    let path = |lon: f64| format!("/api/products/sst/point?lon={lon}&lat=-3.2");
    app.analyst.set(Mood::fails(Class::Unavailable, "away"));
    let failed = app.get(&path(12.3)).await;
    assert_eq!(
        (failed.status, asked()),
        (StatusCode::SERVICE_UNAVAILABLE, 1)
    );
    app.analyst.set(Mood::Well);
    let first = app.get(&path(12.3)).await.json();
    let (here, there) = (path(12.3), path(12.4));
    let (again, other) = tokio::join!(app.get(&here), app.get(&there));
    assert_eq!((again.json(), asked()), (first.clone(), 3));
    // Another place of the same cell is answered with its own coordinates.
    assert_eq!(other.json()["lon_deg"], json!(12.4));
    let accumulated = here.replace("sst", "flux-accumulated");
    assert_ne!(app.get(&accumulated).await.json(), first);
    assert_eq!(asked(), 4);
}

#[tokio::test]
async fn sums_say_how_many_steps_and_how_much_time_they_hold() {
    let app = TestApp::new().await;
    let path = |product: &str| format!("/api/products/{product}/point?lon=12.3&lat=-3.2");
    let body = app.get(&path("flux-accumulated")).await.json();
    assert_eq!(
        body["series"][1]["contributed"],
        json!({"steps": 1, "of_steps": 2, "time_percent": 50.0})
    );
    let body = app.get(&path("sst")).await.json();
    assert!(body["series"][1].get("contributed").is_none(), "{body}");
}

#[tokio::test]
async fn a_cell_without_data_has_nulls() {
    let app = TestApp::new().await;
    let body = app
        .get("/api/products/sst/point?lon=180&lat=0")
        .await
        .json();
    assert_eq!(body["cell"]["col"], 0);
    assert!(
        body["series"]
            .as_array()
            .unwrap()
            .iter()
            .all(|step| step["value"].is_null())
    );
}

#[tokio::test]
async fn a_place_outside_the_grid_is_a_bad_request_that_says_what_is_inside() {
    let app = TestApp::new().await;
    let answer = app.get("/api/products/sst/point?lon=0&lat=75").await;
    assert_eq!(answer.status, StatusCode::BAD_REQUEST);
    assert!(
        answer.reason().contains("-60 to 60 degrees north"),
        "{}",
        answer.reason()
    );
}

#[tokio::test]
async fn an_analyst_that_answers_too_little_is_our_fault_and_tells_no_details() {
    let app = TestApp::new().await;
    app.analyst.set(Mood::AnswersNonsense);
    let answer = app.get("/api/products/sst/point?lon=0&lat=0").await;
    assert_eq!(answer.status, StatusCode::INTERNAL_SERVER_ERROR);
    app.analyst
        .set(Mood::fails(Class::Internal, "secret table at /srv/secret"));
    let answer = app.get("/api/products/sst/point?lon=0&lat=0").await;
    assert_eq!(answer.status, StatusCode::INTERNAL_SERVER_ERROR);
    assert!(!answer.text().contains("secret"), "{}", answer.text());
}

#[tokio::test]
async fn a_store_of_others_that_changed_is_told_by_its_name() {
    let app = TestApp::new().await;
    let told = "https://data.example/fco2.zarr, array \"fco2\", chunk [3, 0, 0]: its values are others than were attached";
    app.analyst.set(Mood::fails(Class::Upstream, told));
    let answer = app.get("/api/products/sst/point?lon=0&lat=0").await;
    assert_eq!(answer.status, StatusCode::BAD_GATEWAY);
    assert_eq!(answer.reason(), told);
}
