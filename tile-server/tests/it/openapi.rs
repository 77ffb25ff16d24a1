//! `/api/openapi.json`: it is the committed one, it names every route, and answers are what it says.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use axum::http::StatusCode;
use contract::check::{AgainstPaper, Check, CheckRow, Stated, Verdict};
use contract::observation::{PlatformKind, Quality, TrackPoint};
use contract::quantity::Quantity;
use contract::time::Period;
use serde_json::{Value, json};

use crate::app::{Answer, TestApp};
use crate::doubles::Mood;
use crate::events::Viewer;
use crate::observations::{observation, platform};
use crate::posted::{SQUARE, TRACK, post};
use crate::schema::problems;

const COMMITTED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/openapi.json");
const ROUTER: &str = include_str!("../../src/router.rs");

/// One address of every operation, and what is sent along.
const ASKED: [(&str, &str); 28] = [
    (
        "/tiles/{product}/{mode}/{z}/{x}/{y}.png",
        "/tiles/flux/volume/1/0/1@2x.png",
    ),
    ("/tiles/{product}/{mode}.json", "/tiles/flux/volume.json"),
    ("/globe/{product}/{mode}.png", "/globe/flux/map.png"),
    ("/api/products", "/api/products"),
    (
        "/api/products/{product}/legend.{form}",
        "/api/products/flux/legend.json",
    ),
    (
        "/api/products/{product}/legend.{form}",
        "/api/products/flux/legend.svg",
    ),
    (
        "/api/products/{product}/legend.{form}",
        "/api/products/flux/legend.png",
    ),
    (
        "/api/products/{product}/point",
        "/api/products/flux/point?lon=0&lat=0",
    ),
    (
        "/api/products/{product}/point",
        "/api/products/flux-accumulated/point?lon=-175&lat=0",
    ),
    (
        "/api/products/{product}/area",
        "/api/products/sst/area?region=global",
    ),
    (
        "/api/products/{product}/line",
        "/api/products/sst/line?line=0,0;10,10",
    ),
    (
        "/api/products/{product}/analysis",
        "/api/products/sst/analysis?region=global&parts=trend,climatology",
    ),
    (
        "/api/products/{product}/correlation",
        "/api/products/sst/correlation?with=flux&region=global",
    ),
    (
        "/api/products/{product}/difference",
        "/api/products/sst/difference?minus=flux&region=global",
    ),
    (
        "/api/products/{product}/hovmoller",
        "/api/products/sst/hovmoller?along=lat",
    ),
    (
        "/api/products/{product}/budget",
        "/api/products/flux-accumulated/budget?step=year",
    ),
    (
        "/api/products/{product}/budget/history",
        "/api/products/flux/budget/history",
    ),
    ("/api/regions", "/api/regions"),
    ("/api/palettes", "/api/palettes"),
    ("/api/check", "/api/check"),
    ("/api/openapi.json", "/api/openapi.json"),
    ("/api/observations/platforms", "/api/observations/platforms"),
    (
        "/api/observations/{dataset}/{platform}",
        "/api/observations/buoys/51001",
    ),
    ("/zarr/{product}/{key}", "/zarr/flux/zarr.json"),
    ("/zarr2/{product}/{key}", "/zarr2/flux/.zmetadata"),
    ("/healthz", "/healthz"),
    ("/readyz", "/readyz"),
    ("/metrics", "/metrics"),
];
/// What never ends is listened to instead.
const ENDLESS: &str = "/api/events";
/// What answers in another protocol: `stream.rs` speaks it.
const SWITCHING: &str = "/stream";

/// Headers that not every answer has.
const OFTEN_ABSENT: [&str; 4] = [
    "fluxglobe-time-covered",
    "fluxglobe-heights-end",
    "fluxglobe-heights-within",
    "fluxglobe-tilt-with-ground",
];

/// Parameters that are free text: no value of theirs is wrong.
const FREE_TEXT: [&str; 3] = ["property", "after", "revision"];

async fn described() -> Value {
    let app = TestApp::new().await;
    app.get("/api/openapi.json").await.json()
}

