//! Names and sizes of the files in git: what came in by accident, such as what a command printed, is told by either.

use std::path::Path;
use std::process::Command;

/// Endings of files that are kept, the whole name of those that begin with a dot among them.
const ENDINGS: &[&str] = &[
    "bin",
    "cjs",
    "css",
    "dockerignore",
    "env",
    "gitignore",
    "helmignore",
    "html",
    "json",
    "jsonl",
    "lock",
    "lua",
    "md",
    "mjs",
    "mp4",
    "nc",
    "npmrc",
    "parquet",
    "png",
    "properties",
    "proto",
    "py",
    "rs",
    "service",
    "sh",
    "sql",
    "svg",
    "toml",
    "tpl",
    "ts",
    "txt",
    "webp",
    "wgsl",
    "xml",
    "yaml",
    "yml",
];

/// Names without an ending.
const NAMES: &[&str] = &["Dockerfile", "LICENSE", "Makefile", "dashboards", "run"];

/// Stores as they lie in a bucket: what objects are called in them is the format's.
const STORES: &[&str] = &["ingest/tests/data/attached/", "storage/tests/frozen/"];

/// Names that others prescribe: systemd starts as many of this one as it is told names.
const PRESCRIBED: &[&str] = &["deploy/fluxglobe@.service"];

/// Pictures, the API's description and lists of versions are less than this.
const MOST_BYTES: u64 = 512 << 10;

/// The films of the gallery, with the most that each may have: every clone carries all that they ever were.
const LARGER: &[(&str, u64)] = &[
    ("docs/gallery/flight.mp4", 1536 << 10),
    ("docs/gallery/year.mp4", 1536 << 10),
];

/// A file by its path from the root of the repository, with its size.
type Tracked = (String, u64);

/// Files that are in git, or will be with the next commit, and are there.
fn tracked() -> Vec<Tracked> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let listed = Command::new("git")
        .arg("-C")
        .arg(&root)
        .args(["ls-files", "-z"])
        .output()
        .unwrap();
    let complaint = String::from_utf8_lossy(&listed.stderr);
    assert!(listed.status.success(), "git ls-files: {complaint}");
    let names = String::from_utf8_lossy(&listed.stdout);
    let sized = |name: &str| {
        let there = root.join(name).symlink_metadata().ok()?;
        Some((name.to_owned(), there.len()))
    };
    names.split_terminator('\0').filter_map(sized).collect()
}

/// What is wrong with a name, if anything is.
fn fault_of_name(path: &str) -> Option<&'static str> {
    let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || b"._/-".contains(&byte);
    if PRESCRIBED.contains(&path) {
        return None;
    }
    if !path.bytes().all(is_plain) {
        return Some("has other characters than A-Z a-z 0-9 . _ / -");
    }
    if STORES.iter().any(|store| path.starts_with(store)) {
        return None;
    }
    let name = path.rsplit('/').next().unwrap_or(path);
    let is_known = match name.rsplit_once('.') {
        Some((_, ending)) => ENDINGS.contains(&ending),
        None => NAMES.contains(&name),
    };
    (!is_known).then_some("is of no kind that is kept here")
}

/// A line for each file that should not be there as it is.
fn faults(files: &[Tracked]) -> Vec<String> {
    let mut faults = vec![];
    for (path, bytes) in files {
        if let Some(fault) = fault_of_name(path) {
            faults.push(format!("{path:?} {fault}"));
        }
        let own = LARGER.iter().find(|(larger, _)| larger == path);
        let most = own.map_or(MOST_BYTES, |(_, most)| *most);
        if *bytes > most {
            faults.push(format!("{path:?} has {bytes} bytes, more than {most}"));
        }
    }
    faults
}

#[test]
fn files_in_git_have_plain_names_of_known_kinds_and_are_small() {
    let files = tracked();
    assert!(files.len() > 1000, "{} files are not all", files.len());
    let faults = faults(&files);
    assert!(
        faults.is_empty(),
        "not meant to be in git, or to be named in tests/it/tracked_files.rs:\n{}",
        faults.join("\n")
    );
}

#[test]
fn what_is_allowed_beside_the_rule_is_there() {
    let files = tracked();
    let is_there = |path: &str| files.iter().any(|(own, _)| own.starts_with(path));
    let larger = LARGER.iter().map(|(path, _)| path);
    let mut all = STORES.iter().chain(PRESCRIBED).chain(larger);
    assert!(all.all(|path| is_there(path)));
    for ending in ENDINGS {
        let ending = format!(".{ending}");
        assert!(
            files.iter().any(|(path, _)| path.ends_with(&ending)),
            "{ending}"
        );
    }
}

#[test]
fn what_came_in_by_accident_is_told() {
    let film = LARGER[0].0;
    let planted = [
        ("kafka/src/probe.rs:173:impl Drop for Asking {", 1),
        ("docs/a picture.png", 1),
        ("docs/ö.md", 1),
        ("compute/src/lib.rs.orig", 1),
        ("core", 1),
        ("docs/gallery/new.png", MOST_BYTES + 1),
        (film, 8 << 20),
    ];
    for (path, bytes) in planted {
        let told = faults(&[(path.to_owned(), bytes)]);
        assert_eq!(told.len(), 1, "{path}: {told:?}");
        assert!(told[0].contains(&format!("{path:?}")), "{told:?}");
    }
    assert_eq!(faults(&[(film.to_owned(), MOST_BYTES + 1)]).len(), 0);
}
