//! `/tiles/{product}/{mode}/{z}/{x}/{y}.png`.

use axum::body::Body;
use axum::http::{Request, StatusCode};
use contract::job::{Mode, View};
use contract::quantity::Quantity;
use contract::tile::Tile;

use crate::app::TestApp;
use crate::doubles::Drawer;

#[tokio::test]
async fn a_tile_is_the_picture_of_the_job_its_address_means() {
    let app = TestApp::new().await;
    let answer = app
        .get("/tiles/flux/volume/3/2/1.png?time=2000-02-10T06:00:00Z&size=512")
        .await;
    assert_eq!(
        (answer.status, answer.header("content-type")),
        (StatusCode::OK, "image/png")
    );
    let job = app.drawer.last_job();
    assert_eq!(answer.body, Drawer::picture_of(&job));
    assert_eq!(
        job.view,
        View::Tile {
            tile: Tile { z: 3, x: 2, y: 1 },
            size_px: 512
        }
    );
    assert_eq!(job.mode, Mode::Volume);
    let time = "2000-02-10T06:00:00Z";
    assert_eq!(job.value, app.time_sample("flux", time).await);
    let lift = app.time_sample("flux-accumulated", time).await;
    assert_eq!(job.accumulated, Some(lift));
    assert!(!job.style.globe_surface);
}

#[tokio::test]
async fn answers_say_where_heights_end_and_where_they_may_be_flattened() {
    let app = TestApp::new().await;
    let of = async |path: &str| {
        let answer = app.get(path).await;
        assert_eq!(answer.status, StatusCode::OK, "{path}: {}", answer.text());
        let names = ["fluxglobe-heights-end", "fluxglobe-heights-within"];
        names.map(|name| answer.header(name).to_owned())
    };
    // 1200 km at 8000 km for a kilogram a square metre.
    assert_eq!(of("/globe/flux/volume.png").await, ["150 g C m-2", ""]);
    let higher = "/globe/flux/points.png?height_exaggeration=1.9e7";
    assert_eq!(of(higher).await, ["63.158 g C m-2", ""]);
    // 1210 km are 124 pixels at zoom 4, half of them at zoom 3.
    assert_eq!(
        of("/tiles/flux/volume/3/0/0.png").await,
        ["150 g C m-2", ""]
    );
    for deep in [
        "/tiles/flux/volume/4/0/0.png",
        "/tiles/flux/volume/3/0/0@2x.png",
    ] {
        assert_eq!(of(deep).await, ["150 g C m-2", "120 px"], "{deep}");
    }
    for flat in [
        "/tiles/flux/map/4/0/0.png",
        "/tiles/sst/volume/4/0/0.png",
        "/tiles/flux/volume/4/0/0.png?height_exaggeration=0",
    ] {
        assert_eq!(of(flat).await, ["", ""], "{flat}");
    }
    // So do those that say that a copy is still right, and pages of other origins may read it.
    let path = "/tiles/flux/volume/4/0/0.png";
    let tag = app.get(path).await.header("etag").to_owned();
    let asked = [
        ("if-none-match", tag.as_str()),
        ("origin", "http://map.example"),
    ];
    let again = app.get_with(path, &asked).await;
    assert_eq!(again.status, StatusCode::NOT_MODIFIED);
    assert_eq!(again.header("fluxglobe-heights-end"), "150 g C m-2");
    let exposed = again.header("access-control-expose-headers");
    assert!(exposed.contains("fluxglobe-heights-end"), "{exposed}");
    assert!(exposed.contains("fluxglobe-heights-within"), "{exposed}");
}

#[tokio::test]
async fn a_view_with_nothing_but_sky_says_which_tilt_has_ground() {
    let app = TestApp::new().await;
    let of = async |path: &str| {
        let answer = app.get(path).await;
        assert_eq!(answer.status, StatusCode::OK, "{path}: {}", answer.text());
        answer.header("fluxglobe-tilt-with-ground").to_owned()
    };
    let from_low = "/globe/flux/volume.png?height_km=5&width=640&height=480&tilt=";
    assert_eq!(of(&format!("{from_low}150")).await, "110.2 degrees");
    assert_eq!(of(&format!("{from_low}110.2")).await, "");
    assert_eq!(
        of("/globe/flux/volume.png?height_km=-400&tilt=180").await,
        ""
    );
    assert_eq!(of("/tiles/flux/volume/3/0/0.png").await, "");
    let asked = [("origin", "http://map.example")];
    let answer = app.get_with(&format!("{from_low}150"), &asked).await;
    let exposed = answer.header("access-control-expose-headers");
    assert!(exposed.contains("fluxglobe-tilt-with-ground"), "{exposed}");
}

