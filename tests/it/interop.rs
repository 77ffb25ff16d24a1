//! Products as others read them, in a folder and in a bucket of a real S3 server: xarray over plain Zarr, and Icechunk over the store itself.
//! Values, times, bounds and places are those of the source file to the last bit, and coarser levels what numpy makes of them.

use std::path::Path;
use std::process::Command;

use harness::program;
use harness::servers::Servers;
use serde_json::Value;

/// A run of the script with what reaches the server: what it printed, or what it found otherwise.
fn script(servers: &Servers, words: &[&str]) -> Result<String, String> {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/reference/interop.py");
    let run = Command::new(test_data::interop_python())
        .args(["-B", script])
        .args(words)
        .envs(servers.settings().iter().cloned())
        .output()
        .unwrap();
    if run.status.success() {
        Ok(String::from_utf8(run.stdout).unwrap())
    } else {
        Err(String::from_utf8_lossy(&run.stderr).into_owned())
    }
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
    script(&servers, &["make", &file]).unwrap();
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
    let compare = |places: &[&str]| script(&servers, &[&["compare", &file], places].concat());
    let all: Vec<&str> = places.iter().map(String::as_str).collect();
    let told: Value = serde_json::from_str(&compare(&all).unwrap()).unwrap();
    for place in &places {
        let told = &told[place];
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
        if place.starts_with("icechunk:") {
            assert_eq!(levels.len(), 2, "{place}: {told}");
            assert!(levels[0] > 150_000 && levels[1] > 10_000, "{place}: {told}");
        }
    }
    // The comparison sees one step in the place of another, and one value of three million.
    let chunk = |step: u32| format!("{zarr}/sea_surface_temperature/c/{step}/0/0");
    std::fs::copy(chunk(1), chunk(2)).unwrap();
    let error = compare(&all[..1]).unwrap_err();
    assert!(error.contains("step 2: other"), "{error}");
    let changed = path("changed.nc");
    script(&servers, &["make", &changed, "one"]).unwrap();
    for place in &all[1..] {
        let error = script(&servers, &["compare", &changed, place]).unwrap_err();
        assert!(error.contains("step 1: 1 other values"), "{place}: {error}");
    }
}
