//! `/api/products/{product}/budget`.

use axum::http::StatusCode;
use contract::budget::{BudgetParts, BudgetQuery};
use contract::earth::Earth;
use contract::quantity::Quantity;
use contract::region::{Cells, Region};
use contract::time::TimeStep;
use serde_json::json;
use tile_server::backend::Class;

use crate::app::TestApp;
use crate::doubles::Mood;

fn last(app: &TestApp) -> BudgetQuery {
    app.analyst.budgets.lock().unwrap().last().unwrap().clone()
}

#[tokio::test]
async fn an_answer_carries_everything_a_citation_needs() {
    let app = TestApp::new().await;
    let body = app.get("/api/products/flux/budget").await.json();
    assert_eq!(
        (&body["product"], &body["region"]),
        (&json!("flux"), &json!("global"))
    );
    assert_eq!(
        (&body["earth"], &body["unit"]),
        (&json!("wgs84"), &json!("Tg C"))
    );
    assert!(body["manifest"].as_str().unwrap().starts_with("flux@1-"));
    let row = json!({"start": "2000-01-01T00:00:00Z", "end": "2000-04-01T00:00:00Z",
        "budget_kg": "-176100000000.000000000", "budget_tg": -176.1, "coverage_percent": 92.5, "area_m2": 3.4e14,
        "region_area_m2": 5.1e14, "ocean_area_m2": 3.6e14, "ocean_with_data_m2": 3.3e14, "gap_tg": -12.5,
        "gap_area_m2": 2.0e13});
    assert_eq!(body["rows"], json!([row]));
    let areas = (&body["region_area_m2"], &body["ocean_area_m2"]);
    assert_eq!(areas, (&json!(5.1e14), &json!(3.6e14)));
    assert_eq!(body["cells"], json!("whole"));
    assert_eq!(body["gap_basis"], json!("the mean of the band"));
    assert_eq!(body["notes"], json!(["taken as written"]));
    assert_eq!(body["ocean_source"], json!("a coast"));
    let request = last(&app);
    assert_eq!(
        (request.region, request.step, request.earth),
        (Region::Global, TimeStep::Total, Earth::Wgs84)
    );
}

#[tokio::test]
async fn every_parameter_reaches_the_analyst() {
    let app = TestApp::new().await;
    let path = "/api/products/flux/budget?region=170,-10,-170,10&from=2000-02&to=2000-03&step=total&earth=sphere&cells=ocean-share";
    let body = app.get(path).await.json();
    assert_eq!(body["region"], "170,-10,190,10");
    let request = last(&app);
    assert_eq!(
        request.region,
        Region::Box {
            west: 170.0,
            south: -10.0,
            east: 190.0,
            north: 10.0
        }
    );
    assert_eq!(
        (request.from, request.to),
        ("2000-02".parse().ok(), "2000-03".parse().ok())
    );
    assert_eq!(
        (request.step, request.earth),
        (TimeStep::Total, Earth::Sphere)
    );
    assert_eq!(request.cells, Cells::OceanShare);
    assert_eq!(body["cells"], json!("ocean-share"));
}

#[tokio::test]
async fn a_product_may_say_what_is_sea_and_another_one_is_another_question() {
    let app = TestApp::new().await;
    app.land("mask", Quantity::LandAreaFraction, 1).await;
    for path in ["flux/budget?region=global", "sst/area?region=global"] {
        let coast = app.get(&format!("/api/products/{path}")).await.json();
        assert_eq!(coast["ocean_source"], json!("a coast"));
        let path = format!("/api/products/{path}&ocean=mask");
        let masked = app.get(&path).await.json();
        let source = masked["ocean_source"].as_str().unwrap();
        assert!(source.starts_with("mask@1-"), "{source}");
        // Remembered apart, and once.
        assert_eq!(app.get(&path).await.json(), masked);
        let unknown = app.get(&format!("{path}ed")).await;
        assert_eq!(unknown.status, StatusCode::NOT_FOUND, "{}", unknown.text());
    }
    let budgets = app.analyst.budgets.lock().unwrap();
    assert_eq!(
        (budgets.len(), app.analyst.areas.lock().unwrap().len()),
        (2, 2)
    );
}

