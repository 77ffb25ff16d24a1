//! Masks, their codes and what these mean, and versions by their number: on the command line and over HTTP.

use std::path::Path;

use harness::server::Server;
use harness::{granule, mask, program};
use serde_json::{Value, json};

fn words(text: &str) -> Vec<&str> {
    text.split_whitespace().collect()
}

fn land(data: &Path, file: &Path, product: &str) -> String {
    let words = ["ingest", file.to_str().unwrap(), "--product", product];
    program::succeed(data, &words).unwrap()
}

/// A flux of five versions and a mask on another grid.
fn landed() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path();
    for (month, edition) in [(0, 0), (1, 0), (2, 0), (3, 0), (3, 1)] {
        land(data, &granule::write(data, month, edition).unwrap(), "flux");
    }
    let file = mask::write(data, "basins", Some("north nowhere south")).unwrap();
    land(data, &file, "basins");
    folder
}

#[test]
fn a_code_of_a_mask_is_a_region_by_its_number_and_by_what_it_means() {
    let folder = landed();
    let data = folder.path();
    let server = Server::start(data, &["serve"]).unwrap();
    for (command, path) in [
        ("budget --product flux --step month", "budget?step=month"),
        ("budget --product flux --history", "budget/history?"),
        ("stats polygon --product flux", "area?"),
        (
            "stats polygon --product flux --statistic mean,p90 --step total",
            "area?statistic=mean,p90&step=total",
        ),
        (
            "stats polygon --product flux --extremes",
            "analysis?parts=extremes",
        ),
        (
            "stats correlate --product flux --product flux",
            "correlation?with=flux",
        ),
        (
            "stats difference --product flux --minus flux@1",
            "difference?minus=flux&minus_manifest=flux@1",
        ),
        (
            "stats hovmoller --product flux --along lon --band 30",
            "hovmoller?along=lon&band=30",
        ),
    ] {
        let of = |region: &str| {
            let words = [&words(command)[..], &["--region", region, "--json"]].concat();
            program::json(data, &words).unwrap()
        };
        let printed = of("basins:12");
        let text = printed.to_string();
        let name = ":12 (south)";
        assert!(text.contains("basins@1-") && text.contains(name), "{text}");
        assert_eq!(of("basins:south"), printed, "{command}");
        assert_eq!(of("basins@1:12"), printed, "{command}");
        assert_ne!(of("basins:north"), printed, "{command}");
        for region in ["basins:12", "basins%3Asouth", "basins@1:12.0"] {
            let path = format!("/api/products/flux/{path}&region={region}").replace("?&", "?");
            let served = server.get(&path).unwrap();
            assert_eq!(served.status, 200, "{path}: {}", served.text());
            assert_eq!(served.json().unwrap(), printed, "{path}");
        }
    }
    // A hemisphere is a hemisphere on any grid.
    let budget = |region: &str| -> f64 {
        let words = ["budget", "--product", "flux", "--json", "--region", region];
        let answer = program::json(data, &words).unwrap();
        answer["rows"][0]["budget_tg"].as_f64().unwrap()
    };
    let (cells, boxed) = (budget("basins:south"), budget("-180,-90,180,0"));
    // Rows of 4 degrees: the one over the equator is the south's.
    let with_row = budget("-180,-90,180,2");
    assert!(
        (cells - with_row).abs() < 1e-9 * with_row.abs(),
        "{cells} {with_row}"
    );
    assert!((cells - boxed).abs() > 1e-6, "{cells} {boxed}");
    refused(data, &server);
}

/// Masks and codes that are not there, on both sides.
fn refused(data: &Path, server: &Server) {
    for (region, status, wanted) in [
        ("basins:7", 400, "there are 1, 12"),
        ("basins:nowhere", 400, "there are 1, 12"),
        ("basins:atlantis", 400, "there are north, nowhere, south"),
        ("flux:1", 400, "a mask is one map"),
        ("nothing:1", 404, "nothing"),
        ("basins@9:1", 404, "basins"),
    ] {
        let words = ["budget", "--product", "flux", "--region", region];
        let printed = program::fail(data, &words).unwrap();
        let served = server.get(&format!("/api/products/flux/budget?region={region}"));
        let served = served.unwrap();
        assert_eq!(served.status, status, "{region}: {}", served.text());
        for text in [printed, served.text()] {
            assert!(text.contains(wanted), "{region}: {text}");
        }
    }
}

