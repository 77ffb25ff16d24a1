//! `manifest=`: versions that were cited stay readable.

use axum::http::StatusCode;
use contract::manifest::Manifest;
use contract::quantity::Quantity;
use storage::{Store, manifests};

use crate::app::TestApp;

/// The name of the newest version of a product.
async fn version(app: &TestApp, product: &str) -> String {
    let products = app.get("/api/products").await.json();
    let all = products["products"].as_array().unwrap();
    let found = all.iter().find(|one| one["product"] == product).unwrap();
    found["manifest"].as_str().unwrap().to_owned()
}

#[tokio::test]
async fn a_named_version_is_drawn_with_what_was_derived_from_it() {
    let app = TestApp::new().await;
    app.get("/tiles/flux/volume/0/0/0.png").await;
    let old = app.drawer.last_job();
    let cited = version(&app, "flux").await;
    let flux = app.land("flux", Quantity::CarbonFlux, 2).await;
    app.land_derived(
        "flux-accumulated",
        Quantity::AccumulatedCarbon,
        2,
        Some(flux),
    )
    .await;
    app.get("/tiles/flux/volume/0/0/0.png").await;
    let new = app.drawer.last_job();
    assert_ne!(new.value, old.value);
    assert_ne!(new.accumulated, old.accumulated);
    // At another address, so that it is drawn and not remembered.
    let named = format!("/tiles/flux/volume/1/0/0.png?manifest={cited}");
    for _ in 0..2 {
        assert_eq!(app.get(&named).await.status, StatusCode::OK);
        let job = app.drawer.last_job();
        assert_eq!(job.value, old.value);
        assert_eq!(job.accumulated, old.accumulated);
        assert!(job.accumulated.is_some());
    }
}

#[tokio::test]
async fn a_version_keeps_what_was_derived_from_it_however_many_came_since() {
    let (store, traffic) = Store::memory().counted();
    let app = TestApp::over(store, |_settings| {});
    let cited = app.land("flux", Quantity::CarbonFlux, 1).await;
    let (lift, quantity) = ("flux-accumulated", Quantity::AccumulatedCarbon);
    app.land_derived(lift, quantity, 1, Some(cited.clone()))
        .await;
    app.get("/tiles/flux/volume/0/0/0.png").await;
    let old = app.drawer.last_job();
    assert!(old.accumulated.is_some());
    let skipped = app.land("flux", Quantity::CarbonFlux, 2).await;
    let newest = app.land("flux", Quantity::CarbonFlux, 3).await;
    let first = manifests::latest(&app.store, &lift.parse().unwrap()).await;
    let first = first.unwrap().unwrap();
    for number in 2..=71 {
        let derived = Manifest {
            number,
            title: format!("Derivation {number}"),
            derived_from: Some(newest.clone()),
            ..first.clone()
        };
        manifests::commit(&app.store, &derived).await.unwrap();
    }
    let named = format!("/tiles/flux/volume/1/0/0.png?manifest={cited}");
    assert_eq!(app.get(&named).await.status, StatusCode::OK);
    assert_eq!(app.drawer.last_job().accumulated, old.accumulated);
    // That nothing was derived from a version is looked up once.
    let reads = async |x: u32| {
        let before = traffic.counts();
        let named = format!("/tiles/flux/volume/1/{x}/0.png?manifest={skipped}");
        assert_eq!(app.get(&named).await.status, StatusCode::OK);
        assert_eq!(app.drawer.last_job().accumulated, None);
        traffic.counts().since(before).reads
    };
    let (looked_up, remembered) = (reads(0).await, reads(1).await);
    assert!(looked_up > 50, "{looked_up} reads");
    // The catalogue is read anew meanwhile on a machine that is slow.
    assert!(remembered < 40, "{remembered} reads");
}

#[tokio::test]
async fn series_and_budgets_tell_the_version_that_was_asked_for() {
    let app = TestApp::new().await;
    let old = app.get("/api/products/flux/budget").await.json()["manifest"].clone();
    let new = app.land("flux", Quantity::CarbonFlux, 2).await;
    for path in ["budget?", "point?lon=15&lat=-5&"] {
        let path = format!("/api/products/flux/{path}");
        assert_eq!(app.get(&path).await.json()["manifest"], new.to_string());
        // With its digest or without.
        for name in [old.as_str().unwrap(), "flux@1"] {
            let named = format!("{path}manifest={name}");
            assert_eq!(app.get(&named).await.json()["manifest"], old);
            if path.contains("/budget") {
                let as_of = format!("{path}as_of={name}");
                assert_eq!(app.get(&as_of).await.json()["manifest"], old);
            }
        }
        for (name, status) in [
            ("flux@3", 404),
            ("sst@1", 404),
            ("flux", 400),
            ("flux@", 400),
        ] {
            let answer = app.get(&format!("{path}manifest={name}")).await;
            assert_eq!(answer.status.as_u16(), status, "{name}: {}", answer.text());
        }
    }
    let computed = app.analyst.versions.lock().unwrap();
    assert_eq!(*computed, [1, 2], "the old one was remembered");
}

