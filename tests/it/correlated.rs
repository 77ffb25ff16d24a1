//! Maps of how two products go together in each cell: landed files in, maps out that the program's other commands read.

use std::path::Path;

use harness::{granule, program};
use serde_json::Value;

/// A cell whose flux changes its sign with the season.
const PLACE: &str = "62.5,32.5";
const ALL: &str = "correlation,correlation-p-value,correlation-pairs,correlation-effective-pairs";

fn succeed(data: &Path, words: &str) -> String {
    let words: Vec<&str> = words.split(' ').collect();
    program::succeed(data, &words).unwrap()
}

fn json(data: &Path, words: &str) -> Value {
    serde_json::from_str(&succeed(data, &format!("{words} --json"))).unwrap()
}

fn land(data: &Path, months: std::ops::Range<usize>, edition: usize) {
    for month in months {
        let file = granule::write(data, month, edition).unwrap();
        let file = file.to_str().unwrap();
        succeed(data, &format!("ingest {file} --product flux"));
    }
}

/// The flux without its sign: a product of its own on the same grid.
fn derive_size(data: &Path) {
    succeed(
        data,
        "derive --name size --quantity carbon_flux --input f=flux --expr abs(f)",
    );
}

/// The newest versions of the maps, as they were printed.
fn derive_maps(data: &Path, more: &str) -> Vec<String> {
    let words = format!("derive statistic --product flux --with size --statistic {ALL}{more}");
    succeed(data, &words).lines().map(str::to_owned).collect()
}

/// What a map holds in a cell.
fn value(data: &Path, product: &str) -> Option<f64> {
    let (lon, lat) = PLACE.split_once(',').unwrap();
    let point = format!("stats point --product {product} --lon {lon} --lat {lat}");
    let answer = json(data, &point);
    let steps = answer["series"].as_array().unwrap();
    assert_eq!(steps.len(), 1, "{answer}");
    steps[0]["value"].as_f64()
}

/// Each map holds what the two series of that cell say.
fn compare(data: &Path, names: &[&str; 4]) {
    let series = format!("stats correlate --product flux --product size --at {PLACE}");
    let answer = json(data, &series);
    let row = &answer["rows"][0];
    assert_eq!(row["lag_steps"], 0, "{answer}");
    let said = ["correlation", "p_value", "count", "effective_count"];
    for (name, said) in names.iter().zip(said) {
        let (found, right) = (value(data, name).unwrap(), row[said].as_f64().unwrap());
        assert!(
            (found - right).abs() <= 1e-6 * right.abs().max(1e-6),
            "{name}: {found}, {right} in its series"
        );
    }
    let r = row["correlation"].as_f64().unwrap();
    assert!(
        r.abs() > 0.01 && r.abs() < 0.99,
        "a cell that says little: {r}"
    );
}

#[test]
fn maps_of_two_products_hold_what_series_say_and_are_made_anew_when_one_changes() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path();
    land(data, 0..12, 0);
    derive_size(data);
    let names = [
        "flux-correlation-size",
        "flux-correlation-p-value-size",
        "flux-correlation-pairs-size",
        "flux-correlation-effective-pairs-size",
    ];
    let first = derive_maps(data, "");
    for (printed, name) in first.iter().zip(names) {
        assert!(printed.starts_with(&format!("{name}@1-")), "{printed}");
    }
    assert_eq!(first.len(), names.len());
    assert_eq!(value(data, names[2]), Some(12.0));
    compare(data, &names);
    // The same again is the same; a map is listed, and has no unit.
    assert_eq!(derive_maps(data, ""), first);
    let listed = json(data, "products");
    let listed = listed.as_array().unwrap().iter();
    let map = listed.clone().find(|it| it["product"] == names[0]).unwrap();
    assert_eq!(
        (&map["manifest"], &map["unit"]),
        (&first[0].as_str().into(), &"".into())
    );
    let lagged = derive_maps(data, " --name lagged --lag=-2 --once");
    assert!(lagged[0].starts_with("lagged-correlation@1-"), "{lagged:?}");
    // A month more of one of them is no month of both; then it is.
    land(data, 12..13, 1);
    let second = derive_maps(data, "");
    assert!(
        second[2].starts_with(&format!("{}@2-", names[2])),
        "{second:?}"
    );
    assert_eq!(value(data, names[2]), Some(12.0));
    derive_size(data);
    let third = derive_maps(data, "");
    assert!(
        third[0].starts_with(&format!("{}@3-", names[0])),
        "{third:?}"
    );
    assert_eq!(value(data, names[2]), Some(13.0));
    compare(data, &names);
    // What cannot be: the second product is missing, or lies on no such grid.
    let words = "derive statistic --product flux --statistic correlation";
    let refused = program::fail(data, &words.split(' ').collect::<Vec<_>>()).unwrap();
    assert!(refused.contains("--with"), "{refused}");
}
