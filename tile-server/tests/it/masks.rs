//! `region=MASK:CODE`: the cells of a landed mask as the region of a question.

use axum::http::StatusCode;
use contract::analysis::SeriesQuery;
use contract::quantity::Quantity;
use tile_server::backend::SeriesQuestion;

use crate::app::TestApp;

/// What those take while they are asked about.
const HELD: &str = "fluxglobe_tile_server_body_bytes";
/// Addresses that take a region.
const TAKES: [&str; 8] = [
    "sst/area?",
    "sst/area?statistic=mean&step=total&",
    "sst/analysis?parts=anomaly&",
    "sst/correlation?with=flux&max_lag=2&",
    "sst/difference?minus=flux&",
    "sst/hovmoller?along=lat&",
    "flux/budget?step=month&",
    "flux/budget/history?",
];

/// What the region of a question about series is called.
fn name(made: &SeriesQuestion) -> String {
    let series = match made {
        SeriesQuestion::Analysis { series, .. } => series,
        SeriesQuestion::Correlation { query, .. } => &query.series,
        SeriesQuestion::Difference { of, .. } => &of.1,
        SeriesQuestion::Hovmoller { query, .. } => {
            return query.region.as_ref().unwrap().name.clone();
        }
    };
    match series {
        SeriesQuery::Region(query) => query.region_name.clone(),
        other => panic!("{other:?}"),
    }
}

async fn with_mask() -> TestApp {
    let app = TestApp::new().await;
    let codes = Quantity::open("basin", "1", "Basin").unwrap();
    app.land("my-basins", codes, 1).await;
    app
}

/// Regions of masks that the analyst was asked for, without digests.
fn asked(app: &TestApp) -> Vec<String> {
    let asked = app.analyst.mask_regions.lock().unwrap();
    let without_digest = |own: &String| {
        let (version, code) = own.split_once(':').unwrap();
        format!("{}:{code}", version.split_once('-').unwrap().0)
    };
    // Names of products have a dash too.
    let plain = asked.iter().map(|own| own.replace("my-basins", "basins"));
    plain.map(|own| without_digest(&own)).collect()
}

#[tokio::test]
async fn a_code_of_a_mask_is_a_region_wherever_one_is_taken() {
    let app = with_mask().await;
    for path in TAKES {
        for region in ["my-basins:5", "my-basins%3A5", "my-basins:%205"] {
            let path = format!("/api/products/{path}region={region}");
            let answer = app.get(&path).await;
            assert_eq!(answer.status, StatusCode::OK, "{path}: {}", answer.text());
            // The analyst of these tests makes the same of every series.
            let asked = match app.analyst.made.lock().unwrap().last() {
                Some(made) if !path.contains("/area") && !path.contains("/budget") => name(made),
                _ => {
                    let answer = answer.json();
                    let of_series = answer["region"].as_str();
                    of_series
                        .or(answer["geometry"].as_str())
                        .unwrap()
                        .to_owned()
                }
            };
            let is_asked = asked.starts_with("my-basins@1-") && asked.ends_with(":5");
            assert!(is_asked, "{path}: {asked}");
        }
    }
    // Looked up once, and the same question however it is written.
    assert_eq!(asked(&app), ["basins@1:5"]);
    assert_eq!(app.analyst.areas.lock().unwrap().len(), 1);
    assert_eq!(app.analyst.made.lock().unwrap().len(), 4);
    assert_eq!(app.analyst.budgets.lock().unwrap().len(), 2);
    for (code, told) in [
        ("12345", "12345"),
        ("-1.5", "-1.5"),
        ("southern", "southern"),
    ] {
        let path = format!("/api/products/flux/budget?region=my-basins:{code}");
        let answer = app.get(&path).await;
        assert_eq!(answer.status, StatusCode::OK, "{}", answer.text());
        let region = answer.json()["region"].as_str().unwrap().to_owned();
        assert!(region.ends_with(&format!(":{told}")), "{region}");
    }
    assert_eq!(app.metric(HELD).await, 0);
}

#[tokio::test]
async fn a_mask_or_a_code_that_is_not_there_is_refused_and_says_what_is() {
    let app = with_mask().await;
    for path in TAKES {
        for (region, status, reason) in [
            ("my-basins:99", 400, "there are 1, 5, 12345"),
            ("none:5", 404, "none"),
            ("my-basins@7:5", 404, "my-basins@7"),
            ("my-basins:", 400, "region"),
            ("my-basins:a%20b", 400, "region"),
            ("my-basins:%1B%5B2J", 400, "region"),
        ] {
            let path = format!("/api/products/{path}region={region}");
            let answer = app.get(&path).await;
            assert_eq!(answer.status.as_u16(), status, "{path}: {}", answer.text());
            let told = answer.reason();
            assert!(told.contains(reason), "{path}: {told}");
            assert!(!told.chars().any(char::is_control), "{told:?}");
        }
    }
    assert_eq!(app.metric(HELD).await, 0);
}

#[tokio::test]
async fn a_mask_is_asked_for_in_one_of_its_versions() {
    let app = with_mask().await;
    let codes = Quantity::open("basin", "1", "Basin").unwrap();
    let second = app.land("my-basins", codes, 2).await;
    app.get("/api/products/sst/area?region=my-basins:5").await;
    for mask in ["my-basins@1", &second.to_string()] {
        let path = format!("/api/products/sst/area?region={mask}:5");
        let answer = app.get(&path).await;
        assert_eq!(answer.status, StatusCode::OK, "{}", answer.text());
    }
    assert_eq!(asked(&app), ["basins@2:5", "basins@1:5"]);
}