/// A server that has something of everything.
async fn rich() -> TestApp {
    let app = TestApp::new().await.observing();
    app.land("sea-east", Quantity::Current, 1).await;
    app.land("sea-north", Quantity::Current, 1).await;
    let ship = platform("MLCE", PlatformKind::Ship);
    *app.observer.platforms.lock().unwrap() = vec![platform("51001", PlatformKind::Buoy), ship];
    let at = |lon_deg: f64| TrackPoint {
        time: "2020-01-01".parse().unwrap(),
        lon_deg,
        lat_deg: 10.0,
    };
    *app.observer.track.lock().unwrap() = vec![at(178.0), at(-178.0), at(-177.0)];
    *app.observer.observations.lock().unwrap() =
        vec![observation(0, Quality::Good), observation(1, Quality::Bad)];
    let row = |paper| CheckRow {
        what: "Sea".to_owned(),
        period: "year".to_owned(),
        unit: "Pg C".to_owned(),
        paper,
        independent: -1.4,
        ours: -1.4,
        difference: 0.0,
        agrees: true,
    };
    let paper = AgainstPaper {
        stated: Stated {
            value: -1.4,
            decimals: 1,
            uncertainty: Some(0.7),
        },
        difference: 0.0,
        verdict: Verdict::Within,
    };
    *app.analyst.check.lock().unwrap() = Some(Check {
        rows: vec![row(Some(paper)), row(None)],
        note: "A note.".to_owned(),
        method: "A script.".to_owned(),
    });
    app
}

fn operation<'a>(description: &'a Value, path: &str) -> &'a Value {
    let found = &description["paths"][path]["get"];
    assert!(found.is_object(), "{path} is not described");
    found
}

/// Status, content type and body of an answer, held against an operation.
fn hold(description: &Value, path: &str, address: &str, answer: &Answer) {
    hold_to(description, operation(description, path), address, answer);
}

fn hold_to(description: &Value, operation: &Value, address: &str, answer: &Answer) {
    let status = answer.status.as_u16().to_string();
    let response = &operation["responses"][&status];
    assert!(
        response.is_object(),
        "{address}: {status} is not described: {}",
        answer.text()
    );
    let sent = answer.header("content-type");
    let sent = sent.split(';').next().unwrap_or_default().trim();
    let content = &response["content"][sent];
    assert!(
        content.is_object(),
        "{address}: {sent:?} is not described for {status}"
    );
    if sent == "application/json" {
        let found = problems(description, &content["schema"], &answer.json());
        assert!(found.is_empty(), "{address}: {found:#?}");
    }
    for (name, _header) in response["headers"].as_object().into_iter().flatten() {
        // What a product covers is told only where another instant is shown than was asked for; where heights end, only
        // where there are any.
        let is_there = !answer.header(name).is_empty() || OFTEN_ABSENT.contains(&name.as_str());
        assert!(
            is_there || status == "503" || status == "504",
            "{address}: no {name}"
        );
    }
}

#[tokio::test]
async fn the_committed_description_is_what_the_server_says() {
    let app = TestApp::new().await;
    let said = app.get("/api/openapi.json").await.text();
    if std::env::var_os("BLESS").is_some() {
        std::fs::write(COMMITTED, &said).unwrap();
    }
    let committed = std::fs::read_to_string(Path::new(COMMITTED)).unwrap_or_default();
    let differs = committed
        .lines()
        .zip(said.lines())
        .position(|(a, b)| a != b);
    assert!(
        committed == said,
        "openapi.json is not what the server says, from line {}: `make describe` writes it anew, and the \
         viewer's types",
        differs.unwrap_or_default() + 1
    );
}

/// A path whose parts that differ from request to request are stars.
fn shape(path: &str) -> String {
    let star = |part: &str| {
        if part.contains('{') {
            "*".to_owned()
        } else {
            part.to_owned()
        }
    };
    path.split('/').map(star).collect::<Vec<_>>().join("/")
}

#[tokio::test]
async fn every_route_is_described_and_nothing_else() {
    let routes: BTreeSet<String> = ROUTER
        .split(".route(")
        .skip(1)
        .filter_map(|rest| rest.split('"').nth(1))
        .map(shape)
        .collect();
    assert!(routes.len() > 15, "{routes:?}");
    let description = described().await;
    let paths = description["paths"].as_object().unwrap();
    let described: BTreeSet<String> = paths.keys().map(|path| shape(path)).collect();
    assert_eq!(described, routes);
}

#[tokio::test]
async fn every_answer_is_as_described() {
    let app = rich().await;
    let description = described().await;
    let mut unasked: BTreeSet<&str> = description["paths"]
        .as_object()
        .unwrap()
        .keys()
        .map(String::as_str)
        .collect();
    for (path, address) in ASKED {
        unasked.remove(path);
        let answer = app.get(address).await;
        assert_eq!(
            answer.status,
            StatusCode::OK,
            "{address}: {}",
            answer.text()
        );
        hold(&description, path, address, &answer);
    }
    assert_eq!(unasked, BTreeSet::from([ENDLESS, SWITCHING]));
    let nothing = TestApp::empty(|_settings| {});
    for (path, address) in [
        ("/api/check", "/api/check"),
        ("/api/products", "/api/products"),
    ] {
        hold(&description, path, address, &nothing.get(address).await);
    }
}

