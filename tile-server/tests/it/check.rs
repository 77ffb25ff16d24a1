//! `/api/check`.

use axum::http::StatusCode;
use contract::check::{AgainstPaper, Check, CheckRow, Stated, Verdict};
use serde_json::json;

use crate::app::TestApp;

#[tokio::test]
async fn without_published_values_there_is_nothing_to_show() {
    let app = TestApp::new().await;
    let answer = app.get("/api/check").await;
    assert_eq!(answer.status, StatusCode::OK);
    assert_eq!(answer.json(), json!(null));
}

#[tokio::test]
async fn a_comparison_is_shown_as_it_was_made() {
    let app = TestApp::new().await;
    let row = |what: &str, paper: Option<AgainstPaper>| CheckRow {
        what: what.to_owned(),
        period: "year".to_owned(),
        unit: "Pg C".to_owned(),
        paper,
        independent: -1.404_272,
        ours: -1.404_271,
        difference: 1e-6,
        agrees: true,
    };
    let paper = AgainstPaper {
        stated: Stated {
            value: -0.7,
            decimals: 2,
            uncertainty: None,
        },
        difference: -0.7043,
        verdict: Verdict::NoUncertaintyStated,
    };
    *app.analyst.check.lock().unwrap() = Some(Check {
        rows: vec![row("Band", Some(paper)), row("Month", None)],
        note: "A note.".to_owned(),
        method: "A script.".to_owned(),
    });
    let paper = json!({"stated": {"value": -0.7, "decimals": 2, "uncertainty": null}, "difference": -0.7043,
        "verdict": "no_uncertainty_stated"});
    let row = |what: &str, paper: &serde_json::Value| {
        json!({"what": what, "period": "year", "unit": "Pg C", "paper": paper, "independent": -1.404_272,
            "ours": -1.404_271, "difference": 1e-6, "agrees": true})
    };
    let expected = json!({"note": "A note.", "method": "A script.",
        "rows": [row("Band", &paper), row("Month", &json!(null))]});
    assert_eq!(app.get("/api/check").await.json(), expected);
}
