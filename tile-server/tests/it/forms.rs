//! `format` and the header `Accept` of `/point`, `/line`, `/area` and `/budget`: the form of an answer, and what is remembered of it.

use axum::http::StatusCode;
use contract::rows::RowsForm;

use crate::app::TestApp;
use crate::posted::post;

const ARROW: &str = "application/vnd.apache.arrow.file";
/// A question of each kind, and the columns of its rows.
const QUESTIONS: [(&str, &str); 5] = [
    ("point?lon=1&lat=2", "start,end,value"),
    (
        "area?region=global",
        "start,end,mean,area_m2,coverage_percent",
    ),
    (
        "point?lon=1&lat=2&statistic=mean",
        "start,end,mean,coverage_percent,step_count,is_withheld",
    ),
    (
        "line?line=0,0;9,9&statistic=max",
        "start,end,max,max_found_at,coverage_percent,step_count,is_withheld",
    ),
    (
        "area?region=global&step=year",
        "start,end,mean,coverage_percent,step_count,is_withheld",
    ),
];

#[tokio::test]
async fn an_answer_has_the_form_that_is_asked_for() {
    let app = TestApp::new().await;
    for (question, columns) in QUESTIONS {
        let path = format!("/api/products/sst/{question}");
        let plain = app.get(&path).await;
        let json = app.get(&format!("{path}&format=json")).await;
        assert_eq!(plain.header("content-type"), "application/json");
        assert_eq!((json.status, &json.body), (StatusCode::OK, &plain.body));
        assert!(plain.json()["manifest"].is_string());
        for (form, media) in [("csv", "text/csv"), ("arrow", ARROW)] {
            let by_name = app.get(&format!("{path}&format={form}")).await;
            let by_header = app.get_with(&path, &[("accept", media)]).await;
            for answer in [by_name, by_header] {
                assert_eq!(answer.header("content-type"), media, "{question}");
                assert!(answer.header("vary").contains("accept"), "{question}");
                assert_eq!(answer.text(), format!("{form} of {columns}"));
            }
        }
        // What is said in the address is meant; the header is what a library sends.
        let csv = format!("{path}&format=csv");
        let both = app.get_with(&csv, &[("accept", ARROW)]).await;
        assert_eq!(both.header("content-type"), "text/csv");
        let any = app
            .get_with(&path, &[("accept", "text/html, */*;q=0.8")])
            .await;
        assert_eq!(any.body, plain.body);
    }
}

/// Budgets, and their histories, are kept by their rows, and written for whoever asks.
#[tokio::test]
async fn budgets_have_the_form_that_is_asked_for() {
    let app = TestApp::new().await;
    for (question, first, schema) in [
        ("budget?step=month", "region,start,end,budget_tg,", "rows"),
        (
            "budget/history?step=total",
            "manifest,published,changed,",
            "versions",
        ),
    ] {
        let path = format!("/api/products/flux/{question}");
        let plain = app.get(&path).await;
        let json = app.get(&format!("{path}&format=json")).await;
        assert_eq!((json.status, &json.body), (StatusCode::OK, &plain.body));
        assert_eq!(plain.header("content-type"), "application/json");
        assert!(plain.header("vary").contains("accept"));
        assert!(plain.json()[schema].is_array(), "{}", plain.text());
        for (form, media) in [("csv", "text/csv"), ("arrow", ARROW)] {
            let by_name = app.get(&format!("{path}&format={form}")).await;
            let by_header = app.get_with(&path, &[("accept", media)]).await;
            for answer in [by_name, by_header] {
                assert_eq!(answer.header("content-type"), media, "{question}");
                let right = format!("{form} of {first}");
                assert!(answer.text().starts_with(&right), "{}", answer.text());
            }
        }
        let refused = app.get(&format!("{path}&format=parquet")).await;
        assert_eq!(refused.status, StatusCode::BAD_REQUEST);
        assert!(refused.reason().contains("json, csv or arrow"));
    }
    assert_eq!(
        app.analyst.budgets.lock().unwrap().len(),
        2,
        "asked once each"
    );
    let region = r#"{"type":"Polygon","coordinates":[[[0,0],[9,0],[9,9],[0,0]]]}"#;
    let sent = app.send(post("flux/budget?format=csv", region)).await;
    assert!(
        sent.text()
            .starts_with("csv of region,start,end,budget_tg,"),
        "{}",
        sent.text()
    );
}

#[tokio::test]
async fn an_answer_is_written_once_in_each_form() {
    let app = TestApp::new().await;
    for _ in 0..3 {
        for form in ["json", "csv", "arrow"] {
            app.get(&format!(
                "/api/products/sst/line?line=0,0;9,9&format={form}"
            ))
            .await;
        }
    }
    assert_eq!(app.analyst.statistics.lock().unwrap().len(), 3);
    let written = app.analyst.encoded.lock().unwrap().clone();
    assert_eq!(written, [RowsForm::Csv, RowsForm::Arrow]);
}

#[tokio::test]
async fn forms_that_there_are_not_are_refused_before_anything_is_asked() {
    let app = TestApp::new().await;
    let long = "x".repeat(5000);
    for hostile in [
        "",
        "JSON",
        "parquet",
        "csv,arrow",
        "..%2Fcsv",
        "arrow%00",
        "%F0%9F%92%A9",
        &long,
    ] {
        for (question, _columns) in QUESTIONS {
            let answer = app
                .get(&format!("/api/products/sst/{question}&format={hostile}"))
                .await;
            assert_eq!(answer.status, StatusCode::BAD_REQUEST, "{hostile}");
            let reason = answer.reason();
            assert!(
                reason.contains("json, csv or arrow") && reason.len() < 200,
                "{reason}"
            );
        }
    }
    assert!(app.analyst.statistics.lock().unwrap().is_empty());
    assert!(app.analyst.points.lock().unwrap().is_empty());
    // A header is never an error: JSON is what those get who say nothing that is known.
    for header in [
        "",
        ";;;,,,",
        "text/csv;q=x",
        "a/b;q=0.1,".repeat(1000).as_str(),
    ] {
        let path = "/api/products/sst/point?lon=1&lat=2";
        let answer = app.get_with(path, &[("accept", header)]).await;
        assert_eq!(answer.header("content-type"), "application/json");
    }
}
