//! Products as others read them, in a folder and in a bucket of a real S3 server: xarray over plain Zarr, and Icechunk over the store itself;
//! and zarrita, as pages do, at the address of a server. Values, times, bounds and places are those of the source file to the last bit,
//! coarser levels what numpy makes of them, and what is said of these what the multiscales convention asks for.

use std::path::Path;
use std::process::Command;

use harness::program;
use harness::server::Server;
use harness::servers::Servers;
use serde_json::{Value, json};

use crate::browser;

const INTEROP: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/reference/interop.py");
const MULTISCALES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/reference/multiscales.py");

/// A run of a script with what reaches servers: what it printed, or what it found otherwise.
fn python(script: &str, settings: &[(String, String)], words: &[&str]) -> Result<String, String> {
    let run = Command::new(test_data::interop_python())
        .args(["-B", script])
        .args(words)
        .envs(settings.iter().cloned())
        .output()
        .unwrap();
    if run.status.success() {
        Ok(String::from_utf8(run.stdout).unwrap())
    } else {
        Err(String::from_utf8_lossy(&run.stderr).into_owned())
    }
}

/// Did the comparison find all values of a place, and both levels where it has them?
fn assert_whole(told: &Value, place: &str) {
    assert!(
        told["values"].as_u64().unwrap() > 2_500_000,
        "{place}: {told}"
    );
    let levels: Vec<u64> = told["levels"]
        .as_array()
        .unwrap()
        .iter()
        .filter_map(Value::as_u64)
        .collect();
    if !place.starts_with("zarr:") {
        assert_eq!(levels.len(), 2, "{place}: {told}");
        assert!(levels[0] > 150_000 && levels[1] > 10_000, "{place}: {told}");
    }
}

/// A server of the product of a file that the script makes in a folder, and the file.
fn served(folder: &Path) -> (Server, String) {
    let file = folder.join("sst.nc").to_str().unwrap().to_owned();
    python(INTEROP, &[], &["make", &file]).unwrap();
    let data = folder.join("data");
    program::succeed(&data, &["ingest", &file]).unwrap();
    (Server::start(&data, &["serve"]).unwrap(), file)
}

/// Lands a file in a store, and exports what it became as plain Zarr.
fn landed(servers: &Servers, data: &Path, store: Option<&str>, (file, zarr): (&str, &str)) {
    for words in [
        &["ingest", file][..],
        &["export", "sst", "--to", "zarr", zarr],
    ] {
        let mut run = program::command(data);
        if let Some(store) = store {
            run.args(["--store", store]);
        }
        let run = run
            .args(words)
            .envs(servers.settings().iter().cloned())
            .output()
            .unwrap();
        let talk = String::from_utf8_lossy(&run.stderr);
        assert!(run.status.success(), "{words:?}: {talk}");
    }
}

#[test]
fn python_finds_values_times_places_and_levels_of_the_source_file_in_a_folder_and_in_a_bucket() {
    let servers = Servers::start(&["s3"]).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (file, zarr) = (path("sst.nc"), path("sst.zarr"));
    let script = |words: &[&str]| python(INTEROP, servers.settings(), words);
    script(&["make", &file]).unwrap();
    let bucket = "s3://fluxglobe/store";
    landed(&servers, &folder.path().join("here"), None, (&file, &zarr));
    landed(
        &servers,
        &folder.path().join("there"),
        Some(bucket),
        (&file, "s3://fluxglobe/copy.zarr"),
    );
    let places = [
        format!("zarr:{zarr}"),
        format!("icechunk:{}", path("here/objects/cubes/sst")),
        "zarr:s3://fluxglobe/copy.zarr".to_owned(),
        format!("icechunk:{bucket}/cubes/sst"),
    ];
    let compare = |places: &[&str]| script(&[&["compare", &file], places].concat());
    let all: Vec<&str> = places.iter().map(String::as_str).collect();
    let told: Value = serde_json::from_str(&compare(&all).unwrap()).unwrap();
    for place in &places {
        assert_whole(&told[place], place);
    }
    // The comparison sees one step in the place of another, and one value of three million.
    let chunk = |step: u32| format!("{zarr}/sea_surface_temperature/c/{step}/0/0");
    std::fs::copy(chunk(1), chunk(2)).unwrap();
    let error = compare(&all[..1]).unwrap_err();
    assert!(error.contains("step 2: other"), "{error}");
    let changed = path("changed.nc");
    script(&["make", &changed, "one"]).unwrap();
    for place in &all[1..] {
        let error = script(&["compare", &changed, place]).unwrap_err();
        assert!(error.contains("step 1: 1 other values"), "{place}: {error}");
    }
}

