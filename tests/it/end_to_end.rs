//! The main job on the real files: fetch, land, integrate, derive, draw, serve; the numbers against published ones.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use contract::time::TimeMs;
use harness::program;
use harness::server::Server;
use serde_json::Value;

/// A data folder in which the demo has run, once for all tests of this program.
pub(crate) fn demo_data() -> &'static Path {
    static DATA: OnceLock<PathBuf> = OnceLock::new();
    DATA.get_or_init(|| {
        let data = tempfile::tempdir().unwrap().keep();
        // The demo keeps what it fetched in the folder `files` of its cache.
        let cache = tempfile::tempdir().unwrap().keep();
        std::os::unix::fs::symlink(test_data::fluxengine(""), cache.join("files")).unwrap();
        program::succeed(
            &data,
            &[
                "demo",
                "--exit-after-check",
                "--offline",
                "--cache",
                cache.to_str().unwrap(),
                "--listen",
                "127.0.0.1:0",
            ],
        )
        .unwrap();
        data
    })
}

fn budget(data: &Path, words: &[&str]) -> Value {
    let start = ["budget", "--product", "takahashi09-flux", "--json"];
    program::json(data, &[&start, words].concat()).unwrap()
}

/// The budget of each row, Tg C.
fn rows(answer: &Value) -> Vec<f64> {
    let rows = answer["rows"].as_array().unwrap();
    rows.iter()
        .map(|row| row["budget_tg"].as_f64().unwrap())
        .collect()
}

fn total_pg(data: &Path, words: &[&str]) -> f64 {
    let rows = rows(&budget(data, words));
    assert_eq!(rows.len(), 1);
    rows[0] / 1000.0
}

#[test]
fn the_global_budget_is_the_published_one_on_both_earths() {
    let data = demo_data();
    // What the grid itself integrates to (docs/data-sources.md), within 0.2 %.
    let ellipsoid = total_pg(data, &[]);
    assert!((ellipsoid / -1.404 - 1.0).abs() < 0.002, "{ellipsoid}");
    let sphere = total_pg(data, &["--earth", "sphere"]);
    assert!((sphere / -1.398 - 1.0).abs() < 0.002, "{sphere}");
    assert!(ellipsoid < sphere, "the two earths must differ");
}

#[test]
fn a_place_without_data_and_a_folder_without_objects_are_told_to_be_so() {
    let said = |data: &Path, words: &[&str]| {
        let output = program::run(data, words).unwrap();
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stderr).unwrap()
    };
    let at = |lon: &str, lat: &str, more: &[&str]| {
        let point = [
            "stats",
            "point",
            "--product",
            "takahashi09-flux",
            "--lon",
            lon,
            "--lat",
            lat,
        ];
        said(demo_data(), &[&point, more].concat())
    };
    // Poland, the series and statistics of it; and the Pacific.
    for more in [&[][..], &["--step", "year"]] {
        let land = at("20", "50", more);
        assert!(land.contains("no step holds data at this place"), "{land}");
        let sea = at("-150", "0", more);
        assert!(!sea.contains("no step holds data"), "{sea}");
    }
    assert!(at("-150", "0", &[]).contains("149.5° W, 0.5° S"));
    let empty = tempfile::tempdir().unwrap();
    let verified = said(empty.path(), &["verify"]);
    assert!(verified.contains("nothing is stored there"), "{verified}");
}

#[test]
fn the_error_of_filled_gaps_is_told_by_hiding_data() {
    let data = demo_data();
    let words = [
        "products",
        "fill-error",
        "--product",
        "takahashi09-flux",
        "--steps",
        "2",
    ];
    let picture = data.join("fill-error.png");
    let more = [
        "--gap-cells",
        "1,4",
        "--json",
        "--picture",
        picture.to_str().unwrap(),
    ];
    let report = program::json(data, &[&words[..], &more].concat()).unwrap();
    assert_eq!(report["steps"].as_array().unwrap().len(), 4);
    let number = |row: &Value, name: &str| row[name].as_f64().unwrap();
    for row in report["all"].as_array().unwrap() {
        assert!(number(row, "hidden_cells") > 5000.0);
        assert!(number(row, "rmse") < 0.4 * number(row, "spread"), "{row}");
        assert!(
            number(row, "bias").abs() < 0.2 * number(row, "rmse"),
            "{row}"
        );
        assert!(number(row, "within_two_sigma") > 0.95, "{row}");
    }
    assert!(std::fs::read(&picture).unwrap().starts_with(b"\x89PNG"));
    let all_hidden = program::fail(data, &[&words[..], &["--share", "1"]].concat()).unwrap();
    assert!(all_hidden.contains("below 1"), "{all_hidden}");
}

