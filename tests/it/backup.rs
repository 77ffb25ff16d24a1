//! A store that is copied while a file lands: a copy in the order of docs/operations.md is whole, in another it is not.

use std::path::Path;

use harness::{granule, program};

/// What names other objects, in the order in which it is copied.
const FIRST: [&str; 3] = ["manifests", "observation-indexes", "manifest-pages"];

fn land(data: &Path, month: usize) {
    let file = granule::write(data, month, 0).unwrap();
    let words = ["ingest", file.to_str().unwrap(), "--product", "flux"];
    program::succeed(data, &words).unwrap();
}

/// Copies what is not there yet of a folder, if it is there, as tools that copy buckets do.
fn copy(from: &Path, to: &Path) {
    if !from.exists() {
        return;
    }
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let (from, to) = (entry.path(), to.join(entry.file_name()));
        if from.is_dir() {
            copy(&from, &to);
        } else if !to.exists() {
            std::fs::copy(&from, &to).unwrap();
        }
    }
}

/// Copies folders of a store by their names.
fn copy_where(data: &Path, to: &Path, is_wanted: impl Fn(&str) -> bool) {
    for entry in std::fs::read_dir(data.join("objects")).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        // Cubes are made again.
        if name != "cubes" && is_wanted(&name) {
            let below = Path::new("objects").join(&name);
            copy(&data.join(&below), &to.join(&below));
        }
    }
}

#[test]
fn a_store_that_is_copied_while_a_file_lands_is_whole_if_manifests_were_copied_first() {
    let (data, right, wrong) = (
        tempfile::tempdir().unwrap(),
        tempfile::tempdir().unwrap(),
        tempfile::tempdir().unwrap(),
    );
    let (data, right, wrong) = (data.path(), right.path(), wrong.path());
    land(data, 0);
    for name in FIRST {
        copy_where(data, right, |it| it == name);
    }
    copy_where(data, wrong, |it| !FIRST.contains(&it));
    land(data, 1);
    copy_where(data, right, |it| !FIRST.contains(&it));
    for name in FIRST.iter().rev() {
        copy_where(data, wrong, |it| it == *name);
    }
    program::succeed(right, &["verify"]).unwrap();
    let lacks = program::run(wrong, &["verify"]).unwrap();
    let lacks = String::from_utf8(lacks.stdout).unwrap();
    assert!(lacks.contains("is missing"), "it tests nothing: {lacks}");
    let products = program::json(right, &["products", "--json"]).unwrap();
    let mut products = products.as_array().unwrap().iter();
    let flux = products.find(|it| it["product"] == "flux").unwrap();
    assert_eq!(flux["step_count"], 1, "the version that was there at first");
}