/// Addresses that take a geometry, a question to each, and what is sent along.
const SENT: [(&str, &str, &str); 8] = [
    ("area", "sst/area", SQUARE),
    ("line", "sst/line", TRACK),
    ("analysis", "sst/analysis?parts=trend", TRACK),
    ("correlation", "sst/correlation?with=flux", TRACK),
    ("difference", "sst/difference?minus=flux", SQUARE),
    ("hovmoller", "sst/hovmoller?along=lat", SQUARE),
    ("budget", "flux/budget", SQUARE),
    ("budget/history", "flux/budget/history", SQUARE),
];

#[tokio::test]
async fn what_takes_a_geometry_is_described_and_answers_so() {
    let app = rich().await;
    let description = described().await;
    let paths = description["paths"].as_object().unwrap();
    let takes = paths
        .iter()
        .filter(|(_path, item)| item["post"].is_object());
    let takes: BTreeSet<&str> = takes.map(|(path, _item)| path.as_str()).collect();
    let sent = SENT.map(|(name, ..)| format!("/api/products/{{product}}/{name}"));
    assert_eq!(takes, sent.iter().map(String::as_str).collect());
    for (name, address, geometry) in SENT {
        let item = &paths[&format!("/api/products/{{product}}/{name}")];
        let operation = &item["post"];
        let types = operation["requestBody"]["content"].as_object().unwrap();
        let types: Vec<&str> = types.keys().map(String::as_str).collect();
        assert_eq!(
            types,
            ["application/geo+json", "application/json"],
            "{name}"
        );
        let named = |item: &Value| -> BTreeSet<String> {
            let parameters = item["parameters"].as_array().unwrap().iter();
            parameters
                .map(|one| one["name"].as_str().unwrap().to_owned())
                .collect()
        };
        // Of a budget the parts may be sent along, and the region stand in the address.
        let (by_get, by_post) = (named(&item["get"]), named(operation));
        let left_out: Vec<_> = by_get.difference(&by_post).map(String::as_str).collect();
        let wanted: &[&str] = match name {
            "area" | "hovmoller" => &["region"],
            "line" => &["line"],
            "budget" | "budget/history" => &[],
            _ => &["lat", "line", "lon", "region"],
        };
        assert_eq!(left_out, wanted, "{name}");
        let mut untyped = post(address, geometry);
        untyped.headers_mut().remove("content-type");
        let mut large = post(address, geometry);
        let length = u64::MAX.into();
        large.headers_mut().insert("content-length", length);
        let answer = app.send(post(address, geometry)).await;
        let mut again = post(address, geometry);
        let tag = answer.headers["etag"].clone();
        again.headers_mut().insert("if-none-match", tag);
        for (request, status) in [
            (post(address, geometry), 200),
            (post(address, "{}"), 400),
            (again, 412),
            (large, 413),
            (untyped, 415),
        ] {
            let answer = app.send(request).await;
            assert_eq!(answer.status.as_u16(), status, "{name}: {}", answer.text());
            hold_to(&description, operation, address, &answer);
        }
    }
}

#[tokio::test]
async fn what_viewers_are_told_is_as_described() {
    let app = TestApp::new().await;
    let mut viewer = Viewer::new(&app, None).await;
    let manifest = app.land("sst", Quantity::SeaSurfaceTemperature, 2).await;
    let touched = Period::month(2000, 3).unwrap();
    app.state.news.tell(manifest, vec![touched]);
    let told = viewer.next().await.unwrap();
    let description = described().await;
    let answer = &operation(&description, ENDLESS)["responses"]["200"];
    let schema = &answer["content"]["text/event-stream"]["schema"];
    assert_eq!(
        problems(&description, schema, &told.data),
        Vec::<String>::new()
    );
}

#[tokio::test]
async fn what_answers_that_a_copy_is_right_is_described_so_and_nothing_else_is() {
    let app = rich().await;
    let description = described().await;
    let mut count = 0;
    for (path, address) in ASKED {
        let tag = app.get(address).await.header("etag").to_owned();
        let again = app.get_with(address, &[("if-none-match", &tag)]).await;
        let is_right = again.status == StatusCode::NOT_MODIFIED;
        let said = &operation(&description, path)["responses"]["304"];
        assert_eq!(is_right, said.is_object(), "{address}: {}", again.status);
        count += usize::from(is_right);
    }
    assert!(count > 15, "{count}");
}

