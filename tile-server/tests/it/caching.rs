//! What is drawn once and what is sent once: entity tags, the two caches, single flight, new versions.

use std::sync::atomic::Ordering;
use std::time::Duration;

use axum::http::StatusCode;
use contract::quantity::Quantity;
use futures::future::join_all;
use tile_server::backend::Keep;

use crate::app::TestApp;

const TILE: &str = "/tiles/flux/volume/1/0/0.png?time=2000-02-01";

#[tokio::test]
async fn the_same_tile_is_drawn_once() {
    let app = TestApp::new().await;
    let (first, second) = (app.get(TILE).await, app.get(TILE).await);
    assert_eq!(first.body, second.body);
    assert_eq!(app.drawer.drawn_count(), 1);
    assert_eq!(
        app.metric(r#"fluxglobe_tile_server_cache_hits_total{source="memory"}"#)
            .await,
        1
    );
    assert_eq!(
        app.metric("fluxglobe_tile_server_cache_misses_total").await,
        1
    );
}

#[tokio::test]
async fn what_is_kept_in_memory_keeps_no_more_than_itself() {
    let app = TestApp::new().await;
    app.drawer.stores_nothing.store(true, Ordering::SeqCst);
    drop(app.get(TILE).await);
    // A picture that came over a connection is a part of its buffer: whoever holds on to it holds all of that.
    let given = app.drawer.given.lock().unwrap().remove(0);
    assert!(
        given.is_unique(),
        "the memory holds on to what it was given"
    );
    assert_eq!(app.get(TILE).await.body, given);
    assert_eq!(app.drawer.drawn_count(), 1);
}

#[tokio::test]
async fn another_time_or_size_is_another_picture() {
    let app = TestApp::new().await;
    app.get(TILE).await;
    app.get(&format!("{TILE}T00:00:01Z")).await;
    app.get(&format!("{TILE}&size=512")).await;
    assert_eq!(app.drawer.drawn_count(), 3);
}

#[tokio::test]
async fn the_entity_tag_is_the_digest_of_the_job_and_answers_without_drawing() {
    let app = TestApp::new().await;
    let first = app.get(TILE).await;
    let tag = first.header("etag").to_owned();
    assert_eq!(tag, format!("\"{}\"", app.drawer.last_job().digest()));
    assert_eq!(first.header("cache-control"), "public, max-age=60");
    let fresh = TestApp::new().await; // the same product, nothing drawn
    for asked in [tag.clone(), format!("W/{tag}"), format!("\"other\", {tag}")] {
        let again = fresh.get_with(TILE, &[("if-none-match", &asked)]).await;
        assert_eq!(again.status, StatusCode::NOT_MODIFIED, "{asked}");
        assert!(again.body.is_empty());
        assert_eq!(again.header("etag"), tag);
    }
    assert_eq!(fresh.drawer.drawn_count(), 0);
    let other = fresh
        .get_with(TILE, &[("if-none-match", "\"other\"")])
        .await;
    assert_eq!(other.status, StatusCode::OK);
}

#[tokio::test]
async fn a_picture_outlives_the_memory_of_its_process() {
    let app = TestApp::with(|settings| settings.tile_memory_bytes = 0).await;
    let first = app.get(TILE).await;
    let second = app.get(TILE).await;
    assert_eq!(first.body, second.body);
    assert_eq!(app.drawer.drawn_count(), 1);
    assert_eq!(
        app.metric(r#"fluxglobe_tile_server_cache_hits_total{source="store"}"#)
            .await,
        1
    );
    let key = app.drawer.last_job().key();
    assert_eq!(app.store.get(&key).await.unwrap(), first.body);
}

#[tokio::test]
async fn the_memory_for_pictures_is_bounded() {
    let app = TestApp::with(|settings| settings.tile_memory_bytes = 10_000).await;
    for x in 0..256 {
        app.get(&format!("/tiles/flux/map/8/{x}/0.png")).await;
    }
    let bytes = app.metric("fluxglobe_tile_server_cache_bytes").await;
    assert!(bytes > 0 && bytes <= 10_000, "{bytes}");
}

#[tokio::test]
async fn twenty_who_ask_at_once_cause_one_drawing() {
    let app = TestApp::new().await;
    app.drawer.is_slow.store(true, Ordering::SeqCst);
    let crowd = join_all((0..20).map(|_| app.get(TILE)));
    let release = async {
        while app.drawer.drawn_count() == 0 {
            tokio::task::yield_now().await;
        }
        app.drawer.turns.add_permits(20);
    };
    let (answers, ()) = tokio::join!(crowd, release);
    assert!(
        answers
            .iter()
            .all(|answer| answer.status == StatusCode::OK && answer.body == answers[0].body)
    );
    assert_eq!(app.drawer.drawn_count(), 1);
}

#[tokio::test]
async fn a_picture_nobody_waits_for_any_more_still_lands_in_the_store() {
    let app = TestApp::new().await;
    app.drawer.is_slow.store(true, Ordering::SeqCst);
    let impatient = tokio::time::timeout(Duration::from_millis(50), app.get(TILE)).await;
    assert!(impatient.is_err());
    app.drawer.turns.add_permits(1);
    let key = app.drawer.last_job().key();
    while !app.store.exists(&key).await.unwrap() {
        tokio::task::yield_now().await;
    }
    app.get(TILE).await;
    assert_eq!(app.drawer.drawn_count(), 1);
}

#[tokio::test]
async fn a_new_version_is_another_picture_and_the_old_one_stays() {
    let app = TestApp::new().await;
    let before = app.get(TILE).await;
    let old_key = app.drawer.last_job().key();
    app.land("flux", Quantity::CarbonFlux, 2).await;
    let after = app
        .get_with(TILE, &[("if-none-match", before.header("etag"))])
        .await;
    assert_eq!(after.status, StatusCode::OK);
    assert_ne!(after.header("etag"), before.header("etag"));
    assert_eq!(app.store.get(&old_key).await.unwrap(), before.body);
}

#[tokio::test]
async fn the_list_of_products_is_read_no_more_often_than_told() {
    let app = TestApp::with(|settings| settings.catalogue_age_ms = 3_600_000).await;
    let before = app.get(TILE).await;
    app.land("flux", Quantity::CarbonFlux, 2).await;
    assert_eq!(app.get(TILE).await.header("etag"), before.header("etag"));
}

#[tokio::test]
async fn a_map_keeps_its_picture_when_the_accumulated_carbon_is_derived_later() {
    let app = TestApp::empty(|_settings| {});
    let flux = app.land("flux", Quantity::CarbonFlux, 1).await;
    let tags = async || {
        let tag = async |mode: &str| {
            app.get(&format!("/tiles/flux/{mode}/0/0/0.png"))
                .await
                .header("etag")
                .to_owned()
        };
        (tag("map").await, tag("volume").await)
    };
    let before = tags().await;
    app.land_derived(
        "flux-accumulated",
        Quantity::AccumulatedCarbon,
        1,
        Some(flux),
    )
    .await;
    let after = tags().await;
    assert_eq!(before.0, after.0);
    assert_ne!(before.1, after.1);
}

#[tokio::test]
async fn whoever_draws_a_picture_is_the_one_who_stores_it() {
    let app = TestApp::with(|settings| settings.tile_memory_bytes = 0).await;
    app.drawer.stores_nothing.store(true, Ordering::SeqCst);
    let first = app.get(TILE).await;
    assert_eq!(first.status, StatusCode::OK);
    let key = app.drawer.last_job().key();
    assert!(!app.store.exists(&key).await.unwrap());
    app.drawer.stores_nothing.store(false, Ordering::SeqCst);
    for _ in 0..2 {
        assert_eq!(app.get(TILE).await.body, first.body);
    }
    assert_eq!(app.store.get(&key).await.unwrap(), first.body);
    assert_eq!(app.drawer.drawn_count(), 2, "the third time it is there");
    assert_eq!(*app.drawer.keeps.lock().unwrap(), [Keep::Yes, Keep::Yes]);
}

#[tokio::test]
async fn a_damaged_picture_is_drawn_to_be_stored_anew() {
    let app = TestApp::with(|settings| settings.tile_memory_bytes = 0).await;
    let first = app.get(TILE).await;
    let key = app.drawer.last_job().key();
    let mut damaged = first.body.to_vec();
    let middle = damaged.len() / 2;
    damaged[middle] ^= 1;
    app.store.put_over(&key, damaged.into()).await.unwrap();
    assert!(app.store.get(&key).await.is_err(), "the fault was planted");
    assert_eq!(app.get(TILE).await.body, first.body);
    assert_eq!(app.store.get(&key).await.unwrap(), first.body);
    assert_eq!(*app.drawer.keeps.lock().unwrap(), [Keep::Yes, Keep::Yes]);
}

#[tokio::test]
async fn the_list_of_products_has_an_entity_tag_that_follows_new_versions() {
    let app = TestApp::new().await;
    let tag = app.get("/api/products").await.header("etag").to_owned();
    let again = app
        .get_with("/api/products", &[("if-none-match", &tag)])
        .await;
    assert_eq!(again.status, StatusCode::NOT_MODIFIED);
    app.land("sst", Quantity::SeaSurfaceTemperature, 2).await;
    let after = app
        .get_with("/api/products", &[("if-none-match", &tag)])
        .await;
    assert_eq!(after.status, StatusCode::OK);
}

#[tokio::test]
async fn a_budget_of_one_version_is_computed_once() {
    let app = TestApp::new().await;
    let path = "/api/products/flux/budget?region=global&step=total";
    let (first, second) = (app.get(path).await, app.get(path).await);
    assert_eq!(first.json(), second.json());
    assert_eq!(app.analyst.budgets.lock().unwrap().len(), 1);
    app.get("/api/products/flux/budget?region=global&step=total&earth=sphere")
        .await;
    app.land("flux", Quantity::CarbonFlux, 2).await;
    app.get(path).await;
    assert_eq!(app.analyst.budgets.lock().unwrap().len(), 3);
}
