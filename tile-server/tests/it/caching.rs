//! What is drawn once and what is sent once: entity tags, the two caches, single flight, new versions.

use std::sync::atomic::Ordering;
use std::time::Duration;

use axum::http::StatusCode;
use contract::digest::Digest;
use contract::quantity::Quantity;
use futures::FutureExt as _;
use futures::future::join_all;
use tile_server::backend::Keep;

use crate::app::TestApp;

const PINNED: &str = "public, max-age=31536000, immutable";
const NEWEST: &str = "public, max-age=60";
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
    let revised = app.get(&format!("{TILE}&revision=3")).await;
    assert_eq!((revised.status, revised.body), (StatusCode::OK, first.body));
    assert_eq!(app.drawer.drawn_count(), 1);
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
async fn a_picture_nobody_waits_for_any_more_is_given_up() {
    let app = TestApp::new().await;
    app.drawer.is_slow.store(true, Ordering::SeqCst);
    let mut both = Box::pin(async { tokio::join!(app.get(TILE), app.get(TILE)) });
    let mut third = Box::pin(app.get(TILE));
    while app.drawer.drawn_count() == 0 {
        assert!(both.as_mut().now_or_never().is_none());
        tokio::task::yield_now().await;
    }
    for _ in 0..1000 {
        assert!(third.as_mut().now_or_never().is_none());
        tokio::task::yield_now().await;
    }
    let under_way = || app.drawer.under_way.load(Ordering::SeqCst);
    drop(both);
    for _ in 0..100 {
        tokio::task::yield_now().await;
    }
    assert_eq!(under_way(), 1, "somebody waits");
    drop(third);
    let given_up = async {
        while under_way() > 0 {
            tokio::task::yield_now().await;
        }
    };
    let limit = Duration::from_secs(20);
    let in_time = tokio::time::timeout(limit, given_up).await;
    assert!(in_time.is_ok(), "it is drawn for nobody");
    app.drawer.is_slow.store(false, Ordering::SeqCst);
    assert_eq!(app.get(TILE).await.status, StatusCode::OK);
    assert_eq!(app.drawer.drawn_count(), 2);
}

