//! `fluxglobe verify` over a data folder with objects of every kind, one bit flipped in each, alone; and commands over a
//! damaged journal.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use contract::kind::Kind;
use harness::program;
use test_data::frozen;

/// A data folder as a program of this version of the manifest left it.
fn data() -> tempfile::TempDir {
    let data = tempfile::tempdir().unwrap();
    for part in ["objects", "events"] {
        frozen::copy(2, part, &data.path().join(part));
    }
    data
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let mut all = vec![];
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            all.extend(files(&path));
        } else {
            all.push(path);
        }
    }
    all.sort();
    all
}

fn flip(path: &Path) {
    let mut content = std::fs::read(path).unwrap();
    let at = content.len() * 5 / 8;
    content[at] ^= 1 << (at % 8);
    std::fs::write(path, content).unwrap();
}

/// Keys that `fluxglobe verify` names.
fn named(data: &Path) -> Vec<String> {
    let output = program::run(data, &["verify", "--json"]).unwrap();
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let findings = report["findings"].as_array().unwrap();
    assert_eq!(output.status.success(), findings.is_empty());
    let key = |finding: &serde_json::Value| finding["key"].as_str().unwrap().to_owned();
    findings.iter().map(key).collect()
}

#[test]
fn a_flipped_bit_of_any_object_or_of_the_journal_is_named_by_verify() {
    let data = data();
    let data = data.path();
    assert_eq!(named(data), [""; 0]);
    let mut kinds = BTreeSet::new();
    for path in files(data) {
        let key = path.strip_prefix(data).unwrap().to_str().unwrap();
        let key = key.strip_prefix("objects/").unwrap_or(key).to_owned();
        let folder = key.split('/').next().unwrap().to_owned();
        // The first of each kind: the others are what it is.
        if !kinds.insert(folder) {
            continue;
        }
        let whole = std::fs::read(&path).unwrap();
        flip(&path);
        assert_eq!(named(data), [key]);
        std::fs::write(&path, whole).unwrap();
    }
    assert_eq!(kinds.len(), Kind::ALL.len() + 1, "{kinds:?}");
    assert_eq!(named(data), [""; 0]);
}

#[test]
fn a_damaged_newest_version_is_named_and_so_is_what_else_is_damaged() {
    let data = data();
    let data = data.path();
    let mut keys = vec![];
    for folder in ["manifests/fgco2", "raw/fgco2"] {
        let path = files(&data.join("objects").join(folder)).pop().unwrap();
        flip(&path);
        let key = path.strip_prefix(data.join("objects")).unwrap();
        keys.push(key.to_str().unwrap().to_owned());
    }
    assert_eq!(named(data), keys);
}

/// Of each part of a cube, chunks among them, one: an array's chunk is told by its place in it.
#[test]
fn a_flipped_bit_of_a_cube_is_named_with_product_array_and_chunk() {
    let data = data();
    let data = data.path();
    let cube = data.join("objects/cubes/fgco2");
    let mut parts = BTreeSet::new();
    for path in files(&cube) {
        let part = path.strip_prefix(&cube).unwrap().iter().next().unwrap();
        if !parts.insert(part.to_owned()) {
            continue;
        }
        let whole = std::fs::read(&path).unwrap();
        flip(&path);
        let output = program::run(data, &["verify", "--product", "fgco2"]).unwrap();
        assert!(!output.status.success());
        let told = String::from_utf8_lossy(&output.stdout).into_owned();
        let key = path.strip_prefix(data.join("objects")).unwrap();
        assert!(told.starts_with(key.to_str().unwrap()), "{told}");
        let is_chunk = part == "chunks";
        assert_eq!(
            told.contains("of carbon_flux in the newest state"),
            is_chunk,
            "{told}"
        );
        std::fs::write(&path, whole).unwrap();
    }
    assert_eq!(parts.len(), 5, "{parts:?}");
}

/// What `verify` advises for a damaged cube mends that of a product that is no flux too, which has no budget.
#[test]
fn what_is_no_flux_is_made_again_as_verify_advises() {
    let data = data();
    let data = data.path();
    let derive = [
        "derive",
        "statistic",
        "--product",
        "fgco2",
        "--statistic",
        "count,max",
    ];
    program::succeed(data, &derive).unwrap();
    for product in ["fgco2-count", "fgco2-max"] {
        // So small a cube has its chunks beside their places.
        let manifests = data.join("objects/cubes").join(product).join("manifests");
        flip(&files(&manifests)[0]);
        let verify = ["verify", "--product", product];
        let output = program::run(data, &verify).unwrap();
        let advice = format!(
            "{}{}",
            String::from_utf8_lossy(&output.stdout),
            String::from_utf8_lossy(&output.stderr)
        );
        assert!(
            advice.contains("fluxglobe recompute --product PRODUCT --verify"),
            "{advice}"
        );
        let mend = [
            "recompute",
            "--product",
            product,
            "--verify",
            "--what",
            "frames,statistics,budget",
        ];
        program::succeed(data, &mend).unwrap();
        program::succeed(data, &verify).unwrap();
        let refused = program::fail(
            data,
            &["recompute", "--product", product, "--what", "budget"],
        )
        .unwrap();
        assert!(refused.contains("budget"), "{refused}");
    }
}