#[tokio::test]
async fn every_refusal_is_as_described() {
    let app = rich().await;
    let description = described().await;
    let refused = [
        (
            "/tiles/{product}/{mode}/{z}/{x}/{y}.png",
            "/tiles/flux/volume/99/0/0.png",
        ),
        (
            "/tiles/{product}/{mode}/{z}/{x}/{y}.png",
            "/tiles/none/volume/0/0/0.png",
        ),
        ("/tiles/{product}/{mode}.json", "/tiles/flux/none.json"),
        ("/globe/{product}/{mode}.png", "/globe/flux/map.png?width=0"),
        (
            "/api/products/{product}/point",
            "/api/products/flux/point?lon=0",
        ),
        (
            "/api/products/{product}/point",
            "/api/products/flux/point?lon=0&lat=89",
        ),
        ("/api/products/{product}/area", "/api/products/flux/area"),
        ("/api/products/{product}/budget", "/api/products/sst/budget"),
        (
            "/api/observations/{dataset}/{platform}",
            "/api/observations/buoys/51001?limit=0",
        ),
    ];
    for (path, address) in refused {
        let answer = app.get(address).await;
        assert!(
            answer.status.is_client_error(),
            "{address}: {}",
            answer.status
        );
        hold(&description, path, address, &answer);
    }
    let without = TestApp::new().await;
    let path = "/api/observations/platforms";
    hold(&description, path, path, &without.get(path).await);
    let busy = Mood::fails(tile_server::backend::Class::Busy, "later");
    app.analyst.set(busy);
    let path = "/api/products/{product}/budget";
    let address = "/api/products/flux/budget?region=0,0,10,10";
    let answer = app.get(address).await;
    assert_eq!(answer.status, StatusCode::SERVICE_UNAVAILABLE);
    assert_ne!(answer.header("retry-after"), "");
    hold(&description, path, address, &answer);
}

/// A parameter that no handler reads would be taken in silence, whatever its value.
#[tokio::test]
async fn every_parameter_that_is_described_is_read() {
    let app = rich().await;
    let description = described().await;
    let mut refused: BTreeMap<&str, u32> = BTreeMap::new();
    for (path, address) in ASKED {
        let parameters = operation(&description, path)["parameters"].as_array();
        for parameter in parameters.into_iter().flatten() {
            let name = parameter["name"].as_str().unwrap();
            if parameter["in"] != "query" || FREE_TEXT.contains(&name) {
                continue;
            }
            let (address, query) = address.split_once('?').unwrap_or((address, ""));
            let others = query.split('&').filter(|one| !one.is_empty());
            let others = others.filter(|one| one.split('=').next() != Some(name));
            let query: Vec<String> = others
                .map(str::to_owned)
                .chain([format!("{name}=%01nonsense")])
                .collect();
            let address = format!("{address}?{}", query.join("&"));
            let answer = app.get(&address).await;
            assert!(
                answer.status.is_client_error(),
                "{address}: {}",
                answer.status
            );
            *refused.entry(name).or_default() += 1;
        }
    }
    assert!(refused.len() > 25, "{refused:?}");
    assert!(
        refused["time"] >= 3 && refused["palette"] >= 5,
        "{refused:?}"
    );
}

#[test]
fn what_is_not_as_described_is_found() {
    let description = json!({"components": {"schemas": {
        "Word": {"type": "string", "enum": ["a", "b"]},
        "Base": {"type": "object", "required": ["x"], "properties": {"x": {"type": "number"}}},
    }}});
    let schema = json!({"allOf": [
        {"$ref": "#/components/schemas/Base"},
        {"type": "object", "required": ["word", "maybe"], "properties": {
            "word": {"$ref": "#/components/schemas/Word"},
            "maybe": {"type": ["integer", "null"]},
            "pair": {"type": "array", "items": false, "prefixItems": [{"type": "number"}, {"type": "string"}]},
        }},
    ]});
    let of = |value: Value| problems(&description, &schema, &value);
    let right = json!({"x": 1.5, "word": "a", "maybe": null, "pair": [1, "b"]});
    assert_eq!(of(right.clone()), Vec::<String>::new());
    let wrong = [
        ("x", json!("1")),
        ("x", json!(null)),
        ("word", json!("c")),
        ("maybe", json!(1.5)),
        ("pair", json!([1])),
        ("pair", json!([1, "b", 2])),
        ("pair", json!(["b", 1])),
        ("unknown", json!(1)),
    ];
    for (name, value) in wrong {
        let mut answer = right.clone();
        answer[name] = value.clone();
        assert!(!of(answer).is_empty(), "{name}: {value}");
    }
    for name in ["x", "word", "maybe"] {
        let mut answer = right.clone();
        answer.as_object_mut().unwrap().remove(name);
        assert!(!of(answer).is_empty(), "without {name}");
    }
}
