//! Requests that are wrong, from careless to malicious: each gets its status and a reason, none an error of ours.

use axum::body::Body;
use axum::http::{Request, StatusCode};

use crate::app::TestApp;

/// Addresses and what the reason must say.
const BAD_ADDRESSES: &[(&str, &str)] = &[
    ("/tiles/flux/map/99/0/0.png", "zoom is 0 to 16"),
    ("/tiles/flux/map/256/0/0.png", "zoom is 0 to 16"),
    ("/tiles/flux/map/1/2/0.png", "0 to 1"),
    ("/tiles/flux/map/1/0/4294967295.png", "0 to 1"),
    ("/tiles/flux/map/1/0/4294967296.png", "whole numbers"),
    ("/tiles/flux/map/-1/0/0.png", "whole numbers"),
    ("/tiles/flux/map/1/0x1/0.png", "whole numbers"),
    ("/tiles/flux/map/1/1e0/0.png", "whole numbers"),
    ("/tiles/flux/map/1/0/0", "z/x/y.png"),
    ("/tiles/flux/map/1/0/0.jpg", "z/x/y.png"),
    ("/tiles/flux/map/1/%00/0.png", "whole numbers"),
    ("/tiles/flux/map/1/%ff/0.png", "not valid"),
    ("/tiles/flux/map/0/0/0.png?time=banana", "ISO 8601"),
    ("/tiles/flux/map/0/0/0.png?time=", "ISO 8601"),
    ("/tiles/flux/map/0/0/0.png?time=2000-13-01", "ISO 8601"),
    (
        "/tiles/flux/map/0/0/0.png?time=99999-01-01T00:00:00Z",
        "ISO 8601",
    ),
    ("/tiles/flux/map/0/0/0.png?time=%F0%9F%8C%8D", "ISO 8601"),
    ("/tiles/flux/map/0/0/0.png?time=2000&time=2001", "duplicate"),
    ("/tiles/flux/map/0/0/0.png?size=0", "256 or 512"),
    ("/tiles/flux/map/0/0/0.png?size=1000000000", "256 or 512"),
    ("/tiles/flux/map/0/0/0.png?size=-256", "256 or 512"),
    ("/tiles/flux/map.json?time=banana", "ISO 8601"),
    ("/tiles/flux/map/0/0/0.png?palette=jet", "balance, curl"),
    ("/tiles/flux/map/0/0/0.png?palette=", "balance, curl"),
    ("/tiles/flux/map/0/0/0.png?range=5", "LOW:HIGH"),
    ("/tiles/flux/map/0/0/0.png?range=5:5", "LOW:HIGH"),
    ("/tiles/flux/map/0/0/0.png?range=nan:inf", "LOW:HIGH"),
    (
        "/tiles/flux/map/0/0/0.png?range=-1e300:1e300",
        "must be finite",
    ),
    ("/tiles/flux/map/0/0/0.png?range=0:1e-99", "too close"),
    ("/tiles/flux/map/0/0/0.png?stops=", "#rrggbb"),
    ("/tiles/flux/map/0/0/0.png?stops=0:red,1:blue", "#rrggbb"),
    ("/tiles/flux/map/0/0/0.png?stops=0:ffffff", "at least 2"),
    (
        "/tiles/flux/map/0/0/0.png?stops=0:ffffff,1:000000&palette=ice",
        "one of the two",
    ),
    (
        "/tiles/flux/map/0/0/0.png?stops=0:ffffff,1:000000&reverse=1",
        "other way round",
    ),
    ("/tiles/flux/map/0/0/0.png?opacity=0:2", "from 0 to 1"),
    ("/tiles/flux/map/0/0/0.png?opacity=1:1,0:1", "rise"),
    (
        "/tiles/flux/map/0/0/0.png?particle_size=0:nan",
        "from 0 to 1",
    ),
    (
        "/tiles/flux/map/0/0/0.png?opacity=0:1,1:1,2:1,3:1,4:1,5:1,6:1,7:1,8:1,9:1,10:1,11:1,12:1,13:1,14:1,15:1,16:1",
        "at most 16",
    ),
    ("/tiles/flux/map/0/0/0.png?reverse=maybe", "true or false"),
    ("/tiles/flux/map/0/0/0.png?uncertainty=2", "true or false"),
    ("/tiles/flux/map/0/0/0.png?doubt=1", "uncertainty=true"),
    (
        "/tiles/flux/map/0/0/0.png?uncertainty=1&uncertainty=1",
        "duplicate",
    ),
    ("/globe/flux/map.png?palette=jet", "balance, curl"),
    ("/api/products/flux/legend.png?palette=jet", "balance, curl"),
    ("/globe/flux/map.png?lon=nan", "degrees east"),
    ("/globe/flux/map.png?lat=91", "-90 to 90"),
    ("/globe/flux/map.png?lon=1e300", "longitude"),
    ("/globe/flux/map.png?width=1000000000", "1 to 7680"),
    ("/globe/flux/map.png?width=1e9", "1 to 7680"),
    (
        "/globe/flux/map.png?width=99999",
        "width \"99999\" is not valid",
    ),
    ("/globe/flux/map.png?height=0", "1 to 7680"),
    (
        "/globe/flux/map.png?height_km=-0.5",
        "1 km to 1 million km above the ground, or 1 km to 1000 km below the sea surface",
    ),
    ("/globe/flux/map.png?height_km=-1001", "-1 to -1000"),
    ("/globe/flux/map.png?height_km=deep", "-1 to -1000"),
    (
        "/globe/flux/map.png?look_at=0,0&distance_km=600&tilt=92",
        "0 to 90 from above; from below the sea surface, 600 km away, 92.8 to",
    ),
    (
        "/globe/flux/map.png?look_at=0,0&distance_km=9000&tilt=120",
        "no camera below the sea surface",
    ),
    ("/globe/flux/map.png?height_km=inf", "kilometres"),
    ("/globe/flux/map.png?surface=maybe", "true or false"),
    ("/api/products/flux/point?lon=nan&lat=0", "degrees east"),
    ("/api/products/flux/point?lon=0", "\"lat\" is missing"),
    (
        "/api/products/flux/point?lon=0&lat=0&depth=3",
        "unknown field",
    ),
    ("/api/products/flux/point?lon=0&lat=-90.1", "-90 to 90"),
    ("/api/products/flux/budget?region=atlantis", "14n-50n"),
    ("/api/products/flux/budget?region=", "west,south,east,north"),
    (
        "/api/products/flux/budget?region=1,2,3",
        "west,south,east,north",
    ),
    (
        "/api/products/flux/budget?region=0,10,10,0",
        "rise from south to north",
    ),
    ("/api/products/flux/budget?region=nan,0,1,1", "degrees"),
    ("/api/products/flux/budget?from=never", "ISO 8601"),
    (
        "/api/products/flux/budget?step=decade",
        "month, season, year or total",
    ),
    ("/api/products/flux/budget?earth=flat", "local-radius"),
    ("/api/products/flux/budget?form=2000", "unknown field"),
    // What is misspelt is not answered as if it were not there.
    (
        "/tiles/flux/map/0/0/0.png?size=256&tme=2000-01",
        "unknown parameter `tme`",
    ),
    (
        "/tiles/flux/map/0/0/0.png?range=0:1&sunn=time",
        "unknown parameter `sunn`",
    ),
    ("/tiles/flux/map.json?pallete=ice", "unknown parameter"),
    ("/globe/flux/map.png?titl=60", "unknown parameter `titl`"),
    (
        "/api/products/flux/legend.svg?sun=time",
        "unknown parameter `sun`",
    ),
    ("/api/products?product=flux", "unknown parameter"),
    ("/api/regions?bbox=0,0,1,1", "unknown parameter"),
    ("/api/palettes?name=ice", "unknown parameter"),
    ("/api/check?from=2000", "unknown parameter"),
];

