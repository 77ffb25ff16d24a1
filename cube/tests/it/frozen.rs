//! A cube as an earlier version of this program wrote it (`storage/tests/frozen`).

use std::path::{Path, PathBuf};

use contract::manifest::{MANIFEST_SCHEMA, Manifest};
use cube::{At, Repository, folder, follow};
use storage::{Store, fields, manifests};

use crate::product::bits;

fn frozen(version: u32) -> PathBuf {
    let frozen = Path::new(env!("CARGO_MANIFEST_DIR")).join("../storage/tests/frozen");
    frozen.join(version.to_string()).join("objects")
}

/// A copy of a frozen store.
fn copy(version: u32) -> (tempfile::TempDir, Store) {
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
    copy_all(&frozen(version), folder.path());
    let store = Store::open(folder.path().to_str().unwrap()).unwrap();
    (folder, store)
}

async fn newest(store: &Store) -> Manifest {
    let found = manifests::latest(store, &"fgco2".parse().unwrap()).await;
    found.unwrap().unwrap()
}

/// Does a cube hold the fields of a version, by this name?
async fn holds(store: &Store, manifest: &Manifest, at: At) {
    let repository = Repository::open(store, &folder(&manifest.product)).await;
    let cube = repository.unwrap().at(&at).await.unwrap();
    assert_eq!(cube.description().version, Some(manifest.id()));
    assert_eq!(cube.steps().len(), manifest.steps.len());
    for (place, step) in manifest.steps.iter().enumerate() {
        assert_eq!(cube.steps()[place].period, step.period);
        let field = fields::read(store, &step.field, &manifest.grid)
            .await
            .unwrap();
        let found = cube.field(place).await.unwrap();
        assert_eq!(bits(&found), bits(&field), "step {place}");
    }
}

#[tokio::test]
async fn a_frozen_cube_holds_the_values_of_its_versions() {
    if let Some(to_freeze) = std::env::var_os("FLUXGLOBE_FREEZE").map(PathBuf::from) {
        let objects = to_freeze.join("objects");
        let store = Store::open(objects.to_str().unwrap()).unwrap();
        follow(&store, &newest(&store).await).await.unwrap();
    }
    for version in 2..=MANIFEST_SCHEMA {
        let (_folder, store) = copy(version);
        let manifest = newest(&store).await;
        let tag = manifest.number.to_string();
        holds(&store, &manifest, At::Version(tag)).await;
        holds(&store, &manifest, At::Newest).await;
        let followed = follow(&store, &manifest).await.unwrap();
        assert_eq!((followed.put_count, followed.version), (0, manifest.id()));
    }
}

/// Fields that are named by their bytes say nothing of their values; the version before says whether they changed.
#[tokio::test]
async fn fields_under_names_of_before_are_put_once() {
    let (_folder, store) = copy(1);
    let mut manifest = newest(&store).await;
    let followed = follow(&store, &manifest).await.unwrap();
    assert_eq!(followed.put_count, manifest.steps.len());
    holds(&store, &manifest, At::Newest).await;
    let (first, last) = (manifest.steps[0].clone(), manifest.steps.pop().unwrap());
    for steps in [vec![first.clone()], vec![first, last]] {
        let is_back = steps.len() == 2;
        (manifest.schema, manifest.steps) = (MANIFEST_SCHEMA, steps);
        manifest.number += 1;
        manifests::commit(&store, &manifest).await.unwrap();
        let followed = follow(&store, &manifest).await.unwrap();
        assert_eq!(followed.put_count, usize::from(is_back));
        holds(&store, &manifest, At::Newest).await;
    }
}
