//! `/api/observations/platforms` and `/api/observations/{dataset}/{platform}`.

use std::sync::atomic::Ordering;

use axum::http::StatusCode;
use contract::observation::{Observation, Platform, PlatformKind, Quality, TrackPoint};
use contract::region::Region;
use futures::FutureExt as _;
use serde_json::json;
use tile_server::Settings;
use tile_server::backend::Class;

use crate::app::TestApp;
use crate::doubles::Mood;

pub(crate) fn platform(name: &str, kind: PlatformKind) -> Platform {
    Platform {
        dataset: "buoys".parse().unwrap(),
        platform: name.to_owned(),
        kind,
        first: "2020-01-01".parse().unwrap(),
        last: "2020-02-01".parse().unwrap(),
        bounds_deg: [-155.0, 0.5, -155.0, 0.5],
        lon_deg: -155.0,
        lat_deg: 0.5,
        properties: vec!["sea_surface_temperature".to_owned()],
        count: 3,
    }
}

pub(crate) fn observation(hour: u32, quality: Quality) -> Observation {
    Observation {
        dataset: "buoys".parse().unwrap(),
        platform: "51001".to_owned(),
        kind: PlatformKind::Buoy,
        time: format!("2020-01-01T{hour:02}:00:00Z").parse().unwrap(),
        lon_deg: -155.0,
        lat_deg: 0.5,
        depth_m: 1.5,
        property: "sea_surface_temperature".to_owned(),
        value: 25.0 + f64::from(hour),
        unit: "degC".to_owned(),
        quality,
    }
}

async fn with_buoy() -> TestApp {
    let app = TestApp::new().await.observing();
    let series = (0..5).map(|hour| observation(hour, Quality::Good));
    *app.observer.observations.lock().unwrap() = series.collect();
    app
}

#[tokio::test]
async fn platforms_are_points_and_ships_are_tracks() {
    let app = TestApp::new().await.observing();
    let at = |lon_deg: f64| TrackPoint {
        time: "2020-01-01".parse().unwrap(),
        lon_deg,
        lat_deg: 10.0,
    };
    *app.observer.platforms.lock().unwrap() = vec![
        platform("51001", PlatformKind::Buoy),
        platform("MLCE", PlatformKind::Ship),
    ];
    *app.observer.track.lock().unwrap() = vec![at(178.0), at(-178.0), at(-177.0)];
    let answer = app.get("/api/observations/platforms").await;
    assert_eq!(answer.status, StatusCode::OK);
    let body = answer.json();
    assert_eq!(body["type"], "FeatureCollection");
    let buoy = &body["features"][0];
    assert_eq!(buoy["id"], "buoys/51001");
    assert_eq!(
        buoy["geometry"],
        json!({"type": "Point", "coordinates": [-155.0, 0.5]})
    );
    let row = serde_json::to_value(platform("51001", PlatformKind::Buoy)).unwrap();
    assert_eq!(buoy["properties"], row);
    let track = [
        [[178.0, 10.0], [180.0, 10.0]].to_vec(),
        [[-180.0, 10.0], [-178.0, 10.0], [-177.0, 10.0]].to_vec(),
    ];
    assert_eq!(
        body["features"][1]["geometry"],
        json!({"type": "MultiLineString", "coordinates": track}),
        "cut at the date line"
    );
}

#[tokio::test]
async fn many_buoys_take_no_ship_its_track_but_there_is_a_limit() {
    let app = TestApp::new().await.observing();
    let at = |lon_deg: f64| TrackPoint {
        time: "2020-01-01".parse().unwrap(),
        lon_deg,
        lat_deg: 10.0,
    };
    *app.observer.track.lock().unwrap() = vec![at(1.0), at(2.0)];
    let of = |kind| move |number| platform(&format!("{number}"), kind);
    let buoys = (0..80).map(of(PlatformKind::Buoy));
    let ships = (80..200).map(of(PlatformKind::Ship));
    *app.observer.platforms.lock().unwrap() = buoys.chain(ships).collect();
    let body = app.get("/api/observations/platforms").await.json();
    let features = body["features"].as_array().unwrap();
    let is_track = |number: usize| features[number]["geometry"]["type"] == "MultiLineString";
    assert_eq!(features.len(), 200);
    let tracks = (0..200).filter(|number| is_track(*number)).count();
    assert_eq!(tracks, 50);
    assert!(is_track(80) && is_track(129) && !is_track(130));
    let fleets = app.observer.fleets.lock().unwrap();
    assert_eq!(*fleets, [50], "one question about all of them");
}

