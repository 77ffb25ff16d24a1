//! Questions whose geometry is sent along: the answers of GET, within limits, and nothing else takes a body.

use std::convert::Infallible;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use axum::body::{Body, Bytes};
use axum::http::{Request, StatusCode};
use futures::stream;
use tower::ServiceExt as _;

use crate::app::{Answer, TestApp};

pub(crate) const SQUARE: &str =
    r#"{"type":"Polygon","coordinates":[[[0.5,0],[40,0],[20,33],[0.5,0]]]}"#;
pub(crate) const TRACK: &str = r#"{"type":"LineString","coordinates":[[-40,10],[-10,40]]}"#;
/// The longest body.
const LONGEST: u64 = 64 << 20;
/// Longer than anything here takes, also on a busy machine.
const LIMIT: Duration = Duration::from_secs(30);
/// What they take while they are asked about.
const HELD: &str = "fluxglobe_tile_server_body_bytes";

/// Addresses that take a geometry, the parameter that it stands in, and one that it may be.
const TAKES: [(&str, &str, &str); 13] = [
    ("sst/area?to=2000-03&format=json", "region", SQUARE),
    ("sst/area?statistic=mean&step=total", "region", SQUARE),
    ("sst/area?to=2000-03&format=csv", "region", SQUARE),
    ("sst/line?statistic=max", "line", TRACK),
    ("sst/analysis?parts=anomaly", "region", SQUARE),
    ("sst/analysis?parts=anomaly&min_coverage=5", "line", TRACK),
    ("sst/correlation?with=flux&max_lag=2", "region", SQUARE),
    ("sst/correlation?with=flux&max_lag=2", "line", TRACK),
    ("sst/difference?minus=flux", "region", SQUARE),
    ("sst/difference?minus=flux", "line", TRACK),
    ("sst/hovmoller?along=lat", "region", SQUARE),
    ("flux/budget?step=month", "region", SQUARE),
    ("flux/budget/history?step=month", "region", SQUARE),
];

fn escaped(text: &str) -> String {
    text.bytes()
        .fold(String::new(), |sofar, byte| sofar + &format!("%{byte:02X}"))
}

pub(crate) fn post(path: &str, body: impl Into<Body>) -> Request<Body> {
    let request = Request::post(format!("/api/products/{path}"));
    let request = request.header("content-type", "application/geo+json");
    request.body(body.into()).unwrap()
}

async fn posted(app: &TestApp, path: &str, body: impl Into<Body>) -> Answer {
    app.send(post(path, body)).await
}

/// Questions that reached the analyst.
fn asked(app: &TestApp) -> usize {
    let analyst = &app.analyst;
    let areas = analyst.areas.lock().unwrap().len() + analyst.statistics.lock().unwrap().len();
    areas + analyst.made.lock().unwrap().len() + analyst.budgets.lock().unwrap().len()
}

/// A circle of so many corners, the last one the first again, in degrees of so many digits.
fn circle(corners: u32) -> String {
    let corner = |at: u32| {
        let turn = f64::from(at % (corners - 1)) / f64::from(corners - 1) * std::f64::consts::TAU;
        format!("[{:.15},{:.15}]", 30.0 * turn.cos(), 30.0 * turn.sin())
    };
    let corners: Vec<String> = (0..corners).map(corner).collect();
    format!(
        r#"{{"type":"Polygon","coordinates":[[{}]]}}"#,
        corners.join(",")
    )
}