#[tokio::test]
async fn every_mode_has_its_own_picture() {
    let app = TestApp::new().await;
    let mut pictures = vec![];
    for mode in Mode::SCALAR {
        pictures.push(app.get(&format!("/tiles/flux/{mode}/0/0/0.png")).await.body);
    }
    pictures.sort();
    pictures.dedup();
    assert_eq!(pictures.len(), 4);
}

#[tokio::test]
async fn without_a_time_the_middle_of_the_last_step_is_drawn() {
    let app = TestApp::new().await;
    app.get("/tiles/flux/volume/0/0/0.png").await;
    let middle = app.time_sample("flux", "2000-03-16T12:00:00Z").await;
    assert_eq!(app.drawer.last_job().value, middle);
}

#[tokio::test]
async fn instants_beyond_the_product_share_the_picture_of_its_end() {
    let app = TestApp::new().await;
    for mode in ["volume", "map"] {
        let of = async |time: &str| {
            app.get(&format!("/tiles/flux/{mode}/0/0/0.png?time={time}"))
                .await
        };
        let (early, earlier) = (of("1999-12-01").await, of("0001-01-01").await);
        let (late, later) = (of("2000-05-01").await, of("9999-12-31").await);
        assert_eq!(early.header("etag"), earlier.header("etag"));
        assert_eq!(late.header("etag"), later.header("etag"));
        assert_ne!(early.header("etag"), late.header("etag"));
    }
    assert_eq!(app.drawer.drawn_count(), 4);
}

#[tokio::test]
async fn a_map_before_the_middle_of_its_first_step_is_that_step_but_particles_move() {
    let app = TestApp::new().await;
    let tag = async |mode: &str, day: u32| {
        let path = format!("/tiles/flux/{mode}/0/0/0.png?time=2000-01-0{day}");
        app.get(&path).await.header("etag").to_owned()
    };
    assert_eq!(tag("map", 2).await, tag("map", 3).await);
    assert_ne!(tag("volume", 2).await, tag("volume", 3).await);
}

#[tokio::test]
async fn double_resolution_can_be_asked_for_as_map_clients_do() {
    let app = TestApp::new().await;
    let named = app.get("/tiles/flux/map/1/1/0@2x.png").await;
    let asked = app.get("/tiles/flux/map/1/1/0.png?size=512").await;
    assert_eq!(
        (named.status, named.header("etag")),
        (StatusCode::OK, asked.header("etag"))
    );
}

#[tokio::test]
async fn accumulated_carbon_that_came_from_another_version_does_not_lift_particles() {
    let app = TestApp::new().await;
    app.land("flux", Quantity::CarbonFlux, 2).await;
    app.get("/tiles/flux/volume/0/0/0.png").await;
    assert_eq!(app.drawer.last_job().accumulated, None);
    let new = app.time_sample("flux", "2000-03-16T12:00:00Z").await;
    assert_eq!(app.drawer.last_job().value, new);
}