#[test]
fn zarrita_finds_values_times_places_and_levels_of_the_source_file_at_an_address() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (server, file) = served(folder.path());
    let read = path("read");
    browser::script("zarrita.mjs", &[&format!("{}/zarr/sst", server.url), &read]);
    let place = format!("zarrita:{read}");
    let compare = |file: &str| python(INTEROP, &[], &["compare", file, &place]);
    let told: Value = serde_json::from_str(&compare(&file).unwrap()).unwrap();
    assert_whole(&told[&place], &place);
    // The comparison sees one value of three million, a value of a level, and levels that do not lie where it is said.
    let changed = path("changed.nc");
    python(INTEROP, &[], &["make", &changed, "one"]).unwrap();
    let error = compare(&changed).unwrap_err();
    assert!(error.contains("step 1: 1 other values"), "{error}");
    let level = path("read/levels/2/sea_surface_temperature.bin");
    let whole = std::fs::read(&level).unwrap();
    std::fs::write(&level, [&whole[4..], &whole[..4]].concat()).unwrap();
    let error = compare(&file).unwrap_err();
    assert!(error.contains("levels/2"), "{error}");
    std::fs::write(&level, whole).unwrap();
    let groups = path("read/groups.json");
    let told = std::fs::read_to_string(&groups).unwrap();
    std::fs::write(&groups, told.replacen("1.5,1.5", "1.5,2", 1)).unwrap();
    let error = compare(&file).unwrap_err();
    assert!(error.contains("levels/1: lon is 0.0625"), "{error}");
}

#[test]
fn the_document_of_a_product_tells_of_its_levels_by_the_multiscales_convention() {
    let folder = tempfile::tempdir().unwrap();
    let (server, _file) = served(folder.path());
    let document = server.get("/zarr/sst/zarr.json").unwrap().json().unwrap();
    let path = folder.path().join("zarr.json");
    let checked = |document: &Value| {
        std::fs::write(&path, document.to_string()).unwrap();
        python(MULTISCALES, &[], &[path.to_str().unwrap()])
    };
    let assets: Value = serde_json::from_str(&checked(&document).unwrap()).unwrap();
    let expected = [
        "sea_surface_temperature",
        "levels/1/sea_surface_temperature",
        "levels/2/sea_surface_temperature",
    ];
    assert_eq!(assets, json!(expected));
    let declared = "zarr_conventions/0/schema_url";
    let before =
        "https://raw.githubusercontent.com/zarr-conventions/multiscales/refs/tags/v1/schema.json";
    for (place, value, reason) in [
        (declared, json!(before), "zarr_conventions"),
        ("multiscales/layout", json!([]), "multiscales.layout"),
        (
            "multiscales/layout/1/asset",
            json!("/levels/1"),
            "layout[1]",
        ),
        ("multiscales/layout/1/transform", json!({}), "layout[1]"),
        (
            "multiscales/layout/2/asset",
            json!("levels/3"),
            "levels/3 is no array",
        ),
        (
            "multiscales/layout/2/derived_from",
            json!("levels/2"),
            "not listed before",
        ),
        (
            "multiscales/layout/2/transform/scale/1",
            json!(2.0),
            "its scales lead from",
        ),
        (
            "multiscales/layout/1/transform/translation",
            json!([0.0]),
            "1 numbers for 3 dimensions",
        ),
    ] {
        let mut changed = document.clone();
        let at = changed.pointer_mut(&format!("/attributes/{place}"));
        *at.unwrap() = value;
        let error = checked(&changed).unwrap_err();
        assert!(error.contains(reason), "{place}: {error}");
    }
}
