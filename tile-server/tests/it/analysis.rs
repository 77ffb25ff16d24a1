//! `/api/products/{product}/analysis`, `correlation`, `difference` and `hovmoller`.

use axum::http::StatusCode;
use contract::analysis::{Along, AnalysisPart, CalendarBins, SeriesQuery};
use contract::time::TimeStep;
use serde_json::json;
use tile_server::backend::{Class, SeriesQuestion};

use crate::app::TestApp;
use crate::doubles::Mood;

fn last(app: &TestApp) -> SeriesQuestion {
    app.analyst.made.lock().unwrap().last().unwrap().clone()
}

#[tokio::test]
async fn every_parameter_of_an_analysis_reaches_the_analyst_once() {
    let app = TestApp::new().await;
    let path = "/api/products/sst/analysis?lon=10&lat=20&parts=trend,anomaly&base=1991/2020&bins=season&trend_step=year&min_coverage=40&from=2000-02";
    for _ in 0..2 {
        let body = app.get(path).await.json();
        assert_eq!(
            (&body["product"], &body["unit"]),
            (&json!("sst"), &json!("°C"))
        );
        assert_eq!(body["refused"][0]["reason"], "too short");
    }
    assert_eq!(app.analyst.made.lock().unwrap().len(), 1, "not remembered");
    let SeriesQuestion::Analysis {
        series, options, ..
    } = last(&app)
    else {
        panic!("another question");
    };
    assert_eq!(options.parts, [AnalysisPart::Anomaly, AnalysisPart::Trend]);
    assert_eq!(options.base, "1991/2020".parse().ok());
    assert_eq!(
        (options.bins, options.trend_step),
        (CalendarBins::Season, TimeStep::Year)
    );
    assert!((options.min_coverage.percent() - 40.0).abs() < 1e-12);
    assert_eq!(series.window(), ("2000-02".parse().ok(), None));
    assert!(matches!(series, SeriesQuery::Cell { place, .. } if place.lon > 9.9));
    for other in [
        "parts=season&region=global",
        "parts=season&region=14n-50n",
        "parts=trend&region=global",
        "parts=trend&region=global&min_coverage=40",
        "parts=trend&line=0,0;10,10",
    ] {
        app.get(&format!("/api/products/sst/analysis?{other}"))
            .await;
    }
    assert_eq!(
        app.analyst.made.lock().unwrap().len(),
        6,
        "two questions are taken for one"
    );
    let SeriesQuestion::Analysis { series, .. } = last(&app) else {
        panic!("another question");
    };
    let SeriesQuery::Line(along) = series else {
        panic!("no line: {series:?}");
    };
    assert_eq!(
        (along.line.name.as_str(), along.line.line.edges().count()),
        ("0,0;10,10", 1)
    );
}

#[tokio::test]
async fn two_series_and_bands_are_asked_for_with_what_belongs_to_them() {
    let app = TestApp::new().await;
    let path = "/api/products/sst/correlation?with=flux&region=global&max_lag=7&step=native&deseasonalise=true&min_coverage=40";
    assert_eq!(app.get(path).await.json()["second"]["product"], "flux");
    let SeriesQuestion::Correlation { query, .. } = last(&app) else {
        panic!("another question");
    };
    assert_eq!(
        (query.max_lag, query.step, query.deseasonalise),
        (7, TimeStep::Native, true)
    );
    let forty = "40".parse().ok();
    assert_eq!(Some(query.min_coverage), forty);
    let path = "/api/products/sst/difference?region=global&period=2000/2000&minus_period=2000/2001&min_coverage=40";
    assert_eq!(app.get(path).await.status, StatusCode::OK);
    let SeriesQuestion::Difference {
        of,
        minus,
        min_coverage,
    } = last(&app)
    else {
        panic!("another question");
    };
    assert_eq!(Some(min_coverage), forty);
    assert_eq!(of.0.id, minus.0.id);
    assert_eq!(of.1.window().1, "2001".parse().ok());
    assert_eq!(minus.1.window().1, "2002".parse().ok());
    let path =
        "/api/products/sst/hovmoller?along=lon&band=5&region=100,0,130,41&step=year&earth=sphere";
    assert_eq!(
        app.get(path).await.json()["rows"][0]["means"],
        json!([1.5, null])
    );
    let SeriesQuestion::Hovmoller { query, .. } = last(&app) else {
        panic!("another question");
    };
    assert_eq!(
        (query.along, query.band_deg, query.step),
        (Along::Lon, Some(5.0), TimeStep::Year)
    );
    assert_eq!(query.region, "100,0,130,41".parse().ok());
    let path = "/api/products/sst/hovmoller?along=lat&region=equatorial-pacific&min_coverage=40";
    assert_eq!(app.get(path).await.status, StatusCode::OK);
    let SeriesQuestion::Hovmoller { query, .. } = last(&app) else {
        panic!("another question");
    };
    let asked = (query.region, Some(query.min_coverage));
    assert_eq!(asked, ("equatorial-pacific".parse().ok(), forty));
}

