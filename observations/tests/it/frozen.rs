//! Observations as earlier versions stored them (`storage/tests/frozen`), and each of their objects with a flipped bit.

use std::path::{Path, PathBuf};

use contract::digest::Digest;
use contract::observation::{Observation, PlatformKind, Quality};
use observations::{FileStore, Filter, ObservationStore as _};
use storage::Store;

use crate::sample::{START_MS, observation, time};

/// A copy of a frozen store.
fn store(version: u32) -> (tempfile::TempDir, Store) {
    fn copy_all(from: &Path, to: &Path) {
        std::fs::create_dir_all(to).unwrap();
        for entry in std::fs::read_dir(from).unwrap() {
            let entry = entry.unwrap();
            let to = to.join(entry.file_name());
            if entry.file_type().unwrap().is_dir() {
                copy_all(&entry.path(), &to);
            } else {
                std::fs::copy(entry.path(), to).unwrap();
            }
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let frozen = Path::new(env!("CARGO_MANIFEST_DIR")).join("../storage/tests/frozen");
    for part in ["observations", "observation-indexes"] {
        let from = frozen.join(version.to_string()).join("objects").join(part);
        copy_all(&from, &folder.path().join(part));
    }
    let store = Store::open(folder.path().to_str().unwrap()).unwrap();
    (folder, store)
}

async fn all(store: &Store) -> Result<Vec<Observation>, String> {
    let files = FileStore::new(store.clone());
    let filter = Filter {
        worst: Quality::Bad,
        ..Filter::default()
    };
    let page = files.query(&filter).await.map_err(|e| e.to_string())?;
    assert!(page.next.is_none(), "there is more than a page");
    Ok(page.observations)
}

/// Every kind of platform and quality, over the end of a month, in the order of their keys.
fn rows() -> Vec<Observation> {
    let month_ms = 31 * 86_400_000;
    let of = |platform: &str, at_ms: i64, kind, quality| Observation {
        time: time(START_MS + at_ms),
        kind,
        quality,
        ..observation(platform, 0, 285.0 + 1.0 / 3.0)
    };
    let mut rows = vec![
        of("44005", 0, PlatformKind::Buoy, Quality::Good),
        of(
            "polarstern",
            60_000,
            PlatformKind::Ship,
            Quality::NotEvaluated,
        ),
        of(
            "helgoland",
            month_ms - 1,
            PlatformKind::Station,
            Quality::Questionable,
        ),
        of("cast 7", month_ms, PlatformKind::Profile, Quality::Bad),
    ];
    rows[1].lon_deg = -180.0;
    rows[2].lat_deg = 89.999_999_999;
    rows[2].depth_m = -12.5;
    let (property, unit) = ("mole_fraction_of_carbon_dioxide_in_dry_air", "1e-6");
    (rows[3].property, rows[3].unit) = (property.to_owned(), unit.to_owned());
    rows
}

/// What went into the store of version 1: time, longitude, latitude, depth, value.
const OF_1: [(&str, f64, f64, f64, f64); 4] = [
    ("2000-01-01T01:00:00Z", 100.0, 1.0, 0.0, 284.15),
    ("2000-01-01T02:00:00Z", 100.0, 1.0, 0.0, 285.15),
    ("2000-01-01T04:00:00Z", -160.0, 2.0, 0.0, 294.15),
    ("2000-01-01T05:00:00Z", -160.0, 2.0, 0.0, 295.15),
];

async fn write(store: &Store) {
    let files = FileStore::new(store.clone());
    files.upsert(&rows()).await.unwrap();
}

/// What the one index of a store says, but for the names of files: those are of their bytes, and another encoder's are
/// others.
async fn index(store: &Store) -> serde_json::Value {
    let keys = store.list("observation-indexes").await.unwrap();
    assert_eq!(keys.len(), 1);
    let content = store.get(&keys[0]).await.unwrap();
    let mut index: serde_json::Value = serde_json::from_slice(&content).unwrap();
    let seal = index.as_object_mut().unwrap().remove("sha256");
    assert!(seal.is_some());
    for month in index["months"].as_array_mut().unwrap() {
        let file = month.as_object_mut().unwrap().remove("file");
        assert!(file.is_some());
    }
    index["key"] = keys[0].as_str().into();
    index
}

#[tokio::test]
async fn frozen_observations_are_those_that_were_stored() {
    if let Some(folder) = std::env::var_os("FLUXGLOBE_FREEZE").map(PathBuf::from) {
        let objects = folder.join("objects");
        write(&Store::open(objects.to_str().unwrap()).unwrap()).await;
    }
    let (_folder, kept) = store(2);
    assert_eq!(all(&kept).await.unwrap(), rows());
    let now = Store::memory();
    write(&now).await;
    assert_eq!(index(&kept).await, index(&now).await);
    let (_folder, old) = store(1);
    let found = all(&old).await.unwrap();
    let of = |o: &Observation| (o.time, o.lon_deg, o.lat_deg, o.depth_m, o.value);
    let expected =
        OF_1.map(|(at, lon, lat, depth, value)| (at.parse().unwrap(), lon, lat, depth, value));
    assert_eq!(found.iter().map(of).collect::<Vec<_>>(), expected);
    let buoys = found.iter().filter(|o| o.kind == PlatformKind::Buoy);
    assert_eq!(buoys.count(), 4);
}

#[tokio::test]
async fn a_flipped_bit_of_observations_is_an_error_that_names_their_object() {
    for version in [1, 2] {
        let (_folder, store) = store(version);
        for key in store.list("").await.unwrap() {
            let whole = store.get(&key).await.unwrap();
            // The index of version 1 has no seal: where it is JSON still, it is only as right as its names.
            let is_unsealed = version == 1 && key.is_in("observation-indexes");
            for at in (0..whole.len()).step_by(7).filter(|_| !is_unsealed) {
                let mut flipped = whole.to_vec();
                flipped[at] ^= 1 << (at % 8);
                store.put_over(&key, flipped.into()).await.unwrap();
                let error = all(&store).await.expect_err(key.as_str());
                assert!(error.contains(key.as_str()), "{key}, byte {at}: {error}");
            }
            store.put_over(&key, whole).await.unwrap();
        }
        assert!(all(&store).await.is_ok());
    }
}

/// Tables that are there were made by these: what is to change gets a migration of its own.
#[test]
fn migrations_that_were_applied_are_what_they_were() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut lines = vec![];
    for entry in std::fs::read_dir(folder.join("migrations")).unwrap() {
        let path = entry.unwrap().path();
        let sql = std::fs::read(&path).unwrap();
        let name = path.file_name().unwrap().to_str().unwrap();
        lines.push(format!("{} {name}\n", Digest::of(&sql)));
    }
    lines.sort_by(|a, b| a[65..].cmp(&b[65..]));
    let now = lines.concat();
    if let Some(folder) = std::env::var_os("FLUXGLOBE_FREEZE").map(PathBuf::from) {
        std::fs::write(folder.join("migrations.txt"), &now).unwrap();
    }
    let then = folder.join("../storage/tests/frozen/2/migrations.txt");
    let then = std::fs::read_to_string(then).unwrap();
    assert!(now.starts_with(&then), "{then} became {now}");
    assert_eq!(now, then, "freeze the new one too");
}
