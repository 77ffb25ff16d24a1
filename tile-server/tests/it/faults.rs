//! A store that breaks while the server runs.

use std::path::Path;

use axum::http::StatusCode;
use contract::quantity::Quantity;
use storage::Store;
use tile_server::backend::Class;

use crate::app::TestApp;
use crate::doubles::Mood;

/// A link to itself among the manifests: every listing fails, and not because there is nothing.
fn break_store(folder: &Path) {
    let manifests = folder.join("manifests");
    std::fs::create_dir_all(&manifests).unwrap();
    std::os::unix::fs::symlink(&manifests, manifests.join("loop")).unwrap();
}

fn mend_store(folder: &Path) {
    std::fs::remove_file(folder.join("manifests/loop")).unwrap();
}

fn over(folder: &Path) -> TestApp {
    TestApp::over(
        Store::open(folder.to_str().unwrap()).unwrap(),
        |_settings| {},
    )
}

#[tokio::test]
async fn what_was_known_is_served_on_but_the_server_is_not_ready() {
    let folder = tempfile::tempdir().unwrap();
    let app = over(folder.path());
    app.land("flux", Quantity::CarbonFlux, 1).await;
    assert_eq!(
        app.get("/tiles/flux/map/0/0/0.png").await.status,
        StatusCode::OK
    );
    break_store(folder.path());
    assert_eq!(
        app.get("/tiles/flux/map/0/0/0.png").await.status,
        StatusCode::OK
    );
    assert_eq!(
        app.get("/tiles/flux/map/1/0/0.png").await.status,
        StatusCode::OK,
        "not drawn before"
    );
    assert!(
        app.metric("fluxglobe_tile_server_store_failures_total")
            .await
            > 0,
        "the fault took place"
    );
    let ready = app.get("/readyz").await;
    assert_eq!(ready.status, StatusCode::SERVICE_UNAVAILABLE);
    assert!(
        !ready.text().contains(folder.path().to_str().unwrap()),
        "{}",
        ready.text()
    );
    assert_eq!(app.get("/healthz").await.status, StatusCode::OK);
}

#[tokio::test]
async fn before_anything_is_known_clients_are_told_to_come_back() {
    let folder = tempfile::tempdir().unwrap();
    break_store(folder.path());
    let app = over(folder.path());
    for path in [
        "/api/products",
        "/tiles/flux/map/0/0/0.png",
        "/api/products/flux/budget",
    ] {
        let answer = app.get(path).await;
        assert_eq!(
            answer.status,
            StatusCode::SERVICE_UNAVAILABLE,
            "{path}: {}",
            answer.text()
        );
        assert!(!answer.header("retry-after").is_empty());
        assert_eq!(answer.reason(), "the store does not answer at the moment");
    }
    mend_store(folder.path());
    app.land("flux", Quantity::CarbonFlux, 1).await;
    assert_eq!(
        app.get("/tiles/flux/map/0/0/0.png").await.status,
        StatusCode::OK
    );
}

#[tokio::test]
async fn a_stored_picture_that_cannot_be_read_is_drawn_again() {
    let folder = tempfile::tempdir().unwrap();
    let app = over(folder.path());
    app.land("flux", Quantity::CarbonFlux, 1).await;
    std::fs::write(folder.path().join("tiles"), "not a folder").unwrap();
    assert_eq!(
        app.get("/tiles/flux/map/0/0/0.png").await.status,
        StatusCode::OK
    );
    assert_eq!(app.drawer.drawn_count(), 1);
    assert!(
        app.metric("fluxglobe_tile_server_store_failures_total")
            .await
            >= 1,
        "the fault took place"
    );
}

#[tokio::test]
async fn products_of_a_disk_that_is_gone_stay_known_and_the_server_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let app = over(folder.path());
    app.land("flux", Quantity::CarbonFlux, 1).await;
    assert_eq!(app.get("/readyz").await.status, StatusCode::OK);
    app.get("/tiles/flux/map/0/0/0.png").await;
    std::fs::remove_dir_all(folder.path().join("manifests")).unwrap();
    assert_eq!(
        app.get("/tiles/flux/map/0/0/0.png").await.status,
        StatusCode::OK
    );
    let ready = app.get("/readyz").await;
    assert_eq!(ready.status, StatusCode::SERVICE_UNAVAILABLE);
    assert!(
        ready.text().contains("1 that were there are gone"),
        "{}",
        ready.text()
    );
}

/// How many tiles were answered so.
async fn tiles(app: &TestApp, outcome: &str) -> u64 {
    let route = "/tiles/{product}/{mode}/{z}/{x}/{y_png}";
    let labels = format!(r#"method="GET",operation="{route}",outcome="{outcome}""#);
    app.metric(&format!("fluxglobe_tile_server_requests_total{{{labels}}}"))
        .await
}

#[tokio::test]
async fn what_is_away_is_counted_as_an_error_and_not_as_too_many_who_ask() {
    let folder = tempfile::tempdir().unwrap();
    break_store(folder.path());
    let app = over(folder.path());
    let tile = "/tiles/flux/map/0/0/0.png";
    let away = app.get(tile).await;
    assert_eq!(away.status, StatusCode::SERVICE_UNAVAILABLE);
    let counted = [tiles(&app, "retryable").await, tiles(&app, "busy").await];
    assert_eq!(counted, [1, 0], "the store");
    mend_store(folder.path());
    app.land("flux", Quantity::CarbonFlux, 1).await;
    for (class, counted) in [(Class::Unavailable, [2, 0]), (Class::Busy, [2, 1])] {
        app.drawer.set(Mood::fails(class, "a worker"));
        let none = app.get(tile).await;
        assert_eq!(none.status, StatusCode::SERVICE_UNAVAILABLE);
        let now = [tiles(&app, "retryable").await, tiles(&app, "busy").await];
        assert_eq!(now, counted, "{class:?}");
    }
}
