//! `/api/palettes`, and the numbers of looks that the viewer takes for granted.

use axum::http::StatusCode;
use contract::colour::{Palette, TransferFunction};
use contract::context::RELIEF_EXAGGERATION;
use contract::job::Style;
use contract::quantity::Quantity;

use crate::app::TestApp;

const VIEWER: &str = include_str!("../../web/src/look/look.ts");

#[tokio::test]
async fn every_palette_that_is_listed_can_be_asked_for_and_looks_as_listed() {
    let app = TestApp::new().await;
    let body = app.get("/api/palettes").await.json();
    let palettes = body["palettes"].as_array().unwrap();
    assert_eq!(palettes.len(), Palette::ALL.len());
    for palette in palettes {
        let name = palette["name"].as_str().unwrap();
        let answer = app
            .get(&format!("/api/products/sst/legend.json?palette={name}"))
            .await;
        assert_eq!(answer.status, StatusCode::OK, "{name}");
        assert_eq!(answer.json()["stops"], palette["stops"], "{name}");
    }
}

/// A viewer tells a product's own palette by the colours of its legend.
#[tokio::test]
async fn the_usual_legend_of_every_quantity_has_the_colours_of_one_palette() {
    let app = TestApp::empty(|_settings| {});
    for (i, quantity) in Quantity::ALL.into_iter().enumerate() {
        app.land(&format!("p{i}"), quantity, 1).await;
    }
    let listed = app.get("/api/palettes").await.json();
    let palettes = listed["palettes"].as_array().unwrap();
    let products = app.get("/api/products").await.json();
    let products = products["products"].as_array().unwrap();
    assert_eq!(products.len(), Quantity::ALL.len());
    for product in products {
        let stops = &product["legend"]["stops"];
        let same = palettes.iter().filter(|one| &one["stops"] == stops);
        assert_eq!(same.count(), 1, "{}", product["quantity"]);
    }
}

/// The number after `name` and what is between them in the viewer's source.
fn viewers(name: &str, between: &str) -> f64 {
    let (_, values) = VIEWER.split_once("export const USUAL").expect(name);
    let start = format!("{name}{between}");
    let (_, rest) = values.split_once(&start).expect(name);
    let end = rest.find([',', ';']).unwrap();
    rest[..end].replace('_', "").parse().expect(name)
}

#[test]
fn the_viewer_knows_what_is_usual() {
    let transfer = TransferFunction::default_for(Quantity::CarbonFlux);
    let usual = Style::with_transfer(transfer);
    let same = |a: f64, b: f64| assert!((a - b).abs() < 1e-9 * b.abs().max(1.0), "{a} {b}");
    same(viewers("reliefExaggeration", ": "), RELIEF_EXAGGERATION);
    same(viewers("heightMPerKgM2", ": "), usual.height_m_per_kg_m2);
    same(viewers("seaOpacity", ": "), usual.context.sea_opacity);
}

#[tokio::test]
async fn the_viewer_knows_the_limits() {
    let app = TestApp::new().await;
    app.land("etopo", Quantity::Elevation, 1).await;
    for (name, parameter) in [
        (
            "MOST_RELIEF_EXAGGERATION",
            "relief=etopo&relief_exaggeration",
        ),
        ("MOST_SEA_OPACITY", "sea_opacity"),
        ("MOST_HEIGHT_M_PER_KG_M2", "height_exaggeration"),
    ] {
        let most = viewers(name, " = ");
        for (number, status) in [
            (most, StatusCode::OK),
            (most * 1.005, StatusCode::BAD_REQUEST),
        ] {
            let path = format!("/tiles/flux/volume/0/0/0.png?{parameter}={number}");
            assert_eq!(app.get(&path).await.status, status, "{path}");
        }
    }
}
