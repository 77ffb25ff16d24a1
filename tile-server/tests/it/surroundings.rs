//! What an address asks for besides the product: relief, sea, coast lines, the sun.

use axum::http::StatusCode;
use contract::quantity::Quantity;
use serde_json::json;

use crate::app::TestApp;

#[tokio::test]
async fn an_address_says_what_surrounds_the_particles() {
    let app = TestApp::new().await;
    app.land("etopo", Quantity::Elevation, 1).await;
    let path = "/tiles/flux/volume/0/0/0.png?time=2000-02-10T12:00:00Z&relief=etopo&relief_exaggeration=30\
                &sea_opacity=0.4&coastlines=true&height_exaggeration=1e6&sun=time";
    assert_eq!(app.get(path).await.status, StatusCode::OK);
    let job = app.drawer.last_job();
    let relief = job.relief.unwrap();
    assert_eq!(relief.field.as_str().split('/').nth(1), Some("etopo"));
    assert_eq!(relief.exaggeration.to_bits(), 30f64.to_bits());
    assert!(job.style.context.coastlines && job.style.context.sea_opacity > 0.39);
    assert!((job.style.height_m_per_kg_m2 - 1e6).abs() < 1e-6);
    // Noon in Greenwich in February: the sun over Africa, in the south; the clock is a quarter of an hour ahead of it.
    let sun = job.style.sun.subsolar.unwrap();
    assert!(
        (sun.lon_deg - 3.56).abs() < 0.1 && (sun.lat_deg - -14.3).abs() < 0.3,
        "{sun:?}"
    );
}

#[tokio::test]
async fn the_sun_of_a_time_beyond_the_product_is_that_of_the_instant_shown() {
    let app = TestApp::new().await;
    let of = async |time: &str| {
        let path = format!("/globe/flux/volume.png?time={time}&sun=time");
        app.get(&path).await.header("etag").to_owned()
    };
    assert_eq!(of("2001-07-01").await, of("2020-01-01").await);
    assert_ne!(of("2000-02-10").await, of("2000-02-11").await);
}

#[tokio::test]
async fn surroundings_are_part_of_a_pictures_name_and_nothing_else_is() {
    let app = TestApp::new().await;
    app.land("etopo", Quantity::Elevation, 1).await;
    let tag = async |query: &str| {
        let path = format!("/tiles/flux/volume/0/0/0.png?{query}");
        let answer = app.get(&path).await;
        assert_eq!(answer.status, StatusCode::OK, "{query}: {}", answer.text());
        answer.header("etag").to_owned()
    };
    let plain = tag("").await;
    assert_eq!(plain, tag("coastlines=false&sea_opacity=0").await);
    assert_eq!(plain, tag("sun=315,40&height_exaggeration=8e6").await);
    let mut tags = vec![plain];
    for query in [
        "coastlines=true",
        "sea_opacity=0.5",
        "sun=90,40",
        "sun=time",
        "height_exaggeration=1e6",
        "relief=etopo",
        "relief=etopo&relief_exaggeration=1",
    ] {
        tags.push(tag(query).await);
    }
    let count = tags.len();
    tags.sort();
    tags.dedup();
    assert_eq!(tags.len(), count);
}

#[tokio::test]
async fn what_means_nothing_is_refused_with_what_would_be_valid() {
    let app = TestApp::new().await;
    for (query, status, reason) in [
        ("sea_opacity=2", 400, "0.99"),
        ("sea_opacity=much", 400, "0.99"),
        ("coastlines=1", 400, "true or false"),
        ("sun=noon", 400, "such as 315,40"),
        ("sun=315,1", 400, "5 to 90"),
        ("height_exaggeration=-1", 400, "0 to 1e9"),
        ("relief=flux", 400, "elevation"),
        ("relief=nothing", 404, "/api/products"),
    ] {
        for path in ["/tiles/flux/volume/0/0/0.png", "/globe/flux/volume.png"] {
            let answer = app.get(&format!("{path}?{query}")).await;
            assert_eq!(answer.status.as_u16(), status, "{query}");
            assert!(
                answer.reason().contains(reason),
                "{query}: {}",
                answer.reason()
            );
        }
    }
    assert_eq!(app.drawer.drawn_count(), 0);
}

#[tokio::test]
async fn a_map_client_gets_tiles_in_the_same_surroundings() {
    let app = TestApp::new().await;
    let body = app
        .get("/tiles/flux/volume.json?coastlines=true&sea_opacity=0.50&sun=time")
        .await
        .json();
    let tiles = "/tiles/flux/volume/{z}/{x}/{y}.png?sea_opacity=0.5&coastlines=true&sun=time";
    assert_eq!(body["tiles"], json!([tiles]));
    let refused = app.get("/tiles/flux/volume.json?sun=%22").await;
    assert_eq!(refused.status, StatusCode::BAD_REQUEST);
}
