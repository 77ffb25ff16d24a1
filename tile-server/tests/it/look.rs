//! How a picture is to look, in addresses of tiles, views, TileJSON and legends.

use axum::http::StatusCode;
use contract::colour::{Palette, TransferFunction};
use contract::job::Style;
use contract::quantity::Quantity;
use serde_json::json;

use crate::app::TestApp;

const LOOK: &str =
    "palette=ice&range=10:30&opacity=10:0.2,30:1&particle_size=10:0.5&reverse=true&uncertainty=1";

#[tokio::test]
async fn a_look_is_a_part_of_the_job_in_stored_units() {
    let app = TestApp::new().await;
    for path in ["/tiles/sst/map/0/0/0.png", "/globe/sst/map.png"] {
        let plain = app.get(path).await;
        let usual = app.drawer.last_job().style;
        let answer = app.get(&format!("{path}?{LOOK}")).await;
        assert_eq!(answer.status, StatusCode::OK, "{}", answer.text());
        let job = app.drawer.last_job();
        let transfer = &job.style.transfer;
        assert_eq!(transfer.palette, Palette::Ice);
        assert!((transfer.low - 283.15).abs() < 1e-9 && (transfer.high - 303.15).abs() < 1e-9);
        assert!((transfer.opacity(293.15).unwrap() - 0.6).abs() < 1e-9);
        assert!((transfer.size(293.15).unwrap() - 0.5).abs() < 1e-9);
        assert!(transfer.reversed && job.style.uncertainty);
        assert_eq!(answer.header("etag"), format!("\"{}\"", job.digest()));
        assert_ne!(answer.header("etag"), plain.header("etag"));
        let transfer = TransferFunction::default_for(Quantity::SeaSurfaceTemperature);
        let rest = Style {
            transfer,
            uncertainty: false,
            ..job.style
        };
        assert_eq!(rest, usual, "nothing else changed");
    }
}

#[tokio::test]
async fn one_look_written_in_two_ways_is_one_picture() {
    let app = TestApp::new().await;
    let tag = async |query: &str| {
        let answer = app
            .get(&format!("/tiles/flux/volume/0/0/0.png?{query}"))
            .await;
        assert_eq!(answer.status, StatusCode::OK, "{query}: {}", answer.text());
        answer.header("etag").to_owned()
    };
    let stops = tag("stops=-40:%2311387f,40:%23760e24").await;
    assert_eq!(stops, tag("stops=-4.0e1:11387F,%2040:760E24").await);
    assert_eq!(
        stops,
        tag("stops=-40:11387f,40:760e24&range=-40:40&uncertainty=0").await
    );
    let usual = tag("").await;
    assert_eq!(
        usual,
        tag("reverse=false&palette=balance&range=-40:40").await
    );
    assert_ne!(usual, stops);
    assert_eq!(app.drawer.drawn_count(), 2);
}

#[tokio::test]
async fn looks_of_their_own_are_not_drawn_before_they_are_asked_for() {
    let app = TestApp::new().await;
    let product = "flux".parse().unwrap();
    app.get("/tiles/flux/map/0/0/0.png?palette=gray").await;
    assert!(app.state.hot.of(&product, 9, |_time| true).is_empty());
    app.get("/tiles/flux/map/0/0/0.png").await;
    assert_eq!(app.state.hot.of(&product, 9, |_time| true).len(), 1);
}

#[tokio::test]
async fn tilejson_names_tiles_and_legend_of_the_look_asked_for() {
    let app = TestApp::new().await;
    let path =
        "/tiles/flux/map.json?stops=-40:%2311387f,40:%23760e24&uncertainty=1&time=2000-02-01";
    let body = app.get_with(path, &[("host", "h:1")]).await.json();
    let template = body["tiles"][0].as_str().unwrap();
    let end = "&stops=-40:11387f,40:760e24&uncertainty=true";
    assert!(template.ends_with(end), "{template}");
    let tile = template.replace("http://h:1", "").replace("{z}", "0");
    let tile = tile.replace("{x}", "0").replace("{y}", "0");
    assert_eq!(app.get(&tile).await.status, StatusCode::OK);
    assert!(app.drawer.last_job().style.uncertainty);
    assert_eq!(
        body["legend"],
        "<img src=\"http://h:1/api/products/flux/legend.svg?stops=-40:11387f,40:760e24&amp;uncertainty=true\" alt=\"Air-sea CO₂ flux\">"
    );
    let plain = app.get("/tiles/flux/map.json").await.json();
    assert!(
        !plain["tiles"][0].as_str().unwrap().contains('?'),
        "{plain}"
    );
    let refused = app.get("/tiles/flux/map.json?palette=jet").await;
    assert_eq!(refused.status, StatusCode::BAD_REQUEST);
}

#[tokio::test]
async fn a_legend_comes_in_three_forms() {
    let app = TestApp::new().await;
    let of = async |form: &str| {
        let answer = app
            .get(&format!("/api/products/sst/legend.{form}?{LOOK}"))
            .await;
        assert_eq!(answer.status, StatusCode::OK, "{}", answer.text());
        answer
    };
    let legend = of("json").await;
    assert_eq!(legend.header("content-type"), "application/json");
    let body = legend.json();
    assert_eq!((&body["low"], &body["high"]), (&json!(10.0), &json!(30.0)));
    assert_eq!(
        (&body["unit"], &body["label"]),
        (&json!("°C"), &json!("Sea-surface temperature"))
    );
    assert_eq!(body["ticks"], json!([10.0, 15.0, 20.0, 25.0, 30.0]));
    assert_eq!(body["stops"][0], json!([0.0, "#eafcfd"]), "reversed");
    assert_eq!(body["opacity"], json!([[0.0, 0.2], [1.0, 1.0]]));
    let svg = of("svg").await;
    assert_eq!(svg.header("content-type"), "image/svg+xml");
    assert!(svg.text().contains(">Sea-surface temperature</text>"));
    let png = of("png").await;
    assert_eq!(png.header("content-type"), "image/png");
    assert!(png.body.starts_with(b"\x89PNG\r\n\x1a\n"));
    let tag = [("if-none-match", png.header("etag"))];
    let again = app
        .get_with(&format!("/api/products/sst/legend.png?{LOOK}"), &tag)
        .await;
    assert_eq!(again.status, StatusCode::NOT_MODIFIED);
    // What is misspelt is the address, and not the parameters that go with it.
    let none = app.get("/api/products/sst/piont?lon=1&lat=2").await;
    assert_eq!(none.status, StatusCode::NOT_FOUND, "{}", none.text());
    let other = app.get_with("/api/products/sst/legend.png", &tag).await;
    assert_eq!(other.status, StatusCode::OK);
    assert_eq!(app.drawer.drawn_count(), 0);
}

#[tokio::test]
async fn the_list_of_products_has_the_usual_legends() {
    let app = TestApp::new().await;
    let listed = app.get("/api/products").await.json();
    let alone = app.get("/api/products/flux/legend.json").await.json();
    assert_eq!(listed["products"][0]["legend"], alone);
    for nothing in [
        "legend",
        "legend.",
        "legend.gif",
        "other.json",
        "legend.json.png",
    ] {
        let answer = app.get(&format!("/api/products/flux/{nothing}")).await;
        assert_eq!(answer.status, StatusCode::NOT_FOUND, "{nothing}");
    }
    assert_eq!(
        app.get("/api/products/atlantis/legend.png").await.status,
        StatusCode::NOT_FOUND
    );
}