#[tokio::test]
async fn a_version_that_is_not_there_is_not_found_and_nonsense_is_refused() {
    let app = TestApp::new().await;
    let sst = app
        .get("/api/products/sst/point?lon=15&lat=-5")
        .await
        .json()["manifest"]
        .clone();
    let sst = sst.as_str().unwrap();
    for address in [
        "/tiles/flux/map/0/0/0.png?",
        "/tiles/flux/map.json?",
        "/globe/flux/map.png?",
        "/api/products/flux/point?lon=15&lat=-5&",
        "/api/products/flux/budget?",
    ] {
        for (manifest, status) in [
            ("flux@9-00000000", StatusCode::NOT_FOUND),
            ("flux@1-00000000", StatusCode::NOT_FOUND),
            (sst, StatusCode::NOT_FOUND),
            ("newest", StatusCode::BAD_REQUEST),
            ("../flux@1-00000000", StatusCode::BAD_REQUEST),
            ("", StatusCode::BAD_REQUEST),
        ] {
            let answer = app.get(&format!("{address}manifest={manifest}")).await;
            assert_eq!(answer.status, status, "{address} {manifest}");
            assert!(!answer.reason().is_empty());
        }
    }
    assert_eq!(app.drawer.drawn_count(), 0);
}

#[tokio::test]
async fn a_globe_and_a_tilejson_show_the_version_that_was_asked_for() {
    let app = TestApp::new().await;
    let cited = version(&app, "flux").await;
    let path = "/globe/flux/map.png?time=2000-02-20";
    let old = app.get(path).await.header("etag").to_owned();
    app.land("flux", Quantity::CarbonFlux, 2).await;
    assert_ne!(app.get(path).await.header("etag"), old);
    let named = app.get(&format!("{path}&manifest={cited}")).await;
    assert_eq!(named.header("etag"), old);
    let of = async |query: &str| {
        app.get(&format!("/tiles/flux/map.json{query}"))
            .await
            .json()
    };
    assert_ne!(of("").await["manifest"], cited);
    let json = of(&format!("?time=2000-02&manifest={cited}")).await;
    assert_eq!(json["manifest"], cited);
    let tiles = json["tiles"][0].as_str().unwrap();
    let expected = format!("{{y}}.png?time=2000-02-01T00:00:00Z&manifest={cited}&edition=");
    assert!(tiles.contains(&expected), "{tiles}");
    let tile = tiles.replace("{z}/{x}/{y}", "0/0/0");
    app.get(&tile).await;
    let same = format!("/tiles/flux/map/0/0/0.png?time=2000-02-01&manifest={cited}");
    assert_eq!(
        app.get(&tile).await.header("etag"),
        app.get(&same).await.header("etag")
    );
}

#[tokio::test]
async fn a_version_in_the_place_of_a_name_is_told_where_it_belongs() {
    let app = TestApp::new().await;
    let cited = version(&app, "flux").await;
    for named in ["flux@1", &cited] {
        for address in [
            format!("/api/products/{named}/point?lon=0&lat=0"),
            format!("/tiles/{named}/volume/0/0/0.png"),
            format!("/tiles/{named}/volume.json"),
        ] {
            let answer = app.get(&address).await;
            assert_eq!(answer.status, StatusCode::NOT_FOUND, "{address}");
            let refusal = answer.json();
            let told = refusal["error"].as_str().unwrap();
            assert!(told.contains(&format!("manifest={named}")), "{told}");
        }
        let right = format!("/api/products/flux/point?lon=0&lat=0&manifest={named}");
        assert_eq!(app.get(&right).await.status, StatusCode::OK, "{right}");
    }
    let answer = app.get("/api/products/flux@x/point?lon=0&lat=0").await;
    let refusal = answer.json();
    assert!(!refusal["error"].as_str().unwrap().contains("manifest="));
}
