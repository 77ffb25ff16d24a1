//! `/tiles/{product}/{mode}.json`.

use axum::http::StatusCode;
use contract::quantity::Quantity;
use serde_json::json;

use crate::app::TestApp;

#[tokio::test]
async fn a_map_client_finds_all_it_needs() {
    let app = TestApp::new().await;
    let answer = app
        .get_with("/tiles/flux/volume.json", &[("host", "tiles.example:8080")])
        .await;
    assert_eq!(
        (answer.status, answer.header("content-type")),
        (StatusCode::OK, "application/json")
    );
    let body = answer.json();
    assert_eq!(body["tilejson"], "3.0.0");
    assert_eq!(
        body["tiles"],
        json!(["http://tiles.example:8080/tiles/flux/volume/{z}/{x}/{y}.png"])
    );
    assert_eq!(body["bounds"], json!([-180.0, -60.0, 180.0, 60.0]));
    assert_eq!((&body["minzoom"], &body["maxzoom"]), (&json!(0), &json!(4)));
    assert_eq!(body["attribution"], "A test &amp; nothing else");
    assert_eq!(body["times"][0], "2000-01-16T12:00:00Z");
    assert_eq!(body["times"].as_array().unwrap().len(), 3);
}

#[tokio::test]
async fn its_tiles_are_there() {
    let app = TestApp::new().await;
    let body = app.get("/tiles/flux/map.json?time=2000-02-01").await.json();
    let template = body["tiles"][0].as_str().unwrap();
    assert!(
        template.starts_with("/tiles/"),
        "without a host the address is relative: {template}"
    );
    let tile = template
        .replace("{z}", "0")
        .replace("{x}", "0")
        .replace("{y}", "0");
    assert_eq!(app.get(&tile).await.status, StatusCode::OK);
    let meant = app.time_sample("flux", "2000-02-01T00:00:00Z").await;
    assert_eq!(app.drawer.last_job().value, meant);
}

#[tokio::test]
async fn a_hostile_host_does_not_get_into_the_answer() {
    let app = TestApp::new().await;
    for host in [
        "evil.example/\"><script>",
        "user@evil.example",
        "evil.example?a=b",
    ] {
        let body = app
            .get_with("/tiles/flux/map.json", &[("host", host)])
            .await
            .text();
        assert!(!body.contains("evil"), "{body}");
    }
}

#[tokio::test]
async fn behind_a_proxy_that_speaks_tls_addresses_are_secure() {
    let app = TestApp::new().await;
    let headers = [("host", "tiles.example"), ("x-forwarded-proto", "https")];
    let body = app.get_with("/tiles/flux/map.json", &headers).await.json();
    assert!(
        body["tiles"][0]
            .as_str()
            .unwrap()
            .starts_with("https://tiles.example/")
    );
}

#[tokio::test]
async fn synthetic_data_say_so() {
    let app = TestApp::new().await;
    app.land("synthetic-sea", Quantity::CarbonFlux, 1).await;
    let body = app.get("/tiles/synthetic-sea/map.json").await.json();
    assert!(
        body["attribution"]
            .as_str()
            .unwrap()
            .starts_with("SYNTHETIC")
    );
}

#[tokio::test]
async fn the_legend_is_that_of_the_version_asked_for_and_a_title_is_no_markup() {
    let app = TestApp::new().await;
    let plain = Quantity::open("river_flux", "1", "\"River\" <flux>").unwrap();
    let cited = app
        .land("rivers", plain.over([0.0, 5.0]).unwrap(), 1)
        .await
        .to_string();
    app.land("rivers", plain.over([0.0, 90.0]).unwrap(), 2)
        .await;
    let title = "&quot;River&quot; &lt;flux&gt;";
    let named = app
        .get("/tiles/rivers/map.json?palette=ice&manifest=rivers@1")
        .await
        .json();
    let address = format!("/api/products/rivers/legend.svg?manifest={cited}");
    assert_eq!(
        named["legend"],
        format!("<img src=\"{address}&amp;palette=ice\" alt=\"{title}\">")
    );
    let legend = app.get(&address.replace("svg", "json")).await.json();
    assert_eq!(legend["high"], json!(5.0));
    let newest = app.get("/tiles/rivers/map.json").await.json();
    assert_eq!(
        newest["legend"],
        format!("<img src=\"/api/products/rivers/legend.svg\" alt=\"{title}\">")
    );
    let legend = app.get("/api/products/rivers/legend.json").await.json();
    assert_eq!(legend["high"], json!(90.0));
}

#[tokio::test]
async fn a_layer_without_its_ending_is_nothing() {
    let app = TestApp::new().await;
    assert_eq!(
        app.get("/tiles/flux/map").await.status,
        StatusCode::NOT_FOUND
    );
    assert_eq!(
        app.get("/tiles/flux/map.png").await.status,
        StatusCode::NOT_FOUND
    );
}
