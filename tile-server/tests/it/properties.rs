//! Random addresses: whatever is asked, nothing panics and nothing is an error of ours.

use axum::body::Body;
use axum::http::Request;
use axum::http::uri::Uri;
use proptest::prelude::*;
use tokio::runtime::Builder;

use crate::app::TestApp;

/// A part of an address: plausible, almost right, or anything.
fn part() -> impl Strategy<Value = String> {
    prop_oneof![
        4 => prop::sample::select(vec![
            "tiles", "globe", "api", "products", "flux", "sst", "map", "volume", "map.json", "map.png", "point", "budget",
            "legend.json", "legend.svg", "legend.png", "0", "1", "0.png", "0@2x.png", "regions", "check", "..", "%2e%2e", "%00", "%ff", "assets", "",
        ]).prop_map(str::to_owned),
        1 => "[0-9]{1,12}(\\.png)?",
        1 => "[-a-zA-Z0-9_.~%@:+]{0,20}",
    ]
}

fn query() -> impl Strategy<Value = String> {
    let name = prop::sample::select(vec![
        "time",
        "size",
        "lon",
        "lat",
        "height_km",
        "width",
        "height",
        "region",
        "from",
        "to",
        "step",
        "earth",
        "palette",
        "range",
        "stops",
        "opacity",
        "particle_size",
        "uncertainty",
        "x",
    ]);
    let value = prop_oneof![
        "-?[0-9]{1,6}(\\.[0-9]{1,3})?(e[0-9]{1,3})?",
        "[0-9]{4}-[0-9]{2}-[0-9]{2}(T[0-9]{2}:[0-9]{2}:[0-9]{2}Z)?",
        "-?[0-9]{1,3}(,-?[0-9]{1,3}){0,4}",
        "-?[0-9]{1,3}(e-?[0-9]{1,3})?:[0-9a-f.]{1,6}(,-?[0-9]{1,3}:[0-9a-f.]{1,6}){0,3}",
        prop::sample::select(vec![
            "nan", "inf", "global", "month", "total", "sphere", "%00", "%", "%zz", ""
        ])
        .prop_map(str::to_owned),
        "[-a-zA-Z0-9_.~%,:+]{0,30}",
    ];
    prop::collection::vec((name, value), 0..5).prop_map(|pairs| {
        pairs
            .iter()
            .map(|(name, value)| format!("{name}={value}"))
            .collect::<Vec<_>>()
            .join("&")
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_address_is_an_error_of_ours(parts in prop::collection::vec(part(), 0..8), query in query()) {
        thread_local! {
            static APP: (tokio::runtime::Runtime, TestApp) = {
                let runtime = Builder::new_current_thread().enable_all().build().unwrap();
                let app = runtime.block_on(TestApp::with(|settings| settings.catalogue_age_ms = 60_000));
                (runtime, app)
            };
        }
        let path = format!("/{}?{query}", parts.join("/"));
        // What is no address at all never gets past the HTTP library.
        if let Ok(uri) = path.parse::<Uri>() {
            let request = Request::builder().uri(uri).body(Body::empty()).unwrap();
            let status = APP.with(|(runtime, app)| runtime.block_on(app.send(request)).status);
            prop_assert!(status.as_u16() < 500, "{status}: {path}");
        }
    }
}
