//! What happens when there is too much to do, when something takes too long, and when something breaks.

use std::num::NonZeroU32;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use axum::body::Body;
use axum::http::{HeaderName, Request, StatusCode};
use futures::FutureExt;
use tile_server::backend::{BackendError, Class};
use tokio::sync::Semaphore;

use crate::app::{Answer, TestApp};
use crate::doubles::Mood;

const TILE: &str = "/tiles/flux/volume/1/0/0.png";

#[tokio::test]
async fn when_the_queue_is_full_clients_are_sent_away_with_a_time_to_come_back() {
    let app = TestApp::with(|settings| {
        (settings.draws_at_once, settings.draw_queue) = (Some(NonZeroU32::MIN), 1);
    })
    .await;
    app.drawer.is_slow.store(true, Ordering::SeqCst);
    let mut drawn = Box::pin(app.get("/tiles/flux/map/2/0/0.png"));
    let mut waits = Box::pin(app.get("/tiles/flux/map/2/1/0.png"));
    while app.drawer.drawn_count() == 0 {
        assert!(drawn.as_mut().now_or_never().is_none());
        tokio::task::yield_now().await;
    }
    while app.metric("fluxglobe_tile_server_cache_misses_total").await < 2 {
        assert!(waits.as_mut().now_or_never().is_none());
        tokio::task::yield_now().await;
    }
    let sent_away = app.get("/tiles/flux/map/2/2/0.png").await;
    assert_eq!(
        (sent_away.status, sent_away.header("retry-after")),
        (StatusCode::SERVICE_UNAVAILABLE, "1")
    );
    assert!(sent_away.reason().contains("try again"));
    app.drawer.turns.add_permits(2);
    assert_eq!(
        (drawn.await.status, waits.await.status),
        (StatusCode::OK, StatusCode::OK)
    );
    assert_eq!(app.metric("fluxglobe_tile_server_refused_total").await, 1);
    app.drawer.is_slow.store(false, Ordering::SeqCst);
    assert_eq!(
        app.get("/tiles/flux/map/2/2/0.png").await.status,
        StatusCode::OK
    );
}

/// Requests for as many tiles, begun; they end when they are waited for.
async fn begun(app: &TestApp, tiles: u64) -> Vec<impl Future<Output = Answer> + Unpin> {
    let address = |x| format!("/tiles/flux/map/3/{x}/0.png");
    let mut all = vec![];
    for x in 0..tiles {
        let mut one = Box::pin(async move { app.get(&address(x)).await });
        while app.metric("fluxglobe_tile_server_cache_misses_total").await <= x {
            assert!(one.as_mut().now_or_never().is_none());
            tokio::task::yield_now().await;
        }
        all.push(one);
    }
    all
}

/// Waits with those who ask until so many pictures were begun to be drawn; false if that never comes.
async fn were_drawn(
    app: &TestApp,
    all: &mut [impl Future<Output = Answer> + Unpin],
    count: usize,
) -> bool {
    let drawn = async {
        while app.drawer.drawn_count() < count {
            for one in &mut *all {
                assert!(one.now_or_never().is_none());
            }
            tokio::task::yield_now().await;
        }
    };
    let limit = Duration::from_mins(1);
    tokio::time::timeout(limit, drawn).await.is_ok()
}

#[tokio::test]
async fn a_picture_that_is_encoded_holds_up_no_other_and_counts_until_it_is_stored() {
    let app = TestApp::with(|settings| {
        (settings.draws_at_once, settings.draw_queue) = (Some(NonZeroU32::MIN), 2);
    })
    .await;
    app.drawer.encodes_slowly.store(true, Ordering::SeqCst);
    let mut all = begun(&app, 3).await;
    // One may be drawn at once, and none is done: the first two are drawn though.
    assert!(were_drawn(&app, &mut all, 3).await);
    let sent_away = app.get(TILE).await;
    assert_eq!(sent_away.status, StatusCode::SERVICE_UNAVAILABLE);
    app.drawer.turns.add_permits(3);
    for one in all {
        assert_eq!(one.await.status, StatusCode::OK);
    }
}

#[tokio::test]
async fn as_many_are_drawn_at_once_as_were_asked_for_or_as_suit_the_drawer() {
    for (asked, at_once) in [(None, 2), (NonZeroU32::new(3), 3)] {
        let app = TestApp::with(|settings| settings.draws_at_once = asked).await;
        app.drawer.is_slow.store(true, Ordering::SeqCst);
        let mut all = begun(&app, 4).await;
        assert!(were_drawn(&app, &mut all, at_once).await, "{asked:?}");
        // Whoever could begin has had the time to.
        for _ in 0..100 {
            for one in &mut all {
                assert!(one.now_or_never().is_none());
            }
            tokio::task::yield_now().await;
        }
        assert_eq!(app.drawer.drawn_count(), at_once);
        app.drawer.turns.add_permits(4);
        for one in all {
            assert_eq!(one.await.status, StatusCode::OK);
        }
        assert_eq!(app.drawer.drawn_count(), 4);
    }
}