#[test]
fn what_codes_mean_is_told_wherever_the_mask_is() {
    let folder = landed();
    let data = folder.path();
    let flags = json!([
        {"value": 1, "meaning": "north"},
        {"value": 3, "meaning": "nowhere"},
        {"value": 12, "meaning": "south"},
    ]);
    let products = program::json(data, &["products", "--json"]).unwrap();
    let listed = |products: &Value| {
        let all = products.as_array().unwrap();
        let found = all.iter().find(|one| one["product"] == "basins").unwrap();
        found["quantity"]["flags"].clone()
    };
    assert_eq!(listed(&products), flags);
    let output = program::run(data, &["products"]).unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(
        said.contains("basins: codes 1 north, 3 nowhere, 12 south"),
        "{said}"
    );
    let server = Server::start(data, &["serve"]).unwrap();
    let served = server.get("/api/products").unwrap().json().unwrap();
    assert_eq!(listed(&served["products"]), flags);
    let array = server.get("/zarr/basins/basin/zarr.json").unwrap();
    let attributes = array.json().unwrap()["attributes"].clone();
    assert_eq!(attributes["flag_meanings"], "north nowhere south");
    assert_eq!(attributes["flag_values"], json!([1.0, 3.0, 12.0]));
    // A mask that tells too little, or what is none, lands without it and says so.
    for (name, meanings) in [
        ("short", "a b"),
        ("hostile", "a \u{7}b c"),
        ("twice", "a b a"),
    ] {
        let file = mask::write(data, name, Some(meanings)).unwrap();
        let words = ["ingest", file.to_str().unwrap()];
        let output = program::run(data, &words).unwrap();
        assert!(output.status.success());
        let said = [output.stdout, output.stderr].concat();
        let said = String::from_utf8(said).unwrap();
        assert!(said.contains("what its codes mean is left out"), "{said}");
    }
}

#[test]
fn statistics_and_budgets_are_of_the_version_that_is_named() {
    let folder = landed();
    let data = folder.path();
    let versions = ["3", "4"].map(|number| {
        let name = format!("flux@{number}");
        for command in [
            "stats point --lon 2 --lat 40 --product",
            "stats point --lon 2 --lat 40 --statistic mean --product",
            "stats point --lon 2 --lat 40 --extremes --product",
            "stats line --line 0,0;9,9 --product",
            "stats line --line 0,0;9,9 --extremes --product",
            "stats polygon --region 14n-50n --product",
            "stats polygon --region 14n-50n --statistic mean --product",
            "stats polygon --region 14n-50n --extremes --product",
            "stats hovmoller --along lat --product",
            "stats difference --region 14n-50n --minus flux@5 --product",
            "stats correlate --region 14n-50n --product flux --product",
            "budget --product",
        ] {
            let words = [&words(command)[..], &[&name, "--json"]].concat();
            let answer = program::json(data, &words).unwrap();
            let told = answer.to_string();
            let wanted = format!("\"manifest\":\"{name}-");
            assert!(told.contains(&wanted), "{command}: {told}");
        }
        let budget = ["budget", "--json", "--product", &name];
        program::json(data, &budget).unwrap()
    });
    assert_ne!(versions[0]["rows"], versions[1]["rows"]);
    let whole = versions[0]["manifest"].as_str().unwrap();
    let again = ["budget", "--json", "--product", whole];
    assert_eq!(program::json(data, &again).unwrap(), versions[0]);
    for name in [whole, "flux@3"] {
        let as_of = ["budget", "--json", "--product", "flux", "--as-of", name];
        assert_eq!(program::json(data, &as_of).unwrap(), versions[0], "{name}");
    }
    let difference = |more: &str| {
        let of = "stats difference --region 14n-50n --json --product";
        program::json(data, &[&words(of)[..], &words(more)].concat()).unwrap()
    };
    let wanted = difference("flux@4 --minus flux@3");
    for named in [
        "flux --manifest flux@4 --minus-manifest flux@3".to_owned(),
        format!("flux --manifest flux@4 --minus flux --minus-manifest {whole}"),
    ] {
        assert_eq!(difference(&named), wanted, "{named}");
    }
    for (command, wanted) in [
        ("budget --product flux@9", "no version 9"),
        ("budget --product flux@1-00000000", "not flux@1-00000000"),
        ("budget --product flux@x", "flux@x"),
        ("budget --product flux@1 --as-of 2100", "give one"),
        ("budget --product flux@1 --history", "of all versions"),
        ("budget --product flux --as-of flux@9", "no version 9"),
        (
            "budget --product flux --as-of flux@1-00000000",
            "not flux@1-00000000",
        ),
        ("budget --product flux --as-of sst@1", "is none of flux"),
        (
            "stats difference --region global --product flux --minus-manifest flux",
            "names no version",
        ),
        (
            "stats polygon --region global --product flux@9",
            "no version 9",
        ),
    ] {
        let refused = program::fail(data, &words(command)).unwrap();
        assert!(refused.contains(wanted), "{command}: {refused}");
    }
}

