//! Layers of particles that drift: a product `NAME-east` beside `NAME-north`.

use std::time::Duration;

use axum::http::StatusCode;
use contract::job::Mode;
use contract::quantity::Quantity;
use serde_json::json;

use crate::app::TestApp;
use crate::events::Viewer;

async fn app() -> TestApp {
    let app = TestApp::new().await;
    app.land("sea-east", Quantity::Current, 1).await;
    app.land("sea-north", Quantity::Current, 1).await;
    app
}

#[tokio::test]
async fn a_flow_tile_is_drawn_from_both_parts_and_moves_with_the_instant() {
    let app = app().await;
    let time = "2000-02-10T06:00:00Z";
    let tile = async |time: &str| {
        app.get(&format!("/tiles/sea-east/flow/3/2/1.png?time={time}"))
            .await
    };
    let answer = tile(time).await;
    assert_eq!(answer.status, StatusCode::OK);
    let job = app.drawer.last_job();
    assert_eq!((job.mode, &job.accumulated), (Mode::Flow, &None));
    assert_eq!(job.value, app.time_sample("sea-east", time).await);
    let flow = job.flow.unwrap();
    assert_eq!(flow.northward, app.time_sample("sea-north", time).await);
    assert!(
        (flow.clock_s - 950_162_400.0).abs() < 1e-3,
        "{}",
        flow.clock_s
    );
    assert!(job.style.transfer.low.abs() < 1e-12, "colours are speeds");
    assert_eq!(tile(time).await.header("etag"), answer.header("etag"));
    // Before the middle of the first step no value changes, but particles drift.
    let (early, later) = (tile("2000-01-02").await, tile("2000-01-03").await);
    assert_ne!(early.header("etag"), later.header("etag"));
}

#[tokio::test]
async fn globes_tiles_and_descriptions_of_a_flow_are_there() {
    let app = app().await;
    for address in [
        "/tiles/sea-east/flow/0/0/0@2x.png",
        "/tiles/sea-east/flow.json",
        "/globe/sea-east/flow.png?lon=20&lat=-35&height_km=3000",
    ] {
        assert_eq!(app.get(address).await.status, StatusCode::OK, "{address}");
    }
    assert!(app.drawer.last_job().style.globe_surface);
}

#[tokio::test]
async fn a_product_without_a_northward_part_is_no_flow_and_the_answer_says_what_is() {
    let app = app().await;
    app.land("lone-east", Quantity::Current, 1).await;
    app.land("salt-east", Quantity::Salinity, 1).await;
    app.land("salt-north", Quantity::Salinity, 1).await;
    for product in [
        "flux",
        "sst",
        "flux-accumulated",
        "sea-north",
        "lone-east",
        "salt-east",
    ] {
        for address in [
            format!("/tiles/{product}/flow/0/0/0.png"),
            format!("/tiles/{product}/flow.json"),
            format!("/globe/{product}/flow.png"),
        ] {
            let answer = app.get(&address).await;
            assert_eq!(answer.status, StatusCode::BAD_REQUEST, "{address}");
            let reason = answer.reason();
            assert!(
                reason.contains(product) && reason.contains("NAME-north"),
                "{reason}"
            );
        }
    }
    // Other modes that are none stay what they were.
    let answer = app.get("/tiles/flux/fog/0/0/0.png").await;
    assert_eq!(answer.status, StatusCode::NOT_FOUND);
}

#[tokio::test]
async fn the_list_of_products_offers_a_flow_with_a_legend_of_speeds_where_there_is_one() {
    let app = app().await;
    let body = app.get("/api/products").await.json();
    let find = |id: &str| {
        let products = body["products"].as_array().unwrap();
        products
            .iter()
            .find(|product| product["product"] == id)
            .unwrap()
            .clone()
    };
    let east = find("sea-east");
    assert_eq!(
        east["modes"],
        json!(["map", "points", "sprites", "volume", "flow"])
    );
    assert_eq!(east["flow_legend"]["low"], json!(0.0));
    assert_eq!(east["flow_legend"]["unit"], json!("m s⁻¹"));
    assert_eq!(
        east["legend"]["low"],
        json!(-1.5),
        "its own values have a sign"
    );
    for other in ["sea-north", "flux"] {
        let product = find(other);
        assert!(
            !product["modes"]
                .as_array()
                .unwrap()
                .contains(&json!("flow")),
            "{other}"
        );
        assert!(product.get("flow_legend").is_none(), "{other}");
    }
}

