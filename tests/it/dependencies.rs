//! Which crate may know which: read from `cargo metadata`, compared with the table of ARCHITECTURE.md.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

use serde_json::Value;

/// Workspace crates that each crate may depend on directly.
const MAY_USE: &[(&str, &[&str])] = &[
    ("contract", &[]),
    ("legend", &["contract"]),
    ("retry", &[]),
    ("synthetic", &[]),
    ("service", &["retry"]),
    ("storage", &["contract", "retry"]),
    ("cube", &["contract", "storage"]),
    ("netcdf4", &[]),
    ("export", &["contract", "cube", "netcdf4"]),
    ("kafka-log", &["contract", "storage", "service"]),
    ("observations", &["contract", "retry", "storage", "service"]),
    (
        "ingest",
        &[
            "contract",
            "retry",
            "storage",
            "cube",
            "netcdf4",
            "service",
            "synthetic",
        ],
    ),
    (
        "compute",
        &["contract", "retry", "storage", "cube", "service"],
    ),
    ("render", &["contract"]),
    (
        "render-worker",
        &[
            "contract", "cube", "legend", "retry", "storage", "service", "render",
        ],
    ),
    ("render-proof", &["contract", "render", "synthetic"]),
    (
        "tile-server",
        &["contract", "legend", "retry", "storage", "cube", "service"],
    ),
    (
        "fluxglobe",
        &[
            "contract",
            "legend",
            "storage",
            "cube",
            "export",
            "service",
            "kafka-log",
            "observations",
            "ingest",
            "compute",
            "render",
            "render-worker",
            "render-proof",
            "tile-server",
        ],
    ),
    ("tests", &["contract", "storage", "kafka-log"]),
];

/// Packages that must not be reachable from a crate.
const MUST_NOT_REACH: &[(&str, &[&str])] = &[
    (
        "contract",
        &["tokio", "wgpu", "datafusion", "object_store", "arrow"],
    ),
    (
        "tile-server",
        &["wgpu", "datafusion", "ballista", "hdf5-metno", "rdkafka"],
    ),
    (
        "render-worker",
        &["datafusion", "ballista", "hdf5-metno", "rdkafka"],
    ),
    ("render", &["tokio", "object_store", "tonic", "prometheus"]),
    ("render-proof", &["tokio", "object_store", "tonic"]),
    (
        "cube",
        &["datafusion", "ballista", "wgpu", "hdf5-metno", "rdkafka"],
    ),
    ("ingest", &["datafusion", "ballista", "wgpu", "rdkafka"]),
    ("compute", &["wgpu", "hdf5-metno", "rdkafka"]),
    ("observations", &["datafusion", "wgpu", "rdkafka"]),
];

/// Packages of which there may be one version only: two would not understand each other's values.
const ONE_VERSION: &[&str] = &[
    "arrow",
    "parquet",
    "object_store",
    "datafusion",
    "wgpu",
    "glam",
    "tokio",
    "axum",
    "image",
    "chrono",
    "geo",
];

/// Second versions whose values stay inside the one package that uses them: Icechunk's own client of object stores, which
/// nobody makes (its objects go through `storage`).
const INSIDE: &[(&str, &str)] = &[("object_store", "icechunk-arrow-object-store")];

/// Licences that a package may be under without asking.
const LICENCES: &[&str] = &[
    "Apache-2.0",
    "MIT",
    "MIT-0",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "ISC",
    "Zlib",
    "0BSD",
    "CC0-1.0",
    "Unicode-3.0",
    "Unlicense",
    "BSL-1.0",
    "CDLA-Permissive-2.0",
    "bzip2-1.0.6",
    "Apache-2.0 WITH LLVM-exception",
];

/// Packages that name their licence in a file instead: the HDF5 sources, under a BSD licence of The HDF Group.
const LICENCE_IN_A_FILE: &[&str] = &["hdf5-metno-src"];

struct Graph {
    /// Direct dependencies without those of tests only, by package id.
    uses: BTreeMap<String, BTreeSet<String>>,
    /// Name, version and licence by package id.
    packages: BTreeMap<String, (String, String, String)>,
}

