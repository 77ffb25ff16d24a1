//! What an address asks for over a finished picture of the globe.

use axum::http::StatusCode;
use contract::annotation::Graticule;
use contract::quantity::Quantity;

use crate::app::TestApp;

#[tokio::test]
async fn an_address_says_what_is_drawn_over_its_picture() {
    let app = TestApp::new().await;
    let path =
        "/globe/flux/map.png?time=2000-02-10T12:00:00Z&annotate=legend,date,source&graticule=7.5";
    let answer = app.get(path).await;
    assert_eq!(answer.status, StatusCode::OK, "{}", answer.text());
    let annotations = app.drawer.last_job().annotations.unwrap();
    assert_eq!(annotations.legend, Some(Quantity::CarbonFlux));
    let date = annotations.date.unwrap();
    assert_eq!(date.shown.as_str(), "10 February 2000");
    assert_eq!(annotations.graticule, Graticule::every(7.5).ok());
    assert!(annotations.source.is_some());
    assert!(!annotations.names && !annotations.scale && annotations.height.is_none());
}

#[tokio::test]
async fn annotations_are_part_of_a_pictures_name_and_their_absence_is_not() {
    let app = TestApp::new().await;
    let tag = async |query: &str| {
        let answer = app.get(&format!("/globe/flux/map.png?{query}")).await;
        assert_eq!(answer.status, StatusCode::OK, "{query}: {}", answer.text());
        answer.header("etag").to_owned()
    };
    let plain = tag("time=2000-02-10").await;
    // Both lie before the first middle of a step: one picture, until it says when it is.
    assert_eq!(tag("time=2000-01-02").await, tag("time=2000-01-03").await);
    assert_ne!(
        tag("time=2000-01-02&annotate=date").await,
        tag("time=2000-01-03&annotate=date").await
    );
    let mut tags = vec![plain];
    for query in [
        "annotate=legend",
        "annotate=names",
        "annotate=scale",
        "annotate=all",
        "graticule=10",
        "graticule=20",
    ] {
        tags.push(tag(&format!("time=2000-02-10&{query}")).await);
    }
    assert_eq!(
        tag("time=2000-02-10&annotate=scale,legend").await,
        tag("time=2000-02-10&annotate=legend,scale").await
    );
    let count = tags.len();
    tags.sort();
    tags.dedup();
    assert_eq!(tags.len(), count);
}

#[tokio::test]
async fn what_cannot_be_drawn_over_a_picture_is_refused_with_what_can() {
    let app = TestApp::new().await;
    for (path, reason) in [
        (
            "/globe/flux/map.png?annotate=legend,compass",
            "legend, date, graticule, names, scale, height, source",
        ),
        ("/globe/flux/map.png?annotate=height", "leave it out"),
        ("/globe/flux/map.png?graticule=0", "0.01 to 90"),
        ("/globe/flux/map.png?graticule=NaN", "0.01 to 90"),
        ("/globe/flux/map.png?graticule=1000", "0.01 to 90"),
        (
            "/tiles/flux/map/0/0/0.png?annotate=all",
            "neighbours would cut",
        ),
        (
            "/tiles/flux/map/0/0/0.png?graticule=15",
            "neighbours would cut",
        ),
        (
            "/tiles/flux/map.json?annotate=legend",
            "neighbours would cut",
        ),
    ] {
        let answer = app.get(path).await;
        assert_eq!(
            answer.status,
            StatusCode::BAD_REQUEST,
            "{path}: {}",
            answer.text()
        );
        assert!(answer.text().contains(reason), "{path}: {}", answer.text());
    }
}
