//! `/metrics`.

use crate::app::TestApp;

#[tokio::test]
async fn requests_are_counted_by_route_method_and_status_class() {
    let app = TestApp::new().await;
    for path in [
        "/tiles/flux/map/0/0/0.png",
        "/tiles/flux/map/1/0/0.png",
        "/tiles/flux/map/1/9/9.png",
        "/nothing",
    ] {
        app.get(path).await;
    }
    let route = "/tiles/{product}/{mode}/{z}/{x}/{y_png}";
    let requests = async |route: &str, status: &str| {
        let labels = format!(r#"method="GET",operation="{route}",outcome="{status}""#);
        app.metric(&format!("fluxglobe_tile_server_requests_total{{{labels}}}"))
            .await
    };
    assert_eq!(requests(route, "ok").await, 2);
    assert_eq!(requests(route, "refused").await, 1);
    assert_eq!(requests("viewer", "refused").await, 1);
    let timed = format!(r#"fluxglobe_tile_server_request_seconds_count{{operation="{route}"}}"#);
    assert_eq!(app.metric(&timed).await, 3);
    assert_eq!(
        app.metric(r#"fluxglobe_tile_server_drawn_total{mode="map",outcome="ok"}"#)
            .await,
        2
    );
    assert_eq!(
        app.metric(r#"fluxglobe_tile_server_draw_seconds_count{mode="map"}"#)
            .await,
        2
    );
    assert_eq!(app.metric("fluxglobe_tile_server_products_count").await, 3);
    let sent = format!(r#"fluxglobe_tile_server_sent_bytes_total{{route="{route}"}}"#);
    assert!(app.metric(&sent).await >= 2 * 72);
}

#[tokio::test]
async fn the_text_is_what_prometheus_reads() {
    let app = TestApp::new().await;
    app.get("/tiles/flux/map/0/0/0.png").await;
    let answer = app.get("/metrics").await;
    assert!(
        answer
            .header("content-type")
            .starts_with("text/plain; version=0.0.4")
    );
    let mut samples = 0;
    for line in answer.text().lines().filter(|line| !line.starts_with('#')) {
        let (name, value) = line.rsplit_once(' ').unwrap();
        assert!(name.starts_with("fluxglobe_tile_server_"), "{line}");
        value
            .parse::<f64>()
            .unwrap_or_else(|e| panic!("{line}: {e}"));
        samples += 1;
    }
    assert!(samples > 20);
    assert!(
        answer
            .text()
            .contains("# TYPE fluxglobe_tile_server_requests_total counter")
    );
}

#[tokio::test]
async fn addresses_and_methods_never_become_labels() {
    let app = TestApp::new().await;
    for path in [
        "/tiles/secret-name/map/0/0/0.png",
        "/secret-name",
        "/api/products/secret-name/budget",
    ] {
        app.get(path).await;
        let request = axum::http::Request::builder()
            .method("SECRET-NAME")
            .uri(path);
        app.send(request.body(axum::body::Body::empty()).unwrap())
            .await;
    }
    assert!(
        !app.get("/metrics")
            .await
            .text()
            .to_lowercase()
            .contains("secret-name")
    );
}
