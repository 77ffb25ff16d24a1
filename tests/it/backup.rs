//! A store that is copied while a file lands: a copy in the order of docs/operations.md is whole, in another it is not.

use std::path::Path;

use harness::{granule, program};

const PAGE: &str = include_str!("../../docs/operations.md");

/// Folders that are copied at a time.
enum Part {
    Named(Vec<&'static str>),
    /// All that no other part names.
    Else,
}

/// In which order the page says that a store is copied, each part whole before the next.
fn parts() -> Vec<Part> {
    let (_, section) = PAGE.split_once("\n## Backup\n").unwrap();
    let (_, order) = section.split_once("in this order:").unwrap();
    let (order, _) = order.split_once(", each whole before the next").unwrap();
    let part = |text: &'static str| {
        let quoted = text.split('`').skip(1).step_by(2);
        let names: Vec<&str> = quoted.map(|name| name.strip_suffix('/').unwrap()).collect();
        let is_else = text.contains("all else");
        assert_ne!(is_else, !names.is_empty(), "what is copied here? {text}");
        if is_else {
            Part::Else
        } else {
            Part::Named(names)
        }
    };
    order.split(", then").map(part).collect()
}

/// Copies some parts of a store, one after the other.
fn copy_parts<'a>(data: &Path, to: &Path, all: &[Part], some: impl Iterator<Item = &'a Part>) {
    let is_named = |name: &str| {
        let mut named = all.iter();
        named.any(|part| matches!(part, Part::Named(names) if names.contains(&name)))
    };
    for part in some {
        match part {
            Part::Named(names) => {
                for name in names {
                    copy_where(data, to, |it| it == *name);
                }
            }
            Part::Else => copy_where(data, to, |it| !is_named(it)),
        }
    }
}

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
fn a_store_that_is_copied_in_the_order_of_the_page_while_a_file_lands_is_whole() {
    let parts = parts();
    let place = |name: &str| {
        let is_it = |part: &Part| matches!(part, Part::Named(names) if names.contains(&name));
        parts.iter().position(is_it).expect("the page names it")
    };
    // Of two steps there are no pages of a manifest, and of a flux no index of observations.
    assert!(place("manifests") < place("manifest-pages"));
    let last = parts.len() - 1;
    assert!(place("observation-indexes") < last && matches!(parts[last], Part::Else));
    let folder = || tempfile::tempdir().unwrap();
    let (data, wrong) = (folder(), folder());
    let (data, wrong) = (data.path(), wrong.path());
    // A file lands after the first part is copied, after the second, and so on.
    let right: Vec<(usize, tempfile::TempDir)> =
        (1..parts.len()).map(|at| (at, folder())).collect();
    land(data, 0);
    for (at, right) in &right {
        copy_parts(data, right.path(), &parts, parts[..*at].iter());
    }
    let backwards = || parts.iter().rev();
    copy_parts(data, wrong, &parts, backwards().take(1));
    land(data, 1);
    for (at, right) in &right {
        copy_parts(data, right.path(), &parts, parts[*at..].iter());
    }
    copy_parts(data, wrong, &parts, backwards().skip(1));
    for (_, right) in &right {
        program::succeed(right.path(), &["verify"]).unwrap();
        let products = program::json(right.path(), &["products", "--json"]).unwrap();
        let mut products = products.as_array().unwrap().iter();
        let flux = products.find(|it| it["product"] == "flux").unwrap();
        assert_eq!(flux["step_count"], 1, "the version that was there at first");
    }
    let lacks = program::run(wrong, &["verify"]).unwrap();
    let lacks = String::from_utf8(lacks.stdout).unwrap();
    assert!(lacks.contains("is missing"), "it tests nothing: {lacks}");
}
