//! Products that were exported, opened by others: xarray finds the values, times and places of the files they came from.

use std::collections::BTreeSet;
use std::ffi::{OsStr, OsString};
use std::path::Path;
use std::process::Command;

use harness::program;
use harness::server::Server;
use serde_json::Value;

use crate::end_to_end::demo_data;

/// What xarray finds in an exported product: what it compared, or what it found otherwise.
fn compared(cube: impl AsRef<OsStr>) -> Result<Value, String> {
    compared_by(&test_data::python(), cube)
}

fn compared_by(python: &Path, cube: impl AsRef<OsStr>) -> Result<Value, String> {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/reference/exported_cube.py");
    let run = Command::new(python)
        .arg(script)
        .arg(cube.as_ref())
        .arg(test_data::fluxengine("takahashi09"))
        .output()
        .unwrap();
    if run.status.success() {
        Ok(serde_json::from_slice(&run.stdout).unwrap())
    } else {
        Err(String::from_utf8_lossy(&run.stderr).into_owned())
    }
}

#[test]
fn xarray_finds_the_values_times_and_places_of_the_source_files() {
    let folder = tempfile::tempdir().unwrap();
    let cube = folder.path().join("flux.zarr");
    let words = ["export", "takahashi09-flux", "--to", "zarr", "--json"];
    let told = program::json(
        demo_data(),
        &[&words[..], &[cube.to_str().unwrap()]].concat(),
    );
    let told = told.unwrap();
    assert_eq!((&told["steps"], &told["rows"]), (&12.into(), &180.into()));
    let found = compared(&cube).unwrap();
    assert_eq!(found["steps"], 12);
    assert!(found["values"].as_u64().unwrap() > 400_000, "{found}");

    // The comparison sees one step in the place of another.
    let chunk = |step: u32| cube.join(format!("carbon_flux/c/{step}/0/0"));
    std::fs::copy(chunk(3), chunk(4)).unwrap();
    let error = compared(&cube).unwrap_err();
    assert!(
        error.contains("other values") || error.contains("other cells"),
        "{error}"
    );
    // And a bit that flipped is an error of the library, by its checksum, and no value.
    let mut flipped = std::fs::read(chunk(3)).unwrap();
    let middle = flipped.len() / 2;
    flipped[middle] ^= 1;
    std::fs::write(chunk(3), flipped).unwrap();
    let error = compared(&cube).unwrap_err();
    assert!(error.to_lowercase().contains("checksum"), "{error}");
}

/// Programs that do not read version 3, GDAL among them, find the same in version 2: in files and at the server's addresses.
#[test]
fn xarray_and_gdal_find_the_same_in_version_2() {
    let folder = tempfile::tempdir().unwrap();
    let cube = folder.path().join("flux.zarr");
    let path = cube.to_str().unwrap();
    let words = ["export", "takahashi09-flux", "--to", "zarr2", path];
    program::succeed(demo_data(), &words).unwrap();
    let server = Server::start(demo_data(), &["serve"]).unwrap();
    let address = format!("{}/zarr2/takahashi09-flux@1", server.url);
    for place in [
        path,
        &address,
        &format!("gdal:{path}"),
        &format!("gdal:{address}"),
    ] {
        let found = compared(place).unwrap();
        assert_eq!(found["steps"], 12, "{place}");
        assert!(
            found["values"].as_u64().unwrap() > 400_000,
            "{place}: {found}"
        );
    }
    // The comparison by GDAL sees one step in the place of another.
    std::fs::copy(
        cube.join("carbon_flux/3.0.0"),
        cube.join("carbon_flux/4.0.0"),
    )
    .unwrap();
    let error = compared(format!("gdal:{path}")).unwrap_err();
    assert!(
        error.contains("other values") || error.contains("other cells"),
        "{error}"
    );
}

#[test]
fn xarray_finds_the_same_over_http() {
    let server = Server::start(demo_data(), &["serve"]).unwrap();
    for product in ["takahashi09-flux", "takahashi09-flux@1"] {
        let address = format!("{}/zarr/{product}", server.url);
        let found = compared(address).unwrap();
        assert_eq!(found["steps"], 12);
        assert!(found["values"].as_u64().unwrap() > 400_000, "{found}");
    }
    // The comparison sees another product.
    let error = compared(format!("{}/zarr/takahashi09-flux-accumulated", server.url)).unwrap_err();
    assert!(error.contains("carbon_flux"), "{error}");
}