#[tokio::test]
async fn a_new_northward_part_changes_flows_and_nothing_else_and_old_versions_drift_with_it() {
    let app = app().await;
    let tag = async |mode: &str, version: &str| {
        let path = format!("/tiles/sea-east/{mode}/0/0/0.png?time=2000-03-20{version}");
        app.get(&path).await.header("etag").to_owned()
    };
    let before = [tag("flow", "").await, tag("map", "").await];
    let old = app.land("sea-east", Quantity::Current, 2).await;
    app.land("sea-east", Quantity::Current, 3).await;
    let newest = tag("flow", "").await;
    app.land_last_month("sea-north", Quantity::Current, 2, None)
        .await;
    assert_ne!(tag("flow", "").await, newest);
    let [flow, map] = before;
    assert_ne!(tag("flow", "").await, flow);
    assert_ne!(tag("map", "").await, map);
    let named = format!("&manifest={old}");
    assert_ne!(tag("flow", &named).await, tag("flow", "").await);
    let time = "2000-03-20";
    let drawn = app.drawer.last_job().flow.unwrap().northward;
    assert_eq!(drawn, app.time_sample("sea-north", time).await);
}

#[tokio::test]
async fn without_a_log_a_new_northward_part_is_news_of_the_flow_too() {
    let app = app().await;
    let watch = app.state.watch().every(Duration::from_millis(20));
    let watching = tokio::spawn(watch.run());
    let mut viewer = Viewer::new(&app, None).await;
    // What is there already is no news.
    tokio::time::sleep(Duration::from_millis(200)).await;
    let new = app
        .land_last_month("sea-north", Quantity::Current, 2, None)
        .await;
    let mut names = vec![];
    for _ in 0..2 {
        let told = viewer.next().await.unwrap().data;
        assert_eq!(told["touched"][0]["start"], "2000-02-01T00:00:00Z");
        names.push(told["manifest"].as_str().unwrap().to_owned());
    }
    names.sort();
    assert!(names[0].starts_with("sea-east@1-"), "{names:?}");
    assert_eq!(names[1], new.to_string());
    app.state.news.close();
    watching.await.unwrap();
}

#[tokio::test]
async fn trails_of_a_vector_lie_over_another_layer_on_tiles_and_globes() {
    let app = app().await;
    let time = "2000-02-10T06:00:00Z";
    for (view, mode) in [
        ("/tiles/flux/map/1/0/1.png", Mode::Map),
        ("/globe/flux/volume.png", Mode::Volume),
    ] {
        for name in ["sea", "sea-east", "sea-north"] {
            let answer = app.get(&format!("{view}?time={time}&trails={name}")).await;
            assert_eq!(answer.status, StatusCode::OK, "{}", answer.text());
            let job = app.drawer.last_job();
            let trails = job.trails.as_ref().unwrap();
            assert_eq!((job.mode, &job.flow), (mode, &None));
            assert_eq!(trails.eastward, app.time_sample("sea-east", time).await);
            let northward = app.time_sample("sea-north", time).await;
            assert_eq!(trails.flow.northward, northward);
        }
        let plain = app.get(&format!("{view}?time={time}")).await;
        assert!(app.drawer.last_job().trails.is_none());
        let other = format!("{view}?time={time}&trails=sea&trails_time=2000-03-10");
        let other = app.get(&other).await;
        assert_eq!(other.status, StatusCode::OK, "{}", other.text());
        let job = app.drawer.last_job();
        let sample = app.time_sample("sea-east", "2000-03-10").await;
        assert_eq!(job.trails.unwrap().eastward, sample);
        assert_ne!(plain.header("etag"), other.header("etag"));
    }
}

#[tokio::test]
async fn trails_of_what_is_no_vector_are_refused() {
    let app = app().await;
    app.land("lone-east", Quantity::Current, 1).await;
    for (layer, query, reason) in [
        ("flux/volume", "trails=flux", "NAME-east"),
        ("flux/volume", "trails=lone", "NAME-east"),
        ("flux/volume", "trails=Sea", "starting with a letter"),
        (
            "flux/volume",
            "trails=sea&trails_time=2010-01-01",
            "it covers",
        ),
        ("flux/volume", "trails_time=2000-02-10", "not asked for"),
        ("sea-east/flow", "trails=sea", "drawn as a flow"),
    ] {
        for path in [
            format!("/tiles/{layer}/0/0/0.png"),
            format!("/globe/{layer}.png"),
        ] {
            let answer = app.get(&format!("{path}?{query}")).await;
            assert_eq!(answer.status, StatusCode::BAD_REQUEST, "{query}");
            assert!(answer.reason().contains(reason), "{}", answer.reason());
        }
    }
    assert_eq!(app.drawer.drawn_count(), 0);
    let map = app.get("/tiles/sea-east/map/0/0/0.png?trails=sea").await;
    assert_eq!(map.status, StatusCode::OK, "{}", map.text());
}