#[tokio::test]
async fn what_would_change_nothing_is_refused() {
    let app = TestApp::new().await;
    for (path, reason) in [
        (
            "analysis?parts=trend&region=global&base=1991/2020",
            "belongs to the climatology",
        ),
        (
            "analysis?parts=extremes&region=global&bins=season",
            "belongs to the climatology",
        ),
        (
            "analysis?parts=anomaly&region=global&trend_step=year",
            "belongs to the trend",
        ),
        (
            "analysis?parts=trend&lon=1&lat=1&earth=sphere",
            "a cell is taken as it is",
        ),
        (
            "analysis?parts=trend&lon=1&lat=1&ocean=sst",
            "in regions alone",
        ),
        (
            "analysis?parts=trend&line=0,0;1,1&ocean=sst",
            "in regions alone",
        ),
        (
            "correlation?with=flux&lon=1&lat=1&earth=wgs84",
            "a cell is taken as it is",
        ),
    ] {
        check_refused(&app, path, reason).await;
    }
}

/// A question of a product is answered with why it cannot be asked.
async fn check_refused(app: &TestApp, path: &str, reason: &str) {
    let refused = app.get(&format!("/api/products/sst/{path}")).await;
    assert_eq!(refused.status, StatusCode::BAD_REQUEST, "{path}");
    let text = refused.text();
    assert!(text.contains(reason), "{path}: {text}");
}

#[tokio::test]
async fn what_cannot_be_asked_is_refused_with_what_can() {
    let app = TestApp::new().await;
    for (path, reason) in [
        ("analysis?region=global", "give one of climatology"),
        ("analysis?region=global&parts=median", "median"),
        ("analysis?parts=trend", "a region, a line, or lon and lat"),
        (
            "analysis?parts=trend&region=global&lon=1&lat=1",
            "one of them alone",
        ),
        (
            "analysis?parts=trend&region=global&line=0,0;1,1",
            "one of them alone",
        ),
        ("difference?line=0,0;1,1&lon=1&lat=1", "one of them alone"),
        ("analysis?parts=trend&line=5,5", "two different places"),
        ("correlation?with=flux&line=0,0;180,0", "opposite"),
        (
            "analysis?parts=trend&lon=1",
            "a region, a line, or lon and lat",
        ),
        (
            "analysis?parts=climatology&region=global&base=2020/1991",
            "FIRST/LAST",
        ),
        (
            "analysis?parts=trend&region=global&from=2001",
            "covers 2000-01-01",
        ),
        ("correlation?region=global", "a second product"),
        (
            "correlation?region=global&with=flux&max_lag=401",
            "0 to 400",
        ),
        ("correlation?region=global&with=flux&max_lag=-1", "0 to 400"),
        (
            "correlation?region=global&with=flux&deseasonalise=yes",
            "true or false",
        ),
        ("difference?region=global&period=2000", "FIRST/LAST"),
        ("hovmoller", "lat or lon"),
        ("hovmoller?along=depth", "depth"),
        ("hovmoller?along=lat&band=wide", "wide"),
        ("hovmoller?along=lat&region=POLYGON%20EMPTY", "is empty"),
        ("hovmoller?along=lat&region=0,0,400,10", "400 degrees wide"),
        ("hovmoller?along=lat&min_coverage=101", "0 to 100"),
        (
            "correlation?region=global&with=flux&min_coverage=half",
            "0 to 100",
        ),
        ("difference?region=global&min_coverage=-1", "0 to 100"),
    ] {
        check_refused(&app, path, reason).await;
    }
    let unknown = app
        .get("/api/products/sst/correlation?region=global&with=nothing")
        .await;
    assert_eq!(unknown.status, StatusCode::NOT_FOUND);
    assert!(app.analyst.made.lock().unwrap().is_empty());
    app.analyst
        .set(Mood::fails(Class::BadRequest, "too many means"));
    let refused = app.get("/api/products/sst/hovmoller?along=lat").await;
    assert_eq!(refused.status, StatusCode::BAD_REQUEST);
    assert!(refused.text().contains("too many means"));
}