fn graph() -> Graph {
    let manifest = concat!(env!("CARGO_MANIFEST_DIR"), "/../Cargo.toml");
    let output = Command::new(env!("CARGO"))
        .args([
            "metadata",
            "--format-version",
            "1",
            "--locked",
            "--offline",
            "--manifest-path",
            manifest,
        ])
        .args(["--filter-platform", "x86_64-unknown-linux-gnu"])
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let packages = metadata["packages"]
        .as_array()
        .unwrap()
        .iter()
        .map(|package| {
            let facts = (
                text(&package["name"]),
                text(&package["version"]),
                text(&package["license"]),
            );
            (text(&package["id"]), facts)
        });
    let uses = metadata["resolve"]["nodes"]
        .as_array()
        .unwrap()
        .iter()
        .map(|node| {
            let at_run_time = |dep: &&Value| {
                let kinds = dep["dep_kinds"].as_array().unwrap();
                kinds.iter().any(|kind| kind["kind"].is_null())
            };
            let deps = node["deps"].as_array().unwrap().iter().filter(at_run_time);
            (
                text(&node["id"]),
                deps.map(|dep| text(&dep["pkg"])).collect(),
            )
        });
    Graph {
        packages: packages.collect(),
        uses: uses.collect(),
    }
}

impl Graph {
    fn id_of(&self, name: &str) -> &str {
        let found = self
            .packages
            .iter()
            .find(|(_, package)| package.0 == name && package.1 == env!("CARGO_PKG_VERSION"));
        found
            .unwrap_or_else(|| panic!("{name} is no crate of this workspace"))
            .0
    }

    fn names<'a>(&'a self, ids: impl IntoIterator<Item = &'a String>) -> BTreeSet<&'a str> {
        ids.into_iter()
            .map(|id| self.packages[id].0.as_str())
            .collect()
    }

    /// Is this a version that only the package of [`INSIDE`] uses?
    fn stays_inside(&self, id: &str) -> bool {
        let users = self.uses.iter().filter(|(_, uses)| uses.contains(id));
        let mut users = users.map(|(user, _)| self.packages[user].0.as_str());
        let name = self.packages[id].0.as_str();
        users.all(|user| INSIDE.contains(&(name, user)))
    }

    fn reachable(&self, from: &str) -> BTreeSet<&str> {
        let mut seen = BTreeSet::new();
        let mut open = vec![from.to_owned()];
        while let Some(id) = open.pop() {
            if seen.insert(id.clone()) {
                open.extend(self.uses[&id].iter().cloned());
            }
        }
        self.packages
            .iter()
            .filter(|(id, _)| seen.contains(*id))
            .map(|(_, package)| package.0.as_str())
            .collect()
    }
}

#[test]
fn crates_know_only_those_below_them() {
    let graph = graph();
    let ours: BTreeSet<&str> = MAY_USE.iter().map(|(name, _)| *name).collect();
    for (name, allowed) in MAY_USE {
        let used = graph.names(&graph.uses[graph.id_of(name)]);
        let extra: Vec<_> = used
            .iter()
            .filter(|used| ours.contains(*used) && !allowed.contains(used))
            .collect();
        assert!(extra.is_empty(), "{name} must not know {extra:?}");
    }
}

#[test]
fn heavy_packages_stay_where_they_belong() {
    let graph = graph();
    for (name, banned) in MUST_NOT_REACH {
        let reached = graph.reachable(graph.id_of(name));
        assert!(
            reached.contains("contract"),
            "the walk from {name} found nothing"
        );
        let found: Vec<_> = banned
            .iter()
            .filter(|package| reached.contains(*package))
            .collect();
        assert!(found.is_empty(), "{name} links {found:?}");
    }
    // The walk can find what it looks for.
    assert!(
        graph
            .reachable(graph.id_of("compute"))
            .contains("datafusion")
    );
    assert!(
        graph
            .reachable(graph.id_of("render-worker"))
            .contains("wgpu")
    );
}

#[test]
fn packages_whose_values_cross_crates_have_one_version() {
    let graph = graph();
    let reached = graph.reachable(graph.id_of("fluxglobe"));
    for name in ONE_VERSION {
        let versions: BTreeSet<_> = graph
            .packages
            .iter()
            .filter(|(id, package)| package.0 == *name && !graph.stays_inside(id))
            .map(|(_, package)| &package.1)
            .collect();
        assert!(versions.len() <= 1, "{name} has the versions {versions:?}");
        assert!(!versions.is_empty() || !reached.contains(name));
    }
}

#[test]
fn every_package_has_a_licence_that_needs_no_asking() {
    for (name, version, licence) in graph().packages.values() {
        let choices = licence.split(" OR ").flat_map(|choice| choice.split('/'));
        let mut choices = choices.map(|choice| choice.trim_matches(['(', ')', ' ']));
        let is_known = |choice: &str| {
            choice
                .split(" AND ")
                .all(|part| LICENCES.contains(&part.trim_matches(['(', ')'])))
        };
        assert!(
            choices.any(is_known) || LICENCE_IN_A_FILE.contains(&name.as_str()),
            "{name} {version} is under {licence:?}"
        );
    }
}