#[tokio::test]
async fn bad_addresses_are_refused_with_the_reason() {
    let app = TestApp::new().await;
    let long = "a".repeat(5000);
    for (path, reason) in BAD_ADDRESSES {
        let answer = app.get(path).await;
        assert_eq!(
            answer.status,
            StatusCode::BAD_REQUEST,
            "{path}: {}",
            answer.text()
        );
        assert!(
            answer.reason().contains(reason),
            "{path}: {}",
            answer.reason()
        );
        assert_eq!(answer.header("cache-control"), "no-store", "{path}");
    }
    for path in [
        format!("/tiles/flux/map/0/0/0.png?time={long}"),
        format!("/tiles/flux/map/1/0/{long}.png"),
    ] {
        let answer = app.get(&path).await;
        assert_eq!(answer.status, StatusCode::BAD_REQUEST);
        assert!(
            answer.body.len() < 600,
            "a long request does not make a long answer: {}",
            answer.body.len()
        );
    }
    assert_eq!(app.drawer.drawn_count(), 0);
    assert_eq!(app.metric("fluxglobe_tile_server_panics_total").await, 0);
}

#[tokio::test]
async fn layers_and_addresses_that_do_not_exist_are_not_found() {
    let app = TestApp::new().await;
    let long = format!("/tiles/{}/map/0/0/0.png", "a".repeat(5000));
    for (path, reason) in [
        ("/tiles/atlantis/map/0/0/0.png", "no product \"atlantis\""),
        ("/tiles/Flux/map/0/0/0.png", "no product \"Flux\""),
        ("/tiles/%2e%2e/map/0/0/0.png", "no product \"..\""),
        ("/tiles/..%2f..%2fetc/map/0/0/0.png", "no product"),
        (
            "/tiles/flux/hologram/0/0/0.png",
            "map, points, sprites, volume",
        ),
        ("/tiles/flux-accumulated/volume/0/0/0.png", "it has map"),
        ("/tiles/flux/hologram.json", "map, points, sprites, volume"),
        ("/globe/flux/hologram.png", "map, points, sprites, volume"),
        ("/globe/flux/map", "nothing at this address"),
        ("/api/products/atlantis/point?lon=0&lat=0", "no product"),
        ("/api/products/atlantis/budget", "no product"),
        ("/api", "nothing at this address"),
        ("/api/products/flux", "nothing at this address"),
        ("/tiles/flux/map/0/0", "nothing at this address"),
        ("/no/such/page", "at this address; /api/openapi.json"),
        ("/..%2f..%2fetc/passwd", "nothing at this address"),
        (&long, "no product"),
    ] {
        let answer = app.get(path).await;
        assert_eq!(
            answer.status,
            StatusCode::NOT_FOUND,
            "{path}: {}",
            answer.text()
        );
        assert!(
            answer.reason().contains(reason),
            "{path}: {}",
            answer.reason()
        );
        assert!(answer.body.len() < 400);
    }
}