#[tokio::test]
async fn a_list_that_is_cut_says_so() {
    let app = TestApp::new().await.observing();
    let list = async |count: usize| {
        let buoys = (0..count).map(|number| platform(&format!("{number}"), PlatformKind::Buoy));
        *app.observer.platforms.lock().unwrap() = buoys.collect();
        let body = app.get("/api/observations/platforms").await.json();
        let shown = body["features"].as_array().unwrap().len();
        (shown, body["is_complete"].as_bool().unwrap())
    };
    assert_eq!(list(0).await, (0, true));
    assert_eq!(list(10_000).await, (10_000, true));
    assert_eq!(list(10_001).await, (10_000, false));
}

#[tokio::test]
async fn the_question_is_what_the_address_says() {
    let app = TestApp::new().await.observing();
    app.get("/api/observations/platforms?region=170,-10,-170,10&from=2020-01-01&to=2021-01-01&property=wind_speed&kind=ship")
        .await;
    let asked = app.observer.last_question();
    assert_eq!(asked.region, "170,-10,-170,10".parse::<Region>().unwrap());
    assert_eq!(asked.from, Some("2020-01-01".parse().unwrap()));
    assert_eq!(asked.to, Some("2021-01-01".parse().unwrap()));
    assert_eq!(asked.properties, ["wind_speed"]);
    assert_eq!(asked.kinds, [PlatformKind::Ship]);
    assert!(asked.limit >= 10_000, "the limit is one of platforms too");
    assert_eq!(asked.worst, Quality::Bad, "as the series counts");
}

#[tokio::test]
async fn a_series_tells_unit_and_quality_a_page_at_a_time() {
    let app = with_buoy().await;
    app.observer.observations.lock().unwrap()[1].quality = Quality::Bad;
    let path = "/api/observations/buoys/51001?limit=2&property=sea_surface_temperature";
    let first = app.get(path).await.json();
    assert_eq!(
        first["observations"][1],
        json!({"dataset": "buoys", "platform": "51001", "kind": "buoy", "time": "2020-01-01T01:00:00Z",
            "lon_deg": -155.0, "lat_deg": 0.5, "depth_m": 1.5, "property": "sea_surface_temperature", "value": 26.0,
            "unit": "degC", "quality": "bad"})
    );
    let mut next = first["next"].clone();
    let mut count = 2;
    while let Some(after) = next.as_str() {
        let page = app.get(&format!("{path}&after={after}")).await.json();
        count += page["observations"].as_array().unwrap().len();
        next = page["next"].clone();
    }
    assert_eq!(count, 5);
    let asked = app.observer.last_question();
    assert_eq!(asked.platforms, ["51001"]);
    assert_eq!(
        asked.worst,
        Quality::Bad,
        "the reader judges, not the server"
    );
}

#[tokio::test]
async fn the_worst_quality_that_is_wanted_may_be_said() {
    let app = with_buoy().await;
    for path in ["buoys/51001", "platforms"] {
        let answer = app
            .get(&format!("/api/observations/{path}?worst=not_evaluated"))
            .await;
        assert_eq!(answer.status, StatusCode::OK, "{path}");
        assert_eq!(
            app.observer.last_question().worst,
            Quality::NotEvaluated,
            "{path}"
        );
    }
}

#[tokio::test]
async fn names_of_platforms_may_hold_anything() {
    let app = with_buoy().await;
    app.get("/api/observations/buoys/A%20B%2F..%2F%C3%A9%3Cb%3E")
        .await;
    assert_eq!(app.observer.last_question().platforms, ["A B/../é<b>"]);
}