#[tokio::test]
async fn what_is_asked_besides_reaches_the_analyst_and_is_another_question() {
    let app = TestApp::new().await;
    app.land("mask", Quantity::LandAreaFraction, 1).await;
    app.land("errors", Quantity::CarbonFlux, 1).await;
    let questions = [
        "",
        "?error=20%25&correlation_length_km=700",
        "?error=20%25&correlation_length_km=701",
        "?error=20%25&correlation_length_km=700&correlation_days=5",
        "?error=errors&correlation_length_km=700",
        "?error=20%25&correlation_length_km=700&monte_carlo=10&seed=4",
        "?error=20%25&correlation_length_km=700&monte_carlo=10&seed=5",
        "?river_flux=650%C2%B1300&river_source=me",
        "?river_flux=650&river_source=me",
        "?river_flux=errors",
        "?regions=mask",
        "/history",
    ];
    for _twice in 0..2 {
        for asked in questions {
            let answer = app.get(&format!("/api/products/flux/budget{asked}")).await;
            assert_eq!(answer.status, StatusCode::OK, "{asked}: {}", answer.text());
        }
    }
    let budgets = app.analyst.budgets.lock().unwrap();
    // Remembered apart, and once.
    assert_eq!(budgets.len(), questions.len());
    let errors = budgets[4].errors.as_ref().unwrap();
    assert_eq!(
        errors.of_product.as_ref().unwrap().product.as_str(),
        "errors"
    );
    let draws = budgets[6].errors.as_ref().unwrap().monte_carlo.unwrap();
    assert_eq!((draws.draws, draws.seed), (10, 5));
    assert!(budgets[9].river.as_ref().unwrap().of_product.is_some());
    assert!(matches!(budgets[10].parts, Some(BudgetParts::Mask(_))));
}

#[tokio::test]
async fn what_is_asked_besides_and_makes_no_sense_is_refused() {
    let app = TestApp::new().await;
    for (asked, status, reason) in [
        ("?error=20%25", 400, "correlation length"),
        ("?error=20%25&correlation_length_km=nan", 400, "km"),
        ("?error=20%25&correlation_length_km=7&seed=-1", 400, "2^64"),
        (
            "?error=20%25&correlation_length_km=7&monte_carlo=1e3",
            400,
            "10 to 10000",
        ),
        ("?error=nothing&correlation_length_km=7", 404, "no product"),
        ("?as_of=1970", 400, "the first version of flux"),
        (
            "?as_of=1970-01-01T00:00:00+02:00",
            400,
            "the first version of flux",
        ),
        ("?as_of=x", 400, "an instant"),
        ("/history?as_of=2000", 400, "all versions"),
        ("?regions=A+B", 400, "a mask"),
    ] {
        let answer = app.get(&format!("/api/products/flux/budget{asked}")).await;
        assert_eq!(answer.status.as_u16(), status, "{asked}: {}", answer.text());
        assert!(
            answer.reason().contains(reason),
            "{asked}: {}",
            answer.reason()
        );
    }
}

#[tokio::test]
async fn named_regions_are_named_in_the_answer() {
    let app = TestApp::new().await;
    let body = app
        .get("/api/products/flux/budget?region=14n-50n")
        .await
        .json();
    assert_eq!(body["region"], "14n-50n");
}

#[tokio::test]
async fn a_period_is_taken_as_it_is_asked_for() {
    let app = TestApp::new().await;
    let (start, end) = ("2000-01-01T00:00:00Z", "2000-04-01T00:00:00Z");
    for (query, row) in [
        (
            "from=1990&to=2010",
            ["1990-01-01T00:00:00Z", "2010-01-01T00:00:00Z"],
        ),
        ("from=1999", ["1999-01-01T00:00:00Z", end]),
        ("to=2001", [start, "2001-01-01T00:00:00Z"]),
        ("", [start, end]),
    ] {
        let answer = app.get(&format!("/api/products/flux/budget?{query}")).await;
        assert_eq!(answer.status, StatusCode::OK, "{query}: {}", answer.text());
        let rows = &answer.json()["rows"];
        assert_eq!([&rows[0]["start"], &rows[0]["end"]], row, "{query}");
    }
}