/// What was computed has no files that it could be read from again.
#[test]
fn what_was_computed_is_made_again_of_what_it_is_made_of_and_carbon_of_its_flux() {
    let data = data();
    let data = data.path();
    let derive = [
        "derive",
        "--name",
        "twice",
        "--quantity",
        "carbon_flux",
        "--input",
        "flux=fgco2",
        "--expr",
        "2 * flux",
    ];
    program::succeed(data, &derive).unwrap();
    let mend = |product: &'static str| {
        [
            "recompute",
            "--product",
            product,
            "--verify",
            "--what",
            "frames",
        ]
    };
    let fields = |product: &str| files(&data.join("objects/frames").join(product));
    flip(&fields("twice")[0]);
    assert_eq!(named(data).len(), 1);
    program::succeed(data, &mend("twice")).unwrap();
    assert_eq!(named(data), [""; 0]);
    for field in fields("fgco2-accumulated") {
        flip(&field);
    }
    let refused = program::fail(data, &mend("fgco2-accumulated")).unwrap();
    assert!(
        refused.contains("fluxglobe recompute --product fgco2 --verify"),
        "{refused}"
    );
}

#[test]
fn a_dry_run_names_what_would_be_made_again_and_changes_nothing() {
    let data = data();
    let data = data.path();
    let derive = "derive statistic --product fgco2 --statistic max";
    program::succeed(data, &derive.split(' ').collect::<Vec<_>>()).unwrap();
    let domain = files(&data.join("objects/domain/fgco2")).remove(0);
    let field = files(&data.join("objects/frames/fgco2-max")).remove(0);
    let of_cube = files(&data.join("objects/cubes/fgco2-max/manifests")).remove(0);
    for path in [&domain, &field, &of_cube] {
        flip(path);
    }
    let objects = data.join("objects");
    let key = |path: &Path| {
        path.strip_prefix(&objects)
            .unwrap()
            .to_str()
            .unwrap()
            .to_owned()
    };
    let content = || -> Vec<Vec<u8>> {
        let all = files(&objects);
        all.iter()
            .map(|path| std::fs::read(path).unwrap())
            .collect()
    };
    let before = content();
    for (product, expected) in [
        ("fgco2", vec![key(&domain)]),
        (
            "fgco2-max",
            vec![key(&field), "the cube of fgco2-max is damaged".to_owned()],
        ),
    ] {
        let words = format!("recompute --product {product} --what frames --verify");
        let mend: Vec<&str> = words.split(' ').collect();
        let dry = [&mend[..], &["--dry-run"]].concat();
        let told = program::succeed(data, &dry).unwrap();
        for one in &expected {
            assert!(told.contains(one), "{one}: {told}");
        }
        let json = program::json(data, &[&dry[..], &["--json"]].concat()).unwrap();
        let objects = json["damaged"][0]["objects"].as_array().unwrap();
        assert_eq!(objects, &[expected[0].as_str()], "{json}");
    }
    assert!(content() == before, "a dry run changes nothing");
    let words = "recompute --product fgco2-max --what frames --verify";
    let mend: Vec<&str> = words.split(' ').collect();
    program::succeed(data, &mend).unwrap();
    let told = program::succeed(data, &[&mend[..], &["--dry-run"]].concat()).unwrap();
    assert!(!told.contains("would be"), "{told}");
}

#[test]
fn a_damaged_journal_ends_a_command_with_its_entry_and_stays_as_it_is() {
    let data = data();
    let journal = data.path().join("events/journal.jsonl");
    flip(&journal);
    let damaged = std::fs::read(&journal).unwrap();
    let file = data.path().join("any.nc");
    std::fs::write(&file, "no grid").unwrap();
    let talk = program::fail(data.path(), &["ingest", file.to_str().unwrap()]).unwrap();
    assert!(
        talk.contains("entry ") && talk.contains("journal.jsonl is damaged"),
        "{talk}"
    );
    assert_eq!(std::fs::read(&journal).unwrap(), damaged);
}
