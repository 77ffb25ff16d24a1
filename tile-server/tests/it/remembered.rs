//! Answers that are remembered: the same question is asked once, and whatever of an address shapes an answer makes it another one.

use axum::http::StatusCode;
use contract::quantity::Quantity;

use crate::app::TestApp;

/// An address, and what is to be changed in it: a part and what stands in its place.
type Question = (&'static str, &'static [(&'static str, &'static str)]);

const QUESTIONS: [Question; 9] = [
    (
        "sst/point?lon=10&lat=20&format=json",
        &[
            ("lon=10", "lon=20"),
            ("lat=20", "lat=30"),
            ("json", "csv"),
            ("json", "arrow"),
        ],
    ),
    (
        "sst/area?region=global&from=2000-01&to=2000-03&earth=wgs84&format=json",
        &[
            ("global", "14n-50n"),
            ("from=2000-01", "from=2000-02"),
            ("to=2000-03", "to=2000-02"),
            ("wgs84", "sphere"),
            ("json", "csv"),
            ("json", "arrow"),
            ("&format", "&ocean=mask&format"),
        ],
    ),
    (
        "sst/area?region=global&from=2000-01&to=2000-03&earth=wgs84&statistic=mean&step=total&min_coverage=0&cells=whole&format=json",
        &[
            ("global", "14n-50n"),
            ("from=2000-01", "from=2000-02"),
            ("to=2000-03", "to=2000-02"),
            ("wgs84", "sphere"),
            ("statistic=mean", "statistic=max"),
            ("total", "month"),
            ("min_coverage=0", "min_coverage=1"),
            ("whole", "ocean-share"),
            ("json", "csv"),
            ("json", "arrow"),
            ("&format", "&ocean=mask&format"),
        ],
    ),
    (
        "sst/point?lon=10&lat=20&sampling=cell&statistic=mean&step=total",
        &[
            ("lon=10", "lon=20"),
            // Of one place, which is called the same.
            ("sampling=cell", "sampling=bilinear"),
            ("mean", "max"),
            ("total", "month"),
        ],
    ),
    (
        "sst/analysis?region=global&parts=anomaly,trend&base=1991/2020&bins=month&trend_step=month&min_coverage=0&from=2000-01&to=2000-03&earth=wgs84",
        &[
            ("global", "14n-50n"),
            ("anomaly", "climatology"),
            ("1991/2020", "1990/2020"),
            ("bins=month", "bins=season"),
            ("trend_step=month", "trend_step=year"),
            ("min_coverage=0", "min_coverage=1"),
            ("from=2000-01", "from=2000-02"),
            ("to=2000-03", "to=2000-02"),
            ("wgs84", "sphere"),
            ("&earth", "&ocean=mask&earth"),
        ],
    ),
    (
        "sst/analysis?line=0,0;10,10&parts=anomaly&min_coverage=0&from=2000-01&to=2000-03&earth=wgs84",
        &[
            ("10,10", "10,20"),
            // Of one line, which is called another.
            ("10,10", "10,10.0"),
            ("min_coverage=0", "min_coverage=1"),
            ("from=2000-01", "from=2000-02"),
            ("to=2000-03", "to=2000-02"),
            ("wgs84", "sphere"),
            ("line=0,0;10,10", "region=0,0,10,10"),
        ],
    ),
    (
        "sst/correlation?with=flux&region=global&max_lag=7&step=month&deseasonalise=false&min_coverage=0&from=2000-01&to=2000-03&earth=wgs84",
        &[
            ("with=flux", "with=mask"),
            ("global", "14n-50n"),
            ("region=global", "line=0,0;1,1"),
            ("max_lag=7", "max_lag=8"),
            ("step=month", "step=year"),
            ("false", "true"),
            ("min_coverage=0", "min_coverage=1"),
            ("from=2000-01", "from=2000-02"),
            ("to=2000-03", "to=2000-02"),
            ("wgs84", "sphere"),
        ],
    ),
    (
        "sst/difference?region=global&period=2000/2000&minus=sst&minus_period=2000/2001&min_coverage=0&earth=wgs84",
        &[
            ("global", "14n-50n"),
            ("region=global", "line=0,0;1,1"),
            ("&period=2000/2000", "&period=1999/2000"),
            ("minus=sst", "minus=other"),
            ("minus_period=2000/2001", "minus_period=2000/2002"),
            ("min_coverage=0", "min_coverage=1"),
            ("wgs84", "sphere"),
        ],
    ),
    (
        "sst/hovmoller?along=lat&band=10&region=100,0,130,40&step=month&min_coverage=0&from=2000-01&to=2000-03&earth=wgs84",
        &[
            ("along=lat", "along=lon"),
            ("band=10", "band=20"),
            ("130,40", "130,50"),
            (
                "100,0,130,40",
                "POLYGON((100%200,130%200,130%2040,100%200))",
            ),
            ("min_coverage=0", "min_coverage=1"),
            ("step=month", "step=total"),
            ("from=2000-01", "from=2000-02"),
            ("to=2000-03", "to=2000-02"),
            ("wgs84", "sphere"),
        ],
    ),
];

/// Questions that reached the analyst.
fn asked(app: &TestApp) -> usize {
    let analyst = &app.analyst;
    let points = analyst.points.lock().unwrap().len();
    let areas = analyst.areas.lock().unwrap().len();
    let statistics = analyst.statistics.lock().unwrap().len();
    points + areas + statistics + analyst.made.lock().unwrap().len()
}

#[tokio::test]
async fn whatever_shapes_an_answer_makes_it_another_question_and_the_same_one_is_asked_once() {
    let app = TestApp::new().await;
    app.land("mask", Quantity::LandAreaFraction, 1).await;
    app.land("other", Quantity::SeaSurfaceTemperature, 1).await;
    for (address, changes) in QUESTIONS {
        let address = format!("/api/products/{address}");
        let mut all = vec![address.clone()];
        for (part, other) in changes {
            assert_eq!(address.matches(part).count(), 1, "{part} of {address}");
            all.push(address.replace(part, other));
        }
        for own in &all {
            let before = asked(&app);
            let first = app.get(own).await;
            assert_eq!(first.status, StatusCode::OK, "{own}: {}", first.text());
            assert_eq!(asked(&app), before + 1, "{own} is taken for another one");
            assert_eq!(app.get(own).await.body, first.body, "{own}");
            assert_eq!(asked(&app), before + 1, "{own} is not remembered");
        }
        // Of a newer version everything is another question.
        let before = asked(&app);
        let number = app.newest_number("sst").await;
        app.land("sst", Quantity::SeaSurfaceTemperature, number + 1)
            .await;
        app.get(&address).await;
        assert_eq!(asked(&app), before + 1, "{address} of another version");
    }
}