#[test]
fn a_budget_is_a_table_of_commas_too() {
    let folder = landed();
    let data = folder.path();
    let of = |more: &str| {
        let words = [&words("budget --product flux --csv")[..], &words(more)].concat();
        program::succeed(data, &words).unwrap()
    };
    let text = of("--regions basins --step month --error 20% --correlation-length-km 0");
    let mut lines = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let header = lines.next().unwrap();
    assert_eq!(
        header[..5],
        ["region", "start", "end", "budget_tg", "budget_kg"]
    );
    assert!(header.contains(&"sigma_tg"), "{text}");
    let rows: Vec<Vec<&str>> = lines.collect();
    assert!(rows.iter().all(|row| row.len() == header.len()), "{text}");
    let regions: Vec<&str> = rows.iter().map(|row| row[0]).collect();
    let is = |at: usize, end: &str| regions[at].ends_with(end);
    assert!(
        rows.len() == 12 && is(0, ":1 (north)") && is(7, ":12 (south)"),
        "{text}"
    );
    assert!(is(8, "global") && is(11, "global"), "{text}");
    let json = "budget --product flux --regions basins --step month --json";
    let answer = program::json(data, &words(json)).unwrap();
    for (at, row) in answer["rows"].as_array().unwrap().iter().enumerate() {
        assert_eq!(row["budget_kg"], rows[8 + at][4]);
        assert_eq!(row["budget_tg"].to_string(), rows[8 + at][3]);
        assert_eq!(row["start"], rows[8 + at][1]);
    }
    let history = of("--history");
    assert!(
        history.starts_with("manifest,published,changed,"),
        "{history}"
    );
    assert_eq!(history.lines().count(), 6, "{history}");
    let both = program::fail(data, &words("budget --product flux --csv --json")).unwrap();
    assert!(both.contains("--json"), "{both}");
}

#[test]
fn a_hostile_geometry_is_refused_on_the_command_line_as_over_http() {
    let folder = landed();
    let data = folder.path();
    let file = data.join("hostile.geojson");
    let tree = r#"{"":0},"#.repeat(1_700_000);
    let text = format!(r#"{{"type":"Point","coordinates":[0,0],"x":[{tree}0]}}"#);
    std::fs::write(&file, text).unwrap();
    let file = file.to_str().unwrap();
    for words in [
        ["budget", "--product", "flux", "--region", file],
        ["budget", "--product", "flux", "--regions", file],
        ["stats", "line", "--product=flux", "--line", file],
    ] {
        let said = program::fail(data, &words).unwrap();
        assert!(said.contains("besides coordinates"), "{said}");
    }
}
