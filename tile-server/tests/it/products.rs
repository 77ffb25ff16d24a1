//! `/api/products`.

use contract::quantity::Quantity;
use serde_json::json;

use crate::app::TestApp;

#[tokio::test]
async fn a_product_tells_what_a_viewer_needs() {
    let app = TestApp::new().await;
    let body = app.get("/api/products").await.json();
    let flux = &body["products"][0];
    assert_eq!(flux["product"], "flux");
    assert_eq!(flux["title"], "Test flux");
    assert_eq!(flux["quantity"], "carbon_flux");
    assert_eq!(
        (&flux["stored_unit"], &flux["unit"]),
        (&json!("kg m-2 s-1"), &json!("g C m⁻² yr⁻¹"))
    );
    assert!((flux["display_factor"].as_f64().unwrap() - 1000.0 * 365.25 * 86_400.0).abs() < 1.0);
    assert_eq!(flux["synthetic"], false);
    assert_eq!(flux["bounds_deg"], json!([-180.0, -60.0, 180.0, 60.0]));
    assert_eq!(flux["modes"], json!(["map", "points", "sprites", "volume"]));
    let january = json!({"start": "2000-01-01T00:00:00Z", "end": "2000-02-01T00:00:00Z", "mid": "2000-01-16T12:00:00Z"});
    assert_eq!(flux["steps"][0], january);
    assert!(flux["manifest"].as_str().unwrap().starts_with("flux@1-"));
    let legend = &flux["legend"];
    assert_eq!(
        (&legend["low"], &legend["high"]),
        (&json!(-40.0), &json!(40.0))
    );
    assert_eq!(legend["stops"][0], json!([0.0, "#11387f"]));
    assert_eq!(legend["stops"][8][0], json!(1.0));
}

#[tokio::test]
async fn fluxes_come_first_and_accumulated_carbon_last_with_maps_only() {
    let app = TestApp::new().await;
    let body = app.get("/api/products").await.json();
    let products = body["products"].as_array().unwrap();
    let ids: Vec<_> = products
        .iter()
        .map(|product| product["product"].as_str().unwrap())
        .collect();
    assert_eq!(ids, ["flux", "sst", "flux-accumulated"]);
    assert_eq!(products[2]["modes"], json!(["map"]));
    assert_eq!(products[2]["derived_from"], products[0]["manifest"]);
    assert_eq!(products[1]["display_offset"], json!(-273.15));
}

#[tokio::test]
async fn an_empty_store_is_an_empty_list() {
    let app = TestApp::empty(|_settings| {});
    assert_eq!(
        app.get("/api/products").await.json(),
        json!({"products": []})
    );
}

#[tokio::test]
async fn a_damaged_manifest_does_not_hide_the_other_products() {
    let app = TestApp::new().await;
    let key = contract::key::ObjectKey::manifest(&"broken".parse().unwrap(), 1);
    app.store.put_new(&key, "{".into()).await.unwrap();
    let newer = contract::key::ObjectKey::manifest(&"sst".parse().unwrap(), 2);
    app.store.put_new(&newer, "{".into()).await.unwrap();
    let body = app.get("/api/products").await.json();
    let ids: Vec<_> = body["products"]
        .as_array()
        .unwrap()
        .iter()
        .map(|p| p["product"].clone())
        .collect();
    assert_eq!(
        ids,
        ["flux", "flux-accumulated"],
        "sst was never read whole"
    );
    assert_eq!(app.get("/tiles/flux/map/0/0/0.png").await.status, 200);
    assert_eq!(app.get("/tiles/broken/map/0/0/0.png").await.status, 404);
}

#[tokio::test]
async fn a_version_that_is_damaged_leaves_the_one_before_it_in_use() {
    let app = TestApp::new().await;
    assert_eq!(app.get("/tiles/sst/map/0/0/0.png").await.status, 200);
    let newer = contract::key::ObjectKey::manifest(&"sst".parse().unwrap(), 2);
    app.store.put_new(&newer, "{".into()).await.unwrap();
    assert_eq!(app.get("/tiles/sst/map/0/0/1.png").await.status, 400);
    assert_eq!(app.get("/tiles/sst/map/0/0/0.png").await.status, 200);
}

#[tokio::test]
async fn synthetic_products_say_so() {
    let app = TestApp::new().await;
    app.land("synthetic-sea", Quantity::CarbonFlux, 1).await;
    let body = app.get("/api/products").await.json();
    let synthetic = body["products"]
        .as_array()
        .unwrap()
        .iter()
        .find(|p| p["product"] == "synthetic-sea")
        .unwrap();
    assert_eq!(synthetic["synthetic"], true);
}