/// Asks for the series of a column's cell as somebody.
async fn asked(app: &TestApp, somebody: &str, col: u32) -> Answer {
    let lon = f64::from(col) * 10.0 - 175.0;
    let path = format!("/api/products/flux/point?lon={lon}&lat=5");
    app.get_with(&path, &[("x-forwarded-for", somebody)]).await
}

/// Goes on with those who ask until so many of them wait for a turn and so many were worked at.
async fn until(app: &TestApp, all: &mut [impl Future<Output = Answer> + Unpin], wanted: [u64; 2]) {
    let waited = async {
        loop {
            for one in &mut *all {
                assert!(one.now_or_never().is_none());
            }
            let waiting = app.metric("fluxglobe_tile_server_analyses_waiting").await;
            let asked = app.analyst.points.lock().unwrap().len() as u64;
            if [waiting, asked] == wanted {
                return;
            }
            tokio::task::yield_now().await;
        }
    };
    let limit = Duration::from_mins(1);
    assert!(
        tokio::time::timeout(limit, waited).await.is_ok(),
        "{wanted:?} never came"
    );
}

#[tokio::test]
async fn who_asks_for_one_series_beside_somebody_who_asks_for_many_waits_for_one_of_them() {
    let turns = Arc::new(Semaphore::new(0));
    let app = TestApp::with_turns(Arc::clone(&turns), |settings| {
        (settings.analyses_at_once, settings.analysis_queue) = (1, 12);
        settings.client_header = Some(HeaderName::from_static("x-forwarded-for"));
    })
    .await;
    let many = "203.0.113.9, 192.0.2.1";
    let mut all = vec![];
    for col in 0..7 {
        all.push(asked(&app, many, col).boxed_local());
        until(&app, &mut all, [col.into(), 1]).await;
    }
    // One is worked at, six wait: half of the queue. Who says to be somebody else in front of the proxy is not.
    let path = "/api/products/flux/point?lon=175&lat=5";
    let too_many = app.get_with(path, &[("x-forwarded-for", "192.0.2.77, 192.0.2.1")]);
    assert_eq!(too_many.await.status, StatusCode::SERVICE_UNAVAILABLE);
    all.push(asked(&app, "192.0.2.2", 30).boxed_local());
    until(&app, &mut all, [7, 1]).await;
    turns.add_permits(8);
    let answers = futures::future::join_all(all).await;
    assert!(answers.iter().all(|answer| answer.status == StatusCode::OK));
    let order: Vec<f64> = app
        .analyst
        .points
        .lock()
        .unwrap()
        .iter()
        .map(|place| place.lon)
        .collect();
    assert_eq!(order[..4], [-175.0, -165.0, 125.0, -155.0], "{order:?}");
}

#[tokio::test]
async fn a_thousand_questions_at_once_are_computed_once_each_and_all_answered() {
    let turns = Arc::new(Semaphore::new(0));
    let app = TestApp::with_turns(Arc::clone(&turns), |settings| {
        settings.client_header = Some(HeaderName::from_static("x-forwarded-for"));
    })
    .await;
    let somebody: Vec<String> = (0..10).map(|last| format!("192.0.2.{last}")).collect();
    // Ten clients ask for the same ten places a hundred times.
    let all = (0..1000).map(|at: u32| asked(&app, &somebody[at as usize % 10], at % 10));
    let mut all: Vec<_> = all.map(FutureExt::boxed_local).collect();
    until(&app, &mut all, [8, 2]).await;
    turns.add_permits(10);
    let answers = futures::future::join_all(all).await;
    assert!(answers.iter().all(|answer| answer.status == StatusCode::OK));
    assert_eq!(app.analyst.points.lock().unwrap().len(), 10);
    assert_eq!(app.metric("fluxglobe_tile_server_refused_total").await, 0);
}