#[tokio::test]
async fn bad_questions_say_what_is_wrong_and_reach_nobody() {
    let app = with_buoy().await;
    for path in [
        "platforms?region=1,2,3",
        "platforms?region=0,-91,1,1",
        "platforms?from=yesterday",
        "platforms?kind=whale",
        "platforms?dataset=../secret",
        "platforms?worst=excellent",
        "buoys/51001?worst=2",
        "platforms?colour=red",
        "buoys/51001?limit=0",
        "buoys/51001?limit=10001",
        "buoys/51001?limit=-1",
        "buoys/51001?to=x",
        "Not%20a%20name!/51001",
    ] {
        let answer = app.get(&format!("/api/observations/{path}")).await;
        assert_eq!(answer.status, StatusCode::BAD_REQUEST, "{path}");
        assert!(!answer.reason().is_empty());
    }
    assert!(app.observer.questions.lock().unwrap().is_empty());
}

#[tokio::test]
async fn what_was_called_otherwise_before_is_answered_with_what_to_write() {
    let app = with_buoy().await;
    let answer = app.get("/api/observations/platforms?bbox=0,0,1,1").await;
    assert_eq!(answer.status, StatusCode::BAD_REQUEST);
    assert!(answer.reason().contains("region="), "{}", answer.reason());
}

#[tokio::test]
async fn a_server_without_observations_says_so() {
    let app = TestApp::new().await;
    for path in ["platforms", "buoys/51001"] {
        let answer = app.get(&format!("/api/observations/{path}")).await;
        assert_eq!(answer.status, StatusCode::NOT_FOUND);
        assert!(answer.reason().contains("no observations"));
    }
}

#[tokio::test]
async fn a_data_set_that_is_not_there_is_told_with_those_that_are() {
    let app = TestApp::new().await.observing();
    *app.observer.platforms.lock().unwrap() = vec![platform("51001", PlatformKind::Buoy)];
    for path in ["floats/51001", "platforms?dataset=floats"] {
        let answer = app.get(&format!("/api/observations/{path}")).await;
        assert_eq!(answer.status, StatusCode::NOT_FOUND, "{path}");
        assert_eq!(
            answer.reason(),
            "there is no data set \"floats\"; there are buoys"
        );
    }
    let answer = app.get("/api/observations/platforms?dataset=buoys").await;
    assert_eq!(answer.json()["features"].as_array().unwrap().len(), 1);
    // One that measured nothing then is there.
    let answer = app.get("/api/observations/buoys/51001?to=1990-01-01").await;
    assert_eq!(answer.status, StatusCode::OK);
    assert_eq!(answer.json()["observations"], json!([]));
}

#[tokio::test]
async fn a_database_that_is_away_is_worth_another_try() {
    let app = with_buoy().await;
    app.observer
        .set(Mood::fails(Class::Unavailable, "the database is away"));
    for path in ["platforms", "buoys/51001"] {
        let answer = app.get(&format!("/api/observations/{path}")).await;
        assert_eq!(answer.status, StatusCode::SERVICE_UNAVAILABLE);
        assert_eq!(answer.header("retry-after"), "5");
    }
}

#[tokio::test]
async fn questions_beyond_the_limit_are_sent_away_with_a_time_to_come_back() {
    let change = |settings: &mut Settings| {
        (settings.analyses_at_once, settings.analysis_queue) = (1, 1);
    };
    let app = TestApp::with(change).await.observing();
    app.observer.is_stuck.store(true, Ordering::SeqCst);
    let platforms = "/api/observations/platforms";
    let (mut asking, mut waiting) = (Box::pin(app.get(platforms)), Box::pin(app.get(platforms)));
    assert!(asking.as_mut().now_or_never().is_none());
    assert!(waiting.as_mut().now_or_never().is_none());
    assert_eq!(app.observer.questions.lock().unwrap().len(), 1);
    for path in [platforms, "/api/observations/buoys/51001"] {
        let sent_away = app.get(path).await;
        assert_eq!(sent_away.status, StatusCode::SERVICE_UNAVAILABLE, "{path}");
        assert_eq!(sent_away.header("retry-after"), "1");
    }
    // Numbers of products are asked of others.
    let point = app.get("/api/products/flux/point?lon=0&lat=0").await;
    assert_eq!(point.status, StatusCode::OK);
    app.observer.is_stuck.store(false, Ordering::SeqCst);
    drop(asking);
    assert_eq!(waiting.await.status, StatusCode::OK);
}
