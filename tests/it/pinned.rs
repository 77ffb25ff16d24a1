//! A version that somebody cites, pinned and released by `fluxglobe keep`, and what `fluxglobe gc` leaves of it.

use std::fs::File;
use std::path::Path;
use std::time::{Duration, SystemTime};

use harness::{granule, program};
use serde_json::Value;

/// Lands one month, another edition of it each time: a version shares no field with the one before.
fn land(data: &Path, edition: usize) {
    let file = granule::write(data, 0, edition).unwrap();
    let words = ["ingest", file.to_str().unwrap(), "--product", "flux"];
    program::succeed(data, &words).unwrap();
}

/// Makes all objects of a folder two days old.
fn age(folder: &Path) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            age(&path);
        } else {
            let file = File::options().append(true).open(&path).unwrap();
            let then = SystemTime::now() - Duration::from_hours(48);
            file.set_modified(then).unwrap();
        }
    }
}

/// What is removed, and what is said of it.
fn clean(data: &Path) -> (String, String) {
    age(&data.join("objects"));
    let words = ["gc", "--keep-versions", "1", "--keep-days", "0"];
    let output = program::run(data, &words).unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    let (listed, said) = (text(output.stdout), text(output.stderr));
    assert!(output.status.success(), "{said}");
    (listed, said)
}

fn listed(data: &Path) -> Value {
    program::json(data, &["keep", "--list", "--json"]).unwrap()
}

#[test]
fn a_version_that_is_cited_is_kept_until_it_is_released() {
    let data = tempfile::tempdir().unwrap();
    let data = data.path();
    for edition in 0..3 {
        land(data, edition);
    }
    let budget = || program::json(data, &["budget", "--product", "flux@1", "--json"]);
    let cited = budget().unwrap();
    let version = cited["manifest"].as_str().unwrap();
    assert!(version.starts_with("flux@1-"), "{version}");

    let refused = program::fail(data, &["keep", "flux@7"]).unwrap();
    assert!(refused.contains("has no version 7"), "{refused}");
    let refused = program::fail(data, &["keep", "flux"]).unwrap();
    assert!(refused.contains("flux@3-"), "{refused}");
    assert_eq!(listed(data), serde_json::json!([]));

    let because = ["--because", "Table 2 of a paper"];
    let keep = [["keep", version], because].concat();
    let said = program::succeed(data, &keep).unwrap();
    assert!(said.contains(version), "{said}");
    program::succeed(data, &["keep", "flux@1"]).unwrap();
    let another = ["keep", "flux@1", "--because", "another"];
    let refused = program::fail(data, &another).unwrap();
    assert!(refused.contains("Table 2 of a paper"), "{refused}");
    let pinned = listed(data);
    assert_eq!(pinned.as_array().unwrap().len(), 1);
    assert_eq!(pinned[0]["version"], version);
    assert_eq!(pinned[0]["because"], "Table 2 of a paper");
    assert_eq!(pinned[0]["lacking"], Value::Null);
    let table = program::succeed(data, &["keep", "--list"]).unwrap();
    assert!(
        table.contains(version) && table.contains("Table 2"),
        "{table}"
    );

    let (gone, said) = clean(data);
    assert!(
        said.contains("1 versions are kept since they are pinned"),
        "{said}"
    );
    assert!(gone.contains("manifests/flux/0000000002.json"), "{gone}");
    assert!(!gone.contains("manifests/flux/0000000001.json"), "{gone}");
    assert_eq!(budget().unwrap()["rows"], cited["rows"]);
    program::succeed(data, &["verify"]).unwrap();

    let refused = program::fail(data, &["keep", "--release", "flux@2"]).unwrap();
    assert!(refused.contains("is not pinned"), "{refused}");
    program::succeed(data, &["keep", "--release", version]).unwrap();
    assert_eq!(listed(data), serde_json::json!([]));
    let (gone, said) = clean(data);
    assert!(gone.contains("manifests/flux/0000000001.json"), "{gone}");
    assert!(!said.contains("pinned"), "{said}");
    assert!(budget().unwrap_err().to_string().contains("no version 1"));
}

#[test]
fn a_damaged_pin_is_named_and_nothing_is_removed() {
    let data = tempfile::tempdir().unwrap();
    let data = data.path();
    for edition in 0..2 {
        land(data, edition);
    }
    program::succeed(data, &["keep", "flux@1"]).unwrap();
    let key = "pins/flux/0000000001.json";
    let path = data.join("objects").join(key);
    let mut content = std::fs::read(&path).unwrap();
    content[30] ^= 1;
    std::fs::write(&path, content).unwrap();
    age(&data.join("objects"));
    for words in [
        &["gc", "--keep-versions", "1", "--keep-days", "0"][..],
        &["keep", "--list"],
        &["keep", "flux@1"],
    ] {
        let said = program::fail(data, words).unwrap();
        assert!(
            said.contains(key) && said.contains("keep --release flux@1"),
            "{said}"
        );
    }
    program::succeed(data, &["budget", "--product", "flux@1"]).unwrap();
    program::succeed(data, &["keep", "--release", "flux@1"]).unwrap();
    let (gone, _said) = clean(data);
    assert!(gone.contains("manifests/flux/0000000001.json"), "{gone}");
}