#[test]
fn the_bands_are_within_five_thousandths_of_a_petagram() {
    let data = demo_data();
    let bands = [
        ("14n-50n", -0.694),
        ("14s-50s", -1.021),
        ("50s-62s", -0.066),
        ("equatorial-pacific", 0.466),
    ];
    for (region, expected) in bands {
        let ours = total_pg(data, &["--region", region]);
        assert!(
            (ours - expected).abs() < 0.005,
            "{region}: {ours}, expected {expected}"
        );
    }
}

#[test]
fn the_months_are_within_half_a_percent() {
    const MONTHS_TG: [f64; 12] = [
        -176.1, -155.7, -141.5, -128.6, -125.7, -101.7, -52.3, -31.0, -36.1, -99.5, -160.4, -195.8,
    ];
    let data = demo_data();
    let months = rows(&budget(data, &["--step", "month"]));
    assert_eq!(months.len(), 12);
    for (month, (ours, expected)) in months.iter().zip(MONTHS_TG).enumerate() {
        assert!(
            (ours / expected - 1.0).abs() < 0.005,
            "month {}: {ours}, expected {expected}",
            month + 1
        );
    }
}

#[test]
fn any_number_of_partitions_gives_the_same_bits() {
    let data = demo_data();
    let words = |partitions| {
        [
            "--step",
            "month",
            "--region",
            "-60,-33.3,47.7,61.2",
            "--partitions",
            partitions,
        ]
    };
    let answers =
        ["1", "3", "16"].map(|partitions| budget(data, &words(partitions))["rows"].to_string());
    assert!(answers[0].contains("budget_kg"));
    assert_eq!(answers[0], answers[1]);
    assert_eq!(answers[0], answers[2]);
}

#[test]
fn the_mean_over_a_region_times_its_area_is_its_budget() {
    const SECONDS_PER_YEAR: f64 = 365.25 * 86_400.0;
    const G_PER_TG: f64 = 1e12;
    let data = demo_data();
    let words = ["stats", "polygon", "--product", "takahashi09-flux"];
    let region = ["--region", "14n-50n", "--json"];
    let means = program::json(data, &[&words[..], &region].concat()).unwrap();
    assert_eq!(means["unit"], "g C m⁻² yr⁻¹");
    let steps = means["series"].as_array().unwrap();
    let months = budget(data, &["--region", "14n-50n", "--step", "month"]);
    let months = months["rows"].as_array().unwrap();
    assert_eq!((steps.len(), months.len()), (12, 12));
    let number = |row: &Value, name: &str| row[name].as_f64().unwrap();
    let ms = |row: &Value, name: &str| {
        let time: TimeMs = row[name].as_str().unwrap().parse().unwrap();
        time.ms() as f64
    };
    for (step, month) in steps.iter().zip(months) {
        let share = number(step, "coverage_percent");
        assert!(share > 20.0 && share < 95.0, "land and gaps: {share}");
        let seconds = (ms(step, "end") - ms(step, "start")) / 1000.0;
        let mass_g = number(step, "mean") * number(step, "area_m2") * seconds / SECONDS_PER_YEAR;
        let expected = number(month, "budget_tg") * G_PER_TG;
        assert!((mass_g / expected - 1.0).abs() < 1e-9, "{step} {month}");
    }
    let first = program::json(data, &[&words[..], &region, &["--to", "2000-02"]].concat());
    assert_eq!(first.unwrap()["series"].as_array().unwrap().len(), 1);
    for (region, reason) in [
        ("atlantis", "atlantis"),
        ("0,10,10,0", "latitudes"),
        ("a.json", "a.json"),
    ] {
        let refused = program::fail(data, &[&words[..], &["--region", region]].concat()).unwrap();
        assert!(refused.contains(reason), "{refused}");
    }
}

#[test]
fn a_region_and_the_rest_of_the_globe_make_the_globe() {
    let data = demo_data();
    let across_the_date_line = total_pg(data, &["--region", "150,-90,-110,90"]);
    let the_rest = total_pg(data, &["--region", "-110,-90,150,90"]);
    let globe = total_pg(data, &[]);
    assert!(((across_the_date_line + the_rest) / globe - 1.0).abs() < 1e-9);
}