#[tokio::test]
async fn nothing_can_be_written() {
    let app = TestApp::new().await;
    for path in [
        "/tiles/flux/map/0/0/0.png",
        "/api/products",
        "/",
        "/no/such/page",
    ] {
        for method in ["POST", "PUT", "DELETE", "PATCH", "TRACE"] {
            let request = Request::builder()
                .method(method)
                .uri(path)
                .body(Body::empty())
                .unwrap();
            let answer = app.send(request).await;
            assert_eq!(
                answer.status,
                StatusCode::METHOD_NOT_ALLOWED,
                "{method} {path}"
            );
            assert!(
                answer.header("allow").contains("GET"),
                "{method} {path}: {}",
                answer.header("allow")
            );
            assert!(!answer.reason().is_empty());
        }
    }
    assert_eq!(app.drawer.drawn_count(), 0);
}

#[tokio::test]
async fn who_takes_an_answer_in_no_form_is_told_so_and_is_sent_nothing_else() {
    let app = TestApp::new().await;
    for path in [
        "/api/products",
        "/api/products/nothing/point?lon=0&lat=0",
        "/tiles/flux/map/0/0/0.png",
        "/zarr/flux@1/zarr.json",
        "/healthz",
    ] {
        for coding in ["identity;q=0", "*;q=0", "br, identity;q=0"] {
            let answer = app.get_with(path, &[("accept-encoding", coding)]).await;
            assert_eq!(answer.status, StatusCode::NOT_ACCEPTABLE, "{path} {coding}");
            assert!(answer.reason().contains("Accept-Encoding"), "{path}");
            assert_eq!(
                (answer.header("cache-control"), answer.header("vary")),
                ("no-store", "accept-encoding"),
                "{path}"
            );
            assert_eq!(answer.header("etag"), "", "{path}");
            assert_eq!(answer.header("access-control-allow-origin"), "*", "{path}");
        }
        let answer = app.get_with(path, &[("accept-encoding", "br")]).await;
        assert_ne!(answer.status, StatusCode::NOT_ACCEPTABLE, "{path}");
    }
}

#[tokio::test]
async fn head_is_get_without_a_body() {
    let app = TestApp::new().await;
    let request = Request::builder()
        .method("HEAD")
        .uri("/tiles/flux/map/0/0/0.png")
        .body(Body::empty())
        .unwrap();
    let answer = app.send(request).await;
    assert_eq!(
        (answer.status, answer.header("content-type")),
        (StatusCode::OK, "image/png")
    );
    assert!(answer.body.is_empty());
    let whole = app.get("/tiles/flux/map/0/0/0.png").await;
    assert_eq!(
        answer.header("content-length"),
        whole.body.len().to_string()
    );
    assert_eq!(
        whole.header("content-length"),
        answer.header("content-length")
    );
}