#[tokio::test]
async fn an_answer_that_takes_too_long_ends_with_a_reason() {
    let app = TestApp::with(|settings| settings.request_limit_s = 1).await;
    app.drawer.is_slow.store(true, Ordering::SeqCst);
    let answer = tokio::time::timeout(Duration::from_mins(1), app.get(TILE)).await;
    let answer = answer.expect("it ends");
    assert_eq!(answer.status, StatusCode::GATEWAY_TIMEOUT);
    assert!(answer.reason().contains("longer than 1 s"));
    assert!(!answer.header("retry-after").is_empty());
    assert_eq!(
        app.metric(r#"fluxglobe_tile_server_in_flight{operation="/metrics"}"#)
            .await,
        1,
        "the request for the metrics"
    );
    let tiles =
        r#"fluxglobe_tile_server_in_flight{operation="/tiles/{product}/{mode}/{z}/{x}/{y_png}"}"#;
    let text = app.get("/metrics").await.text();
    assert!(text.contains(&format!("{tiles} 0\n")), "no other: {text}");
}

#[tokio::test]
async fn classes_of_backend_failures_are_statuses() {
    let app = TestApp::new().await;
    for (class, status, is_told) in [
        (Class::BadRequest, StatusCode::BAD_REQUEST, true),
        (Class::NotFound, StatusCode::NOT_FOUND, true),
        (Class::Busy, StatusCode::SERVICE_UNAVAILABLE, true),
        (Class::Unavailable, StatusCode::SERVICE_UNAVAILABLE, true),
        (Class::Internal, StatusCode::INTERNAL_SERVER_ERROR, false),
    ] {
        app.drawer.set(Mood::fails(class, "the planted text"));
        let answer = app.get(TILE).await;
        assert_eq!(answer.status, status, "{class:?}");
        assert_eq!(
            answer.text().contains("the planted text"),
            is_told,
            "{class:?}"
        );
        assert_eq!(
            answer.header("retry-after").is_empty(),
            status != StatusCode::SERVICE_UNAVAILABLE,
            "{class:?}"
        );
    }
    app.drawer.set(Mood::Well);
    assert_eq!(
        app.get(TILE).await.status,
        StatusCode::OK,
        "failures are not remembered"
    );
}

#[tokio::test]
async fn a_renderer_that_panics_or_answers_nonsense_is_an_internal_error_and_the_server_goes_on() {
    let app = TestApp::new().await;
    for mood in [Mood::Panics, Mood::AnswersNonsense] {
        app.drawer.set(mood);
        let answer = app.get(TILE).await;
        assert_eq!(answer.status, StatusCode::INTERNAL_SERVER_ERROR);
        assert!(answer.reason().contains("on our side"));
    }
    app.drawer.set(Mood::Well);
    assert_eq!(app.get(TILE).await.status, StatusCode::OK);
}

#[tokio::test]
async fn a_backend_that_knows_when_to_come_back_is_passed_on() {
    let app = TestApp::new().await;
    for (class, pause_ms, seconds) in [
        (Class::Busy, 2500, "3"),
        (Class::Unavailable, 40_000, "40"),
        (Class::Busy, 0, "1"),
        (Class::Busy, 1 << 40, "3600"),
    ] {
        let pause = Duration::from_millis(pause_ms);
        let error = BackendError::new(class, "the workers are full").after(pause);
        app.drawer.set(Mood::Fails(error));
        let answer = app.get(TILE).await;
        assert_eq!(answer.status, StatusCode::SERVICE_UNAVAILABLE);
        assert_eq!(answer.header("retry-after"), seconds);
        assert_eq!(answer.reason(), "the workers are full");
    }
}

#[tokio::test]
async fn a_panic_in_a_handler_is_caught_and_counted() {
    let app = TestApp::new().await;
    app.analyst.set(Mood::Panics);
    for path in ["/api/products/flux/point?lon=0&lat=0", "/api/check"] {
        let answer = app.get(path).await;
        assert_eq!(answer.status, StatusCode::INTERNAL_SERVER_ERROR, "{path}");
        assert!(!answer.text().contains("planted"), "{}", answer.text());
        assert!(!answer.header("x-content-type-options").is_empty());
    }
    assert_eq!(app.metric("fluxglobe_tile_server_panics_total").await, 2);
    app.analyst.set(Mood::Well);
    assert_eq!(
        app.get("/api/products/flux/point?lon=0&lat=0").await.status,
        StatusCode::OK
    );
}

#[tokio::test]
async fn large_bodies_are_refused() {
    let app = TestApp::new().await;
    let request = Request::builder()
        .uri(TILE)
        .header("content-length", "1000000000")
        .body(Body::empty())
        .unwrap();
    let answer = app.send(request).await;
    assert_eq!(answer.status, StatusCode::PAYLOAD_TOO_LARGE);
    assert_eq!(app.drawer.drawn_count(), 0);
}