#[tokio::test]
async fn periods_without_data_or_the_wrong_way_round_are_refused() {
    let app = TestApp::new().await;
    for (query, reason) in [
        ("from=2001&to=2002", "covers 2000-01-01"),
        ("from=2001", "covers 2000-01-01"),
        ("to=1999", "covers 2000-01-01"),
        ("from=2000-03&to=2000-02", "end must come after the start"),
    ] {
        let answer = app.get(&format!("/api/products/flux/budget?{query}")).await;
        assert_eq!(answer.status, StatusCode::BAD_REQUEST, "{query}");
        assert!(
            answer.reason().contains(reason),
            "{query}: {}",
            answer.reason()
        );
    }
}

#[tokio::test]
async fn only_carbon_has_a_budget() {
    let app = TestApp::new().await;
    let answer = app.get("/api/products/sst/budget").await;
    assert_eq!(answer.status, StatusCode::BAD_REQUEST);
    assert!(
        answer.reason().contains("only a carbon flux has a budget"),
        "{}",
        answer.reason()
    );
}

#[tokio::test]
async fn a_budget_of_accumulated_carbon_says_how_complete_it_is() {
    let app = TestApp::new().await;
    let body = app
        .get("/api/products/flux-accumulated/budget")
        .await
        .json();
    let row = &body["rows"][0];
    let expected = json!({"complete_m2": 3e14, "incomplete_m2": 3e13});
    assert_eq!(row["completeness"], expected);
    let body = app.get("/api/products/flux/budget").await.json();
    assert!(body["rows"][0].get("completeness").is_none(), "{body}");
}

#[tokio::test]
async fn a_failed_budget_is_not_remembered() {
    let app = TestApp::new().await;
    app.analyst.set(Mood::fails(
        Class::Unavailable,
        "the cluster does not answer",
    ));
    let answer = app.get("/api/products/flux/budget").await;
    assert_eq!(
        (answer.status, answer.header("retry-after")),
        (StatusCode::SERVICE_UNAVAILABLE, "5")
    );
    assert_eq!(answer.reason(), "the cluster does not answer");
    app.analyst.set(Mood::Well);
    assert_eq!(
        app.get("/api/products/flux/budget").await.status,
        StatusCode::OK
    );
}

#[tokio::test]
async fn a_polygon_in_the_question_is_the_region_as_geojson_and_as_well_known_text() {
    let app = TestApp::new().await;
    let corners = "[[-100,-10],[100,-10],[100,10],[-100,10],[-100,-10]]";
    let geojson = format!(r#"{{"type":"Polygon","coordinates":[{corners}]}}"#);
    let wkt = "POLYGON((-100 -10,100 -10,100 10,-100 10,-100 -10))";
    let mut regions = vec![];
    for text in [geojson.as_str(), wkt] {
        let encoded = text.bytes().fold(String::new(), |encoded, byte| {
            encoded + &format!("%{byte:02X}")
        });
        let path = format!("/api/products/flux/budget?region={encoded}");
        let answer = app.get(&path).await;
        assert_eq!(answer.status, StatusCode::OK, "{}", answer.text());
        assert_eq!(answer.json()["region"], json!(text));
        regions.push(last(&app).region);
    }
    assert_eq!(regions[0], regions[1]);
    let Region::Polygons(polygons) = &regions[0] else {
        panic!("{regions:?}")
    };
    assert_eq!(
        polygons[0].outer[1].map(f64::to_bits),
        [100.0, -10.0].map(f64::to_bits)
    );
    let answer = app
        .get("/api/products/flux/budget?region=POINT(0%200)")
        .await;
    assert_eq!(answer.status, StatusCode::BAD_REQUEST);
    assert!(answer.reason().contains("no area"), "{}", answer.reason());
}