#[test]
fn icechunk_finds_the_same_in_the_store_itself_and_in_a_copy() {
    let python = test_data::interop_python();
    let folder = tempfile::tempdir().unwrap();
    let copy = folder.path().join("flux");
    let words = [
        "export",
        "takahashi09-flux",
        "--to",
        "icechunk",
        copy.to_str().unwrap(),
    ];
    program::succeed(demo_data(), &words).unwrap();
    let cubes = demo_data().join("objects/cubes");
    for cube in [cubes.join("takahashi09-flux"), copy] {
        let found = compared_by(&python, &cube).unwrap();
        assert_eq!(found["steps"], 12);
        assert!(found["values"].as_u64().unwrap() > 400_000, "{found}");
    }
    // The comparison sees another product.
    let error = compared_by(&python, cubes.join("takahashi09-flux-accumulated")).unwrap_err();
    assert!(error.contains("carbon_flux"), "{error}");
}

/// Names of the stored fields of a product: digests of values, places and times.
fn fields(data: &Path, product: &str) -> BTreeSet<OsString> {
    let folder = data.join("objects/frames").join(product);
    let entries = std::fs::read_dir(folder).unwrap();
    entries.map(|entry| entry.unwrap().file_name()).collect()
}

/// What `fluxglobe products` says that a product measures.
fn quantity(data: &Path, product: &str) -> Value {
    let listed = program::json(data, &["products", "--json"]).unwrap();
    let own = listed
        .as_array()
        .unwrap()
        .iter()
        .find(|one| one["product"] == product);
    own.unwrap()["quantity"].clone()
}

#[test]
fn what_was_exported_as_netcdf_lands_as_what_it_was_with_its_values_and_its_budget() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    for (product, landed) in [
        ("takahashi09-flux", "carbon-flux"),
        ("wind-2010", "wind-speed"),
    ] {
        // No profile is for a file of this name.
        let file = folder.path().join(format!("exported-{landed}.nc"));
        let file = file.to_str().unwrap();
        program::succeed(demo_data(), &["export", product, "--to", "netcdf", file]).unwrap();
        program::succeed(&data, &["ingest", file]).unwrap();
        assert_eq!(quantity(&data, landed), quantity(demo_data(), product));
        let (before, after) = (fields(demo_data(), product), fields(&data, landed));
        assert_eq!(after.len(), 12, "{product}");
        assert!(after.is_subset(&before), "{product} has other values");
    }
    assert_eq!(quantity(&data, "carbon-flux"), "carbon_flux");
    let rows = |data: &Path, product: &str| {
        let words = ["budget", "--product", product, "--step", "month", "--json"];
        program::json(data, &words).unwrap()["rows"].clone()
    };
    let (before, after) = (
        rows(demo_data(), "takahashi09-flux"),
        rows(&data, "carbon-flux"),
    );
    for (before, after) in before
        .as_array()
        .unwrap()
        .iter()
        .zip(after.as_array().unwrap())
    {
        assert!(before["budget_tg"].is_number(), "{before}");
        assert_eq!(before["budget_tg"], after["budget_tg"]);
    }
}

#[test]
fn an_export_is_a_repository_of_that_version_and_never_replaces_anything() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("flux");
    let text = place.to_str().unwrap();
    let asked = "takahashi09-flux@1";
    let told = program::json(
        demo_data(),
        &["export", asked, "--to", "icechunk", text, "--json"],
    );
    assert_eq!(told.unwrap()["tag"], "1");
    assert!(place.join("repo").is_file());
    for to in ["icechunk", "zarr"] {
        let again = program::run(demo_data(), &["export", asked, "--to", to, text]).unwrap();
        let talk = String::from_utf8_lossy(&again.stderr).into_owned();
        assert!(
            !again.status.success() && talk.contains("not empty"),
            "{talk}"
        );
    }
    let other = folder.path().join("other");
    for (asked, words) in [
        ("takahashi09-flux@999", "no version 999"),
        ("nothing", "there is no product nothing"),
        (
            "takahashi09-flux@1-00000000",
            "not takahashi09-flux@1-00000000",
        ),
    ] {
        let words_of = ["export", asked, "--to", "zarr", other.to_str().unwrap()];
        let refused = program::run(demo_data(), &words_of).unwrap();
        let talk = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert!(!refused.status.success() && talk.contains(words), "{talk}");
        assert!(!other.exists(), "{asked} left something");
    }
}