#[tokio::test]
async fn a_landing_leaves_tiles_that_it_does_not_touch_as_they_are() {
    let app = TestApp::new().await;
    let tag = async |mode: &str, time: &str| {
        let path = format!("/tiles/flux/{mode}/0/0/0.png?time={time}");
        app.get(&path).await.header("etag").to_owned()
    };
    let tags = async || {
        let mut tags = vec![];
        for mode in ["map", "volume"] {
            for time in ["2000-01-10", "2000-02-10", "2000-02-20", "2000-03-20"] {
                tags.push(tag(mode, time).await);
            }
        }
        tags
    };
    let is_same = |old: &[String], new: &[String]| -> Vec<bool> {
        old.iter().zip(new).map(|(old, new)| old == new).collect()
    };
    let before = tags().await;
    let drawn = app.drawer.drawn_count();
    let flux = Quantity::CarbonFlux;
    let version = app.land_last_month("flux", flux, 2, None).await;
    // Only the last month differs; it shows from the middle of the one before it.
    let untouched = [true, true, false, false];
    let waiting = tags().await;
    assert_eq!(is_same(&before, &waiting), [untouched, untouched].concat());
    let carbon = Quantity::AccumulatedCarbon;
    app.land_last_month("flux-accumulated", carbon, 2, Some(version))
        .await;
    let after = tags().await;
    assert_eq!(is_same(&before, &after), [untouched, untouched].concat());
    assert_eq!(waiting[..4], after[..4], "maps are not lifted");
    assert_eq!(
        app.drawer.drawn_count() - drawn,
        4 + 1,
        "only what differs was drawn"
    );
}

#[tokio::test]
async fn pages_of_other_origins_may_show_tiles() {
    let app = TestApp::new().await;
    let answer = app
        .get_with(
            "/tiles/flux/map/0/0/0.png",
            &[("origin", "http://map.example")],
        )
        .await;
    assert_eq!(answer.header("access-control-allow-origin"), "*");
}

#[tokio::test]
async fn browsers_that_ask_first_are_let_in() {
    let app = TestApp::new().await;
    let request = Request::builder()
        .method("OPTIONS")
        .uri("/tiles/flux/map/0/0/0.png")
        .header("origin", "http://map.example")
        .header("access-control-request-method", "GET");
    let answer = app.send(request.body(Body::empty()).unwrap()).await;
    assert_eq!(answer.status, StatusCode::OK);
    assert_eq!(answer.header("access-control-allow-origin"), "*");
    assert!(
        answer
            .header("access-control-allow-methods")
            .contains("GET")
    );
}

#[tokio::test]
async fn offsets_of_times_survive_the_address() {
    let app = TestApp::new().await;
    for time in ["2000-02-10T06:00:00%2B02:00", "2000-02-10T06:00:00+02:00"] {
        app.get(&format!("/tiles/flux/volume/0/0/0.png?time={time}"))
            .await;
        let meant = app.time_sample("flux", "2000-02-10T04:00:00Z").await;
        assert_eq!(app.drawer.last_job().value, meant);
    }
}

#[tokio::test]
async fn a_picture_says_which_instant_it_shows_and_what_there_is_if_that_is_another() {
    let app = TestApp::new().await;
    let of = async |time: &str| {
        let tile = app.get(&format!("/tiles/flux/map/0/0/0.png{time}")).await;
        let globe = app.get(&format!("/globe/flux/map.png{time}")).await;
        let said = |answer: &crate::app::Answer| {
            ["fluxglobe-time", "fluxglobe-time-covered"].map(|name| answer.header(name).to_owned())
        };
        assert_eq!(said(&tile), said(&globe));
        let tag = tile.header("etag");
        let asked = format!("/tiles/flux/map/0/0/0.png{time}");
        let again = app.get_with(&asked, &[("if-none-match", tag)]).await;
        assert_eq!(again.status, StatusCode::NOT_MODIFIED);
        assert_eq!(said(&again), said(&tile));
        said(&tile)
    };
    let covered = "2000-01-01T00:00:00Z/2000-04-01T00:00:00Z";
    assert_eq!(of("").await, ["2000-03-16T12:00:00Z", ""]);
    assert_eq!(of("?time=2000-02-03").await, ["2000-02-03T00:00:00Z", ""]);
    assert_eq!(of("?time=1900").await, ["2000-01-01T00:00:00Z", covered]);
    assert_eq!(
        of("?time=2026-11-21").await,
        ["2000-04-01T00:00:00Z", covered]
    );
    let origin = [("origin", "http://map.example")];
    let answer = app.get_with("/tiles/flux/map/0/0/0.png", &origin).await;
    let exposed = answer.header("access-control-expose-headers");
    assert!(exposed.contains("fluxglobe-time-covered"), "{exposed}");
}