#[test]
fn a_geojson_file_is_a_region() {
    let data = demo_data();
    let file = data.join("box.geojson");
    let corners = "[[-60,-20],[0,-20],[0,30],[-60,30],[-60,-20]]";
    std::fs::write(
        &file,
        format!(r#"{{"type":"Polygon","coordinates":[{corners}]}}"#),
    )
    .unwrap();
    let polygon = total_pg(data, &["--region", file.to_str().unwrap()]);
    let boxed = total_pg(data, &["--region", "-60,-20,0,30"]);
    assert!((polygon / boxed - 1.0).abs() < 1e-9, "{polygon} {boxed}");
}

#[test]
fn the_series_at_a_place_is_what_the_file_holds() {
    let data = demo_data();
    let place = ["--lon", "-150.5", "--lat", "0.5", "--json"];
    let words = [
        &["stats", "point", "--product", "takahashi09-flux"],
        &place[..],
    ]
    .concat();
    let answer = program::json(data, &words).unwrap();
    let series = answer["series"].as_array().unwrap();
    assert_eq!(series.len(), 12);
    // The equatorial Pacific gives off carbon in every month.
    assert!(
        series
            .iter()
            .all(|step| step["value"].as_f64().unwrap() > 0.0),
        "{answer}"
    );
}

#[test]
fn a_second_start_lands_nothing_anew() {
    let data = demo_data();
    let before = program::json(data, &["products", "--json"]).unwrap();
    let server = Server::start(data, &["demo", "--offline"]).unwrap();
    assert_eq!(server.get("/").unwrap().status, 200);
    let after = program::json(data, &["products", "--json"]).unwrap();
    assert_eq!(after, before);
}

#[test]
fn the_server_tells_what_was_computed() {
    let data = demo_data();
    let server = Server::start(data, &["serve"]).unwrap();
    let products = server.get("/api/products").unwrap().json().unwrap();
    let ids: Vec<_> = products["products"]
        .as_array()
        .unwrap()
        .iter()
        .map(|p| p["product"].as_str().unwrap())
        .collect();
    for id in [
        "takahashi09-flux",
        "sst-2010",
        "chlorophyll-2010",
        "wind-2010",
    ] {
        assert!(ids.contains(&id), "{ids:?}");
    }
    let over_http = server
        .get("/api/products/takahashi09-flux/budget?step=month")
        .unwrap()
        .json()
        .unwrap();
    let over_http = over_http["rows"]
        .as_array()
        .unwrap()
        .iter()
        .map(|row| row["budget_tg"].as_f64().unwrap());
    assert_eq!(
        over_http.collect::<Vec<_>>(),
        rows(&budget(data, &["--step", "month"]))
    );
    let check = server.get("/api/check").unwrap().json().unwrap();
    assert!(check["rows"].as_array().unwrap().len() >= 17, "{check}");
}

#[test]
fn tiles_are_drawn_once_and_are_the_same_from_the_command_line() {
    let data = demo_data();
    let server = Server::start(data, &["serve"]).unwrap();
    for mode in ["map", "points", "sprites", "volume"] {
        let path = format!("/tiles/takahashi09-flux/{mode}/2/0/1.png?time=2000-05-03T04:05:06Z");
        let tile = server.get(&path).unwrap();
        assert_eq!(
            (tile.status, tile.content_type.as_str()),
            (200, "image/png"),
            "{mode}: {}",
            tile.text()
        );
        let picture = image::load_from_memory(&tile.body).unwrap().to_rgba8();
        assert!(
            picture.pixels().any(|pixel| pixel[3] > 0),
            "{mode} is empty"
        );
        assert_eq!(server.get(&path).unwrap().body, tile.body);
        let file = data.join(format!("{mode}.png"));
        let words = [
            "render",
            "tile",
            "--layer",
            "takahashi09-flux",
            "--mode",
            mode,
            "--z",
            "2",
            "--x",
            "0",
            "--y",
            "1",
        ];
        let rest = [
            "--time",
            "2000-05-03T04:05:06Z",
            "-o",
            file.to_str().unwrap(),
        ];
        program::succeed(data, &[&words[..], &rest].concat()).unwrap();
        assert_eq!(std::fs::read(&file).unwrap(), tile.body, "{mode}");
    }
}

#[test]
fn without_a_network_the_demo_runs_on_synthetic_data_and_says_so() {
    let data = tempfile::tempdir().unwrap();
    let cache = tempfile::tempdir().unwrap();
    let words = [
        "demo",
        "--exit-after-check",
        "--offline",
        "--cache",
        cache.path().to_str().unwrap(),
        "--listen",
        "127.0.0.1:0",
    ];
    let output = program::run(data.path(), &words).unwrap();
    let talk = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{talk}");
    assert!(talk.contains("SYNTHETIC"), "{talk}");
    let server = Server::start(data.path(), &["serve"]).unwrap();
    let products = server.get("/api/products").unwrap().json().unwrap();
    assert!(
        products["products"]
            .as_array()
            .unwrap()
            .iter()
            .all(|p| p["synthetic"] == true),
        "{products}"
    );
}

#[test]
fn the_program_tells_its_version_and_those_of_what_it_exchanges() {
    let data = tempfile::tempdir().unwrap();
    let text = program::succeed(data.path(), &["--version"]).unwrap();
    let expected = format!("fluxglobe {} (events ", env!("CARGO_PKG_VERSION"));
    assert!(text.starts_with(&expected), "{text}");
    for what in ["events", "manifests", "renderer"] {
        let number = text.split_once(what).unwrap().1.trim_start();
        assert!(number.starts_with(|c: char| c.is_ascii_digit()), "{text}");
    }
    let service = program::succeed(data.path(), &["ingestd", "--version"]).unwrap();
    assert!(service.contains("(events "), "{service}");
}