#[tokio::test]
async fn a_geometry_that_is_sent_along_is_the_question_of_the_same_in_an_address() {
    let app = TestApp::new().await;
    for (path, name, geometry) in TAKES {
        let feature = format!(r#"{{"type":"Feature","properties":null,"geometry":{geometry}}}"#);
        for own in [geometry, &feature] {
            let before = asked(&app);
            let got = app
                .get(&format!("/api/products/{path}&{name}={}", escaped(own)))
                .await;
            assert_eq!(got.status, StatusCode::OK, "{path}: {}", got.text());
            assert_eq!(asked(&app), before + 1, "{path} {name}");
            let sent = posted(&app, path, own.to_owned()).await;
            assert_eq!(sent.status, StatusCode::OK, "{path}: {}", sent.text());
            assert_eq!(sent.body, got.body, "{path} {name}");
            for header in ["etag", "content-type", "cache-control", "vary"] {
                assert_eq!(sent.header(header), got.header(header), "{path} {header}");
            }
            assert!(sent.header("etag").starts_with("W/"), "{path}");
            assert_eq!(asked(&app), before + 1, "{path} {name} is not remembered");
            // Who has the answer is not sent it again.
            let mut again = post(path, own.to_owned());
            let tag = sent.headers["etag"].clone();
            again.headers_mut().insert("if-none-match", tag);
            let again = app.send(again).await;
            assert_eq!(again.status, StatusCode::PRECONDITION_FAILED, "{path}");
            assert_eq!(again.header("etag"), sent.header("etag"));
            assert_eq!(app.metric(HELD).await, 0, "{path}");
        }
    }
    // A collection is the parts of a budget, and a region where there are none.
    let named = format!(r#"{{"type":"Feature","properties":{{"name":"a"}},"geometry":{SQUARE}}}"#);
    let parts = format!(r#"{{"type":"FeatureCollection","features":[{named}]}}"#);
    for (path, name) in [
        ("flux/budget?region=14n-50n&step=month", "regions"),
        ("sst/area?to=2000-02", "region"),
    ] {
        let address = format!("/api/products/{path}&{name}={}", escaped(&parts));
        let got = app.get(&address).await;
        assert_eq!(got.status, StatusCode::OK, "{path}: {}", got.text());
        let before = asked(&app);
        let sent = posted(&app, path, parts.clone()).await;
        assert_eq!(
            (sent.status, asked(&app)),
            (StatusCode::OK, before),
            "{path}"
        );
        assert_eq!(sent.body, got.body, "{path}");
    }
    let query = app.analyst.budgets.lock().unwrap().last().unwrap().clone();
    assert!(query.parts.is_some() && query.region_name == "14n-50n");
}

#[tokio::test]
async fn a_million_vertices_are_asked_about_and_one_more_is_refused() {
    let app = TestApp::new().await;
    let million = circle(1_000_000);
    assert!((million.len() as u64) < LONGEST);
    let answer = posted(&app, "sst/area?to=2000-02", million.clone()).await;
    assert_eq!(answer.status, StatusCode::OK, "{}", answer.text());
    // No answer has room for its text.
    let name = answer.json()["region"].as_str().unwrap().to_owned();
    assert!(
        name.starts_with("text of ") && name.contains("sha256"),
        "{name}"
    );
    let line = million
        .replace("Polygon", "LineString")
        .replace("[[[", "[[")
        .replace("]]]", "]]");
    for path in ["sst/line?step=total", "sst/analysis?parts=trend"] {
        let answer = posted(&app, path, line.clone()).await;
        assert_eq!(answer.status, StatusCode::OK, "{path}: {}", answer.text());
    }
    let more = posted(&app, "sst/area?to=2000-02", circle(1_000_001)).await;
    assert_eq!(more.status, StatusCode::BAD_REQUEST);
    assert!(
        more.reason().contains("more than 1000000 corners"),
        "{}",
        more.reason()
    );
    assert_eq!(app.metric(HELD).await, 0);
}

#[tokio::test]
#[expect(clippy::too_many_lines, reason = "a list of bodies and of reasons")]
async fn what_is_no_geometry_is_refused_and_says_why() {
    let app = TestApp::new().await;
    let tree = format!(r#"{{"type":"Point","x":[{}0]}}"#, "[1],".repeat(100_000));
    let nested = format!(
        r#"{{"type":"Polygon","coordinates":{}"#,
        "[".repeat(100_000)
    );
    for (path, body, reason) in [
        ("sst/area", "", "send a geometry"),
        ("sst/area", "global", "send a geometry"),
        ("sst/area", SQUARE.trim_end_matches('}'), "no GeoJSON"),
        ("sst/area", "{}", "no GeoJSON"),
        ("sst/area", &nested, "no GeoJSON"),
        ("sst/area", &tree, "besides coordinates"),
        ("sst/area", TRACK, "has no area"),
        ("sst/line", SQUARE, "no line"),
        (
            "sst/analysis?parts=trend",
            r#"{"type":"Point","coordinates":[0,0]}"#,
            "has no area",
        ),
        ("sst/analysis", SQUARE, "give one of climatology"),
        (
            "flux/budget",
            r#"{"type":"FeatureCollection","features":[]}"#,
            "0 features",
        ),
        ("sst/area?region=global", SQUARE, "leave region out"),
        ("sst/line?line=0,0;1,1", TRACK, "leave line out"),
        (
            "sst/analysis?parts=trend&lon=1&lat=1",
            SQUARE,
            "leave lon out",
        ),
        (
            "sst/analysis?parts=trend&line=0,0;1,1",
            SQUARE,
            "leave line out",
        ),
        (
            "sst/correlation?with=flux&region=global",
            TRACK,
            "leave region out",
        ),
        ("sst/difference?minus=flux&lat=1", TRACK, "leave lat out"),
        (
            "sst/hovmoller?along=lat&region=global",
            SQUARE,
            "leave region out",
        ),
        ("sst/hovmoller?along=lat", TRACK, "has no area"),
        ("flux/budget?region=global", SQUARE, "leave region out"),
        (
            "flux/budget/history?region=mask:5",
            SQUARE,
            "leave region out",
        ),
        (
            "flux/budget/history?as_of=2026-03-01",
            SQUARE,
            "of all versions",
        ),
        ("sst/analysis?region=mask:5", SQUARE, "leave region out"),
        (
            "flux/budget?regions=mask",
            r#"{"type":"FeatureCollection"}"#,
            "leave regions out",
        ),
        ("sst/area?form=json", SQUARE, "unknown field"),
    ] {
        let answer = posted(&app, path, body.to_owned()).await;
        assert_eq!(
            answer.status,
            StatusCode::BAD_REQUEST,
            "{path} {}",
            answer.text()
        );
        assert!(
            answer.reason().contains(reason),
            "{path}: {}",
            answer.reason()
        );
        assert!(answer.body.len() < 600, "{path}");
    }
    let unknown = posted(&app, "none/area", SQUARE).await;
    assert_eq!(unknown.status, StatusCode::NOT_FOUND);
    for media_type in [
        None,
        Some("text/plain"),
        Some("application/x-www-form-urlencoded"),
    ] {
        let mut request = post("sst/area", SQUARE);
        request.headers_mut().remove("content-type");
        if let Some(own) = media_type {
            request
                .headers_mut()
                .insert("content-type", own.parse().unwrap());
        }
        let answer = app.send(request).await;
        assert_eq!(
            answer.status,
            StatusCode::UNSUPPORTED_MEDIA_TYPE,
            "{media_type:?}"
        );
        assert!(answer.reason().contains("application/geo+json"));
    }
    assert_eq!((asked(&app), app.metric(HELD).await), (0, 0));
}

#[tokio::test]
async fn bodies_are_read_as_far_as_the_limit_and_those_of_other_addresses_not_at_all() {
    let app = TestApp::new().await;
    let mut announced = post("sst/area", Body::empty());
    let length = (LONGEST + 1).to_string();
    announced
        .headers_mut()
        .insert("content-length", length.parse().unwrap());
    let answer = app.send(announced).await;
    assert_eq!(answer.status, StatusCode::PAYLOAD_TOO_LARGE);
    assert!(answer.reason().contains("67108864"), "{}", answer.reason());
    // Of unknown length, and without an end: it is read to the limit and one piece beyond it.
    let (piece, taken) = (
        Bytes::from(vec![b' '; 1 << 20]),
        Arc::new(AtomicU64::new(0)),
    );
    let counted = Arc::clone(&taken);
    let pieces = stream::repeat_with(move || {
        counted.fetch_add(piece.len() as u64, Ordering::SeqCst);
        Ok::<_, Infallible>(piece.clone())
    });
    let answer = posted(&app, "sst/area", Body::from_stream(pieces)).await;
    assert_eq!(answer.status, StatusCode::PAYLOAD_TOO_LARGE);
    assert_eq!(taken.load(Ordering::SeqCst), LONGEST + (1 << 20));
    // What is asked by GET carries as little as before, and nothing else takes a body.
    let get = Request::get("/api/products/sst/area?region=global").header("content-length", "4097");
    let answer = app.send(get.body(Body::empty()).unwrap()).await;
    assert_eq!(answer.status, StatusCode::PAYLOAD_TOO_LARGE);
    let answer = posted(&app, "sst/point?lon=0&lat=0", SQUARE).await;
    assert_eq!(answer.status, StatusCode::METHOD_NOT_ALLOWED);
    assert_eq!(answer.header("allow"), "GET, HEAD");
    for method in ["PUT", "PATCH", "DELETE"] {
        let request = Request::builder()
            .method(method)
            .uri("/api/products/sst/area");
        let answer = app.send(request.body(Body::from(SQUARE)).unwrap()).await;
        assert_eq!(answer.status, StatusCode::METHOD_NOT_ALLOWED, "{method}");
        assert_eq!(answer.header("allow"), "GET, HEAD, POST", "{method}");
    }
    assert_eq!((asked(&app), app.metric(HELD).await), (0, 0));
}

#[tokio::test]
async fn pages_of_other_origins_may_send_geometries_and_nothing_else() {
    let app = TestApp::new().await;
    for (path, may_post) in [("sst/area", true), ("sst/point", false)] {
        let request = Request::builder()
            .method("OPTIONS")
            .uri(format!("/api/products/{path}"))
            .header("origin", "http://map.example")
            .header("access-control-request-method", "POST")
            .header("access-control-request-headers", "content-type");
        let answer = app.send(request.body(Body::empty()).unwrap()).await;
        assert_eq!(answer.header("access-control-allow-origin"), "*");
        let methods = answer.header("access-control-allow-methods");
        assert_eq!(methods.contains("POST"), may_post, "{path}: {methods}");
        let headers = answer.header("access-control-allow-headers");
        assert_eq!(
            headers.contains("content-type"),
            may_post,
            "{path}: {headers}"
        );
    }
    let mut request = post("sst/area", SQUARE);
    let origin = "http://map.example".parse().unwrap();
    request.headers_mut().insert("origin", origin);
    let answer = app.send(request).await;
    assert_eq!(answer.status, StatusCode::OK);
    assert_eq!(answer.header("access-control-allow-origin"), "*");
}

/// Waits until bodies take as much as is wanted.
async fn until(app: &TestApp, is_so: impl Fn(u64) -> bool) {
    let begun = Instant::now();
    while !is_so(app.metric(HELD).await) {
        assert!(begun.elapsed() < LIMIT, "{}", app.metric(HELD).await);
        tokio::task::yield_now().await;
    }
}

/// The longest body of a client, of which nothing comes.
fn silent(client: u8) -> Request<Body> {
    let body = Body::from_stream(stream::pending::<Result<Bytes, Infallible>>());
    let mut request = post("sst/area", body);
    let headers = request.headers_mut();
    headers.insert("content-length", LONGEST.to_string().parse().unwrap());
    headers.insert(
        "x-forwarded-for",
        format!("192.0.2.{client}").parse().unwrap(),
    );
    request
}

#[tokio::test]
async fn so_many_bytes_are_taken_at_once_and_half_of_them_of_one_client() {
    let header = "x-forwarded-for".parse().ok();
    let app = TestApp::with(|settings| settings.client_header = header).await;
    let mut under_way = vec![];
    for (client, held) in [(1, 1), (1, 2), (2, 3), (3, 4)] {
        let sending = app.router.clone().oneshot(silent(client));
        under_way.push(tokio::spawn(sending));
        until(&app, |bytes| bytes == held * LONGEST).await;
        if held == 2 {
            let answer = app.send(silent(1)).await;
            assert_eq!(answer.status, StatusCode::SERVICE_UNAVAILABLE);
            assert!(!answer.header("retry-after").is_empty());
        }
    }
    let mut small = post("sst/area", SQUARE);
    let other = "192.0.2.9".parse().unwrap();
    small.headers_mut().insert("x-forwarded-for", other);
    small
        .headers_mut()
        .insert("content-length", SQUARE.len().into());
    let answer = app.send(small).await;
    assert_eq!(
        answer.status,
        StatusCode::SERVICE_UNAVAILABLE,
        "{}",
        answer.text()
    );
    assert_eq!(app.metric(HELD).await, 4 * LONGEST);
    // Who goes away leaves his room to others.
    under_way.remove(0).abort();
    until(&app, |bytes| bytes == 3 * LONGEST).await;
    assert_eq!(
        posted(&app, "sst/area", SQUARE).await.status,
        StatusCode::OK
    );
    under_way.iter().for_each(tokio::task::JoinHandle::abort);
    until(&app, |bytes| bytes == 0).await;
}