#[tokio::test]
async fn a_picture_that_took_longer_than_anybody_waits_is_there_for_who_comes_again() {
    let app = TestApp::with(|settings| settings.request_limit_s = 1).await;
    app.drawer.is_slow.store(true, Ordering::SeqCst);
    let late = app.get(TILE).await;
    assert_eq!(late.status, StatusCode::GATEWAY_TIMEOUT);
    assert_eq!(late.header("retry-after"), "5");
    app.drawer.turns.add_permits(1);
    let key = app.drawer.last_job().key();
    while !app.store.exists(&key).await.unwrap() {
        tokio::task::yield_now().await;
    }
    app.get(TILE).await;
    assert_eq!(app.drawer.drawn_count(), 1);
    // Not for ever, though.
    let other = "/tiles/flux/map/1/0/0.png";
    assert_eq!(app.get(other).await.status, StatusCode::GATEWAY_TIMEOUT);
    assert_eq!(app.drawer.under_way.load(Ordering::SeqCst), 1);
    let given_up = async {
        while app.drawer.under_way.load(Ordering::SeqCst) > 0 {
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    };
    let limit = Duration::from_secs(20);
    let in_time = tokio::time::timeout(limit, given_up).await;
    assert!(in_time.is_ok(), "it is drawn for ever");
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
async fn an_address_that_is_asked_for_again_is_answered_the_same_and_counts_the_same() {
    let app = TestApp::new().await;
    let pinned = pinned_tile(&app, "/tiles/flux/volume.json").await;
    let looks = "/tiles/flux/volume/1/0/0.png?time=2000-02-01&palette=haline";
    let beyond = "/tiles/flux/volume/1/0/0@2x.png?time=2150";
    for address in [TILE, &pinned, looks, beyond] {
        let [first, second, third] = [(); 3].map(|()| app.get(address));
        let (first, second, third) = (first.await, second.await, third.await);
        assert_eq!(first.status, StatusCode::OK, "{address}: {}", first.text());
        assert_eq!(first.headers, second.headers, "{address}");
        assert_eq!(
            (&first.body, &second.headers),
            (&second.body, &third.headers)
        );
        let tag = first.header("etag").to_owned();
        let known = app.get_with(address, &[("if-none-match", &tag)]).await;
        assert_eq!(known.status, StatusCode::NOT_MODIFIED, "{address}");
        for name in [
            "etag",
            "cache-control",
            "fluxglobe-time",
            "fluxglobe-heights-end",
        ] {
            assert_eq!(known.header(name), first.header(name), "{address}");
        }
    }
    // What was asked for in its usual look, at one place and instant by two addresses, and at another one.
    let hot = app.state.hot.of(&"flux".parse().unwrap(), 9, |_time| true);
    let asked: Vec<_> = hot.iter().map(|tile| tile.asked).collect();
    assert_eq!(asked, [8, 4]);
    let hits = r#"fluxglobe_tile_server_cache_hits_total{source="memory"}"#;
    assert_eq!(app.metric(hits).await, 3 + 2 + 2 + 2);
    let nothing = app
        .get("/tiles/flux/volume/1/0/9.png?time=2000-02-01")
        .await;
    assert_eq!(nothing.status, StatusCode::BAD_REQUEST);
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
async fn a_view_of_a_free_camera_is_remembered_and_not_stored() {
    let app = TestApp::new().await;
    let view = "/globe/flux/volume.png?lon=12.5&lat=-3&height_km=5000&time=2000-02-01";
    let first = app.get(view).await;
    assert_eq!(first.status, StatusCode::OK, "{}", first.text());
    assert_eq!(app.get(view).await.body, first.body);
    assert_eq!(app.drawer.drawn_count(), 1, "the second time from memory");
    assert_eq!(*app.drawer.keeps.lock().unwrap(), [Keep::No]);
    for lon in 0..20 {
        app.get(&format!("/globe/flux/volume.png?lon={lon}")).await;
    }
    assert_eq!(app.drawer.drawn_count(), 21);
    let stored = app.store.list("tiles").await.unwrap();
    assert!(stored.is_empty(), "strangers fill the store: {stored:?}");
    let not_stored = r#"fluxglobe_tile_server_not_stored_total{why="view"}"#;
    assert_eq!(app.metric(not_stored).await, 21);
}

#[tokio::test]
async fn tiles_beyond_what_may_be_stored_in_a_day_are_given_out_and_remembered() {
    let app = TestApp::with(|settings| settings.stored_bytes_per_day = 1).await;
    let tile = |x: u32| format!("/tiles/flux/map/4/{x}/0.png");
    for _ in 0..2 {
        for x in 0..8 {
            assert_eq!(app.get(&tile(x)).await.status, StatusCode::OK);
        }
    }
    assert_eq!(app.drawer.drawn_count(), 8);
    // Whoever comes first does not know how large its picture will be.
    let keeps = app.drawer.keeps.lock().unwrap().clone();
    assert_eq!(keeps, [&[Keep::Yes][..], &[Keep::No; 7]].concat());
    assert_eq!(app.store.list("tiles").await.unwrap().len(), 1);
    let not_stored = r#"fluxglobe_tile_server_not_stored_total{why="allowance"}"#;
    assert_eq!(app.metric(not_stored).await, 7);
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
    let first = app.get("/api/products").await;
    let tag = first.header("etag").to_owned();
    let of_content = Digest::of(&first.body);
    assert_eq!(
        tag,
        format!("W/\"{of_content}\""),
        "another program says other things of the same versions"
    );
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

/// The address of a tile that TileJSON hands out, complete.
async fn pinned_tile(app: &TestApp, tilejson: &str) -> String {
    let body = app.get(tilejson).await.json();
    let template = body["pinned_tiles"][0].as_str().unwrap();
    template
        .replace("{z}/{x}/{y}", "1/0/0")
        .replace("{time}", "2000-02-01T00:00:00Z")
}

/// An address without one of its parameters.
fn without(address: &str, name: &str) -> String {
    let (path, query) = address.split_once('?').unwrap();
    let parts = query.split('&');
    let kept: Vec<_> = parts.filter(|part| !part.starts_with(name)).collect();
    assert_ne!(kept.join("&"), query, "{name}");
    format!("{path}?{}", kept.join("&"))
}

#[tokio::test]
async fn an_address_that_names_everything_may_be_kept_for_ever() {
    let app = TestApp::new().await;
    let pinned = pinned_tile(&app, "/tiles/flux/volume.json").await;
    let answer = app.get(&pinned).await;
    assert_eq!(answer.status, StatusCode::OK, "{}", answer.text());
    assert_eq!(answer.header("cache-control"), PINNED);
    assert_eq!(answer.header("vary"), "", "one copy for all pages");
    let newest = app.get(TILE).await;
    assert_eq!(newest.header("cache-control"), NEWEST);
    assert_eq!(
        (newest.body, newest.headers["etag"].clone()),
        (answer.body, answer.headers["etag"].clone())
    );
    let tag = answer.headers["etag"].to_str().unwrap();
    for (address, lasts) in [(&*pinned, PINNED), (TILE, NEWEST)] {
        let again = app.get_with(address, &[("if-none-match", tag)]).await;
        assert_eq!(again.status, StatusCode::NOT_MODIFIED);
        assert_eq!(again.header("cache-control"), lasts);
    }
    for size in ["&size=512", "&size=256"] {
        let answer = app.get(&format!("{pinned}{size}")).await;
        assert_eq!(answer.header("cache-control"), PINNED, "{size}");
    }
}

#[tokio::test]
async fn an_address_that_leaves_something_open_is_asked_again() {
    let app = TestApp::new().await;
    for pinned in [
        pinned_tile(&app, "/tiles/flux/volume.json").await,
        pinned_tile(&app, "/tiles/flux/map.json?palette=haline&range=-40:40").await,
    ] {
        assert_eq!(app.get(&pinned).await.header("cache-control"), PINNED);
        for name in ["time=", "manifest=", "edition="] {
            let answer = app.get(&without(&pinned, name)).await;
            assert_eq!(answer.status, StatusCode::OK);
            assert_eq!(answer.header("cache-control"), NEWEST, "{name}");
        }
        // Another look, or one that nobody named this edition for.
        for other in ["&coastlines=true", "&reverse=true", "&isolines=auto"] {
            let answer = app.get(&format!("{pinned}{other}")).await;
            assert_eq!(answer.status, StatusCode::OK, "{}", answer.text());
            assert_eq!(answer.header("cache-control"), NEWEST, "{other}");
        }
        let edition = pinned.split_once("edition=").unwrap().1[..16].to_owned();
        let other = pinned.replace(&edition, "0123456789abcdef");
        assert_eq!(app.get(&other).await.header("cache-control"), NEWEST);
        for none in ["", "newest", "0123456789ABCDEF", "0123"] {
            let answer = app.get(&pinned.replace(&edition, none)).await;
            assert_eq!(answer.status, StatusCode::BAD_REQUEST, "{none:?}");
            assert_eq!(answer.header("cache-control"), "no-store");
        }
    }
}

#[tokio::test]
async fn an_address_of_an_old_version_keeps_its_bytes_for_ever() {
    let app = TestApp::with(|settings| settings.tile_memory_bytes = 0).await;
    let [lifted, flat] = [
        pinned_tile(&app, "/tiles/flux/volume.json").await,
        pinned_tile(&app, "/tiles/flux/map.json").await,
    ];
    let before = [app.get(&lifted).await, app.get(&flat).await];
    let flux = app.land("flux", Quantity::CarbonFlux, 2).await;
    let check = async || {
        for (address, before) in [&lifted, &flat].into_iter().zip(&before) {
            let now = app.get(address).await;
            assert_eq!(now.header("cache-control"), PINNED, "{address}");
            assert_eq!(now.body, before.body, "{address}");
        }
    };
    check().await;
    app.land_derived(
        "flux-accumulated",
        Quantity::AccumulatedCarbon,
        2,
        Some(flux),
    )
    .await;
    check().await;
    let new = pinned_tile(&app, "/tiles/flux/volume.json").await;
    assert_ne!(new, lifted);
    let answer = app.get(&new).await;
    assert_eq!(answer.header("cache-control"), PINNED);
    assert_ne!(answer.body, before[0].body);
    // Asked for by its version, a layer names the same addresses as it did.
    let (_, query) = lifted.split_once("manifest=").unwrap();
    let manifest = query.split('&').next().unwrap();
    let named = format!("/tiles/flux/volume.json?manifest={manifest}");
    assert_eq!(pinned_tile(&app, &named).await, lifted);
    let tiles = app.get(&format!("{named}&time=2000-02-01")).await.json();
    let tiles = tiles["tiles"][0].as_str().unwrap();
    assert_eq!(tiles.replace("{z}/{x}/{y}", "1/0/0"), lifted);
}

#[tokio::test]
async fn an_edition_ends_with_what_its_picture_was_drawn_from() {
    let app = TestApp::empty(|_settings| {});
    let flux = app.land("flux", Quantity::CarbonFlux, 1).await;
    let [lifted, flat] = [
        pinned_tile(&app, "/tiles/flux/volume.json").await,
        pinned_tile(&app, "/tiles/flux/map.json").await,
    ];
    let before = app.get(&lifted).await;
    assert_eq!(before.header("cache-control"), PINNED);
    app.land_derived(
        "flux-accumulated",
        Quantity::AccumulatedCarbon,
        1,
        Some(flux),
    )
    .await;
    let after = app.get(&lifted).await;
    assert_ne!(after.body, before.body, "it is lifted now");
    assert_eq!(after.header("cache-control"), NEWEST);
    assert_eq!(app.get(&flat).await.header("cache-control"), PINNED);
}

#[tokio::test]
async fn an_edition_ends_with_a_new_version_of_what_is_drawn_beside_the_layer() {
    let app = TestApp::new().await;
    for part in ["sea-east", "sea-north"] {
        app.land(part, Quantity::Current, 1).await;
    }
    let trails = pinned_tile(&app, "/tiles/flux/map.json?trails=sea").await;
    let plain = pinned_tile(&app, "/tiles/flux/map.json").await;
    let flow = pinned_tile(&app, "/tiles/sea-east/flow.json").await;
    let lasts = async |address: &str| app.get(address).await.header("cache-control").to_owned();
    for address in [&trails, &plain, &flow] {
        assert_eq!(lasts(address).await, PINNED);
    }
    app.land("sea-north", Quantity::Current, 2).await;
    assert_eq!(lasts(&trails).await, NEWEST);
    assert_eq!(
        lasts(&flow).await,
        NEWEST,
        "the northward part has no version in the address"
    );
    assert_eq!(lasts(&plain).await, PINNED);
}

#[tokio::test]
async fn a_view_names_the_address_that_may_be_kept_for_ever() {
    let app = TestApp::new().await;
    for query in [
        "",
        "?",
        "?time=2000-02-20&lon=-30&height_km=4000&palette=haline",
        "?annotate=all&look_at=10,20&tilt=60&edition=0123456789abcdef",
    ] {
        let path = format!("/globe/flux/volume.png{query}");
        let first = app.get(&path).await;
        assert_eq!(first.status, StatusCode::OK, "{}", first.text());
        assert_eq!(first.header("cache-control"), NEWEST);
        let pinned = first.header("content-location").to_owned();
        let second = app.get(&pinned).await;
        assert_eq!(second.header("cache-control"), PINNED, "{pinned}");
        assert_eq!(
            (second.header("etag"), &second.body),
            (first.header("etag"), &first.body)
        );
        assert_eq!(second.header("content-location"), "", "it is there already");
        for name in ["time=", "manifest=", "edition="] {
            let answer = app.get(&without(&pinned, name)).await;
            assert_eq!(answer.header("cache-control"), NEWEST, "{name}");
        }
        // What is drawn over a picture goes by its camera.
        let turned = app.get(&format!("{pinned}&roll=5")).await;
        let lasts = if query.contains("annotate") {
            NEWEST
        } else {
            PINNED
        };
        assert_eq!(turned.header("cache-control"), lasts, "{query}");
    }
}

#[tokio::test]
async fn the_list_of_products_names_addresses_that_may_be_kept_for_ever() {
    let app = TestApp::new().await;
    for part in ["sea-east", "sea-north"] {
        app.land(part, Quantity::Current, 1).await;
    }
    let list = app.get("/api/products").await.json();
    let mut count = 0;
    for product in list["products"].as_array().unwrap() {
        let modes: Vec<_> = product["pinned"]
            .as_array()
            .unwrap()
            .iter()
            .map(|one| &one["mode"])
            .collect();
        assert_eq!(
            modes,
            product["modes"]
                .as_array()
                .unwrap()
                .iter()
                .collect::<Vec<_>>()
        );
        for one in product["pinned"].as_array().unwrap() {
            let [tile, globe] = ["tiles", "globe"].map(|of| {
                let template = one[of].as_str().unwrap();
                let time = product["steps"][1]["mid"].as_str().unwrap();
                template
                    .replace("{z}/{x}/{y}", "1/0/0")
                    .replace("{time}", time)
            });
            for address in [
                tile,
                format!("{globe}&lon=30&height_km=-50&tilt=180"),
                globe,
            ] {
                let answer = app.get(&address).await;
                assert_eq!(answer.status, StatusCode::OK, "{}", answer.text());
                assert_eq!(answer.header("cache-control"), PINNED, "{address}");
                count += 1;
            }
        }
    }
    assert!(count >= 3 * (4 + 1 + 4 + 5 + 4), "{count}");
}

#[tokio::test]
async fn who_has_an_answer_already_is_not_sent_it_again() {
    let app = TestApp::new().await;
    let point = "/api/products/sst/point?lon=0&lat=0";
    for address in [
        point,
        "/api/products/flux/area?region=global",
        "/api/products/flux/budget?region=global",
    ] {
        let first = app.get(address).await;
        assert_eq!(first.status, StatusCode::OK, "{address}: {}", first.text());
        let tag = first.header("etag").to_owned();
        let known = app.get_with(address, &[("if-none-match", &tag)]).await;
        assert_eq!(known.status, StatusCode::NOT_MODIFIED, "{address}");
        assert!(known.body.is_empty());
        assert_eq!(known.header("etag"), tag);
        let other = app
            .get_with(address, &[("if-none-match", "W/\"other\"")])
            .await;
        assert_eq!((other.status, &other.body), (StatusCode::OK, &first.body));
    }
    // Another form is another answer, and a refusal has no tag.
    let csv = app.get(&format!("{point}&format=csv")).await;
    assert_ne!(csv.header("etag"), app.get(point).await.header("etag"));
    let refused = app.get("/api/products/sst/point?lon=0&lat=75").await;
    assert!(!refused.headers.contains_key("etag"));
}
