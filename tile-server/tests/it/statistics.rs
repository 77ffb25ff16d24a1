//! `/api/products/{product}/point`, `/line` and `/area` where statistics are asked of them.

use axum::http::StatusCode;
use contract::earth::Earth;
use contract::geometry::{Geometry, Sampling};
use contract::region::Cells;
use contract::statistics::StatisticsQuery;
use contract::time::TimeStep;
use serde_json::json;

use crate::app::TestApp;

fn last(app: &TestApp) -> StatisticsQuery {
    let asked = app.analyst.statistics.lock().unwrap();
    asked.last().unwrap().clone()
}

#[tokio::test]
async fn every_parameter_reaches_the_analyst_once() {
    let app = TestApp::new().await;
    let path = "/api/products/flux/line?line=100,0;110,10;-170,5&statistic=p90,mean&step=season&from=2000-02&to=2000-03\
                &min_coverage=12.5&earth=sphere";
    for _ in 0..2 {
        let body = app.get(path).await.json();
        assert_eq!(body["geometry"], "100,0;110,10;-170,5");
        assert_eq!(body["rows"][0]["values"], json!({"mean": 1.0, "p90": 1.0}));
    }
    assert_eq!(
        app.analyst.statistics.lock().unwrap().len(),
        1,
        "not remembered"
    );
    let query = last(&app);
    let Geometry::Line(line) = &query.geometry else {
        panic!("{query:?}")
    };
    assert_eq!(line.edges().count(), 2);
    assert_eq!((query.step, query.earth), (TimeStep::Season, Earth::Sphere));
    let names: Vec<String> = query.statistics.iter().map(|one| one.to_string()).collect();
    assert_eq!(names, ["p90", "mean"]);
    assert_eq!(query.min_coverage.percent().to_bits(), 12.5f64.to_bits());
    assert_eq!(
        (query.from, query.to),
        ("2000-02".parse().ok(), "2000-03".parse().ok())
    );
    // Whatever differs is another question.
    app.get(&path.replace("p90", "p91")).await;
    app.get(&path.replace("season", "year")).await;
    app.get(&path.replace("12.5", "13")).await;
    assert_eq!(app.analyst.statistics.lock().unwrap().len(), 4);
}

#[tokio::test]
async fn points_and_areas_answer_with_statistics_where_they_are_asked_for() {
    let app = TestApp::new().await;
    let asked = || app.analyst.statistics.lock().unwrap().len();
    for plain in ["point?lon=1&lat=2", "area?region=global&to=2000-03"] {
        let body = app.get(&format!("/api/products/sst/{plain}")).await.json();
        assert!(body["series"].is_array(), "{plain}");
    }
    assert_eq!(asked(), 0);
    for (path, kind) in [
        ("point?lon=1&lat=2&statistic=std", "point"),
        ("point?lon=1&lat=2&from=2000-02", "point"),
        ("point?lon=1&lat=2&sampling=bilinear", "point"),
        ("area?region=global&step=year", "area"),
        ("area?region=global&min_coverage=50", "area"),
        ("area?region=global&cells=ocean-share", "area"),
    ] {
        let body = app.get(&format!("/api/products/sst/{path}")).await.json();
        assert_eq!(body["kind"], kind, "{path}");
        assert_eq!(body["rows"].as_array().unwrap().len(), 1, "{path}");
    }
    assert_eq!((asked(), last(&app).cells), (6, Cells::OceanShare));
    app.get("/api/products/sst/point?lon=181&lat=2&sampling=bilinear")
        .await;
    let Geometry::Point { place, sampling } = last(&app).geometry else {
        panic!("{:?}", last(&app))
    };
    assert_eq!(sampling, Sampling::Bilinear);
    assert_eq!(place.lon.to_bits(), (-179.0f64).to_bits());
}

#[tokio::test]
async fn what_cannot_be_asked_is_refused_with_what_can() {
    let app = TestApp::new().await;
    for (path, reason) in [
        ("line", "LON,LAT"),
        ("line?line=5,5", "two different places"),
        ("line?line=0,0;180,0", "opposite"),
        ("line?line=0,0;1,1&statistic=mode", "use mean"),
        ("line?line=0,0;1,1&statistic=p101", "p0 to p100"),
        ("line?line=0,0;1,1&step=decade", "season"),
        ("line?line=0,0;1,1&from=2001", "covers 2000-01-01"),
        (
            "line?line=0,0;1,1&step=day&from=0001&to=9999",
            "longer ones",
        ),
        ("line?line=0,0;1,1&min_coverage=101", "0 to 100"),
        ("line?line=POLYGON((0 0,1 0,1 1,0 0))", "no line"),
        ("point?lon=1&lat=2&sampling=cubic", "bilinear"),
        ("point?lon=1&lat=2&statistic=", "use mean"),
        ("area?region=global&statistic=mean,p-1", "p0 to p100"),
    ] {
        let path = path.replace(' ', "%20");
        let answer = app.get(&format!("/api/products/sst/{path}")).await;
        assert_eq!(answer.status, StatusCode::BAD_REQUEST, "{path}");
        assert!(
            answer.reason().contains(reason),
            "{path}: {}",
            answer.reason()
        );
    }
    assert!(app.analyst.statistics.lock().unwrap().is_empty());
}
