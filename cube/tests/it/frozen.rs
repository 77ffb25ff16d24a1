//! A cube as an earlier version of this program wrote it (`storage/tests/frozen`).

use std::path::{Path, PathBuf};
use std::sync::Arc;

use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::manifest::{MANIFEST_SCHEMA, Manifest};
use contract::quantity::Quantity;
use cube::{At, Edit, Repository, Values, compact, folder, follow};
use storage::{Store, fields, manifests};

use crate::product::{bits, description, grid, month};

fn frozen(version: u32) -> PathBuf {
    let frozen = Path::new(env!("CARGO_MANIFEST_DIR")).join("../storage/tests/frozen");
    frozen.join(version.to_string()).join("objects")
}

/// A copy of a frozen store.
pub(crate) fn copy(version: u32) -> (tempfile::TempDir, Store) {
    copy_of(&frozen(version))
}

fn copy_of(frozen: &Path) -> (tempfile::TempDir, Store) {
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
    copy_all(frozen, folder.path());
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

/// Two rows and two columns of blocks, all of them cut but one, and steps that are made time-major at once.
const SUMMED: [u32; 2] = [9, 11];
const SUMMED_STEPS: usize = 16;

fn flux(step: usize, cell: usize) -> f32 {
    match (cell * 5 + step) % 7 {
        0 => f32::NAN,
        at => (at as f32 - 3.0) * 2.5e-9,
    }
}

/// The same steps as a version of a product.
async fn summed_version(grid: Grid) -> Manifest {
    let mut manifest = crate::follow::version(&Store::memory(), grid, 1, &[(1, 1)]).await;
    let blank = manifest.steps.remove(0);
    for step in 0..SUMMED_STEPS {
        let mut own = blank.clone();
        own.period = month(step as u32 + 1);
        let values: Vec<f32> = (0..grid.cell_count())
            .map(|cell| flux(step, cell))
            .collect();
        let digest = fields::digest_of(&grid, &values, own.period);
        own.field = ObjectKey::field(&manifest.product, &digest);
        manifest.steps.push(own);
    }
    manifest
}

#[tokio::test]
async fn frozen_sums_are_those_of_their_values() {
    let grid = grid(SUMMED[0], SUMMED[1]);
    if let Some(to_freeze) = std::env::var_os("FLUXGLOBE_FREEZE").map(PathBuf::from) {
        let store = Store::open(to_freeze.join("sums").to_str().unwrap()).unwrap();
        let description = description(Quantity::CarbonFlux, grid);
        let made = Repository::create(&store, "cubes/p", &description).await;
        let repository = made.unwrap();
        let mut edit = Edit::begin(&repository).await.unwrap();
        for step in 0..SUMMED_STEPS {
            let values: Arc<[f32]> = (0..grid.cell_count())
                .map(|cell| flux(step, cell))
                .collect();
            edit.put(month(step as u32 + 1), values).await.unwrap();
        }
        edit.commit("to freeze").await.unwrap();
        assert_eq!(compact(&store, "cubes/p").await.unwrap(), 1);
    }
    let sums = frozen(MANIFEST_SCHEMA).with_file_name("sums");
    let (_folder, store) = copy_of(&sums);
    let manifest = Arc::new(summed_version(grid).await);
    let steps = 0..SUMMED_STEPS;
    // Its copy along time has the order of before: nobody reads it, and it is made anew.
    let before = Values::of(&store, &manifest).await.unwrap();
    assert!(before.time_major().is_empty() && before.summed_as(&steps).is_none());
    assert_eq!(compact(&store, "cubes/p").await.unwrap(), 1);
    let values = Values::of(&store, &manifest).await.unwrap();
    assert_eq!(values.time_major(), std::slice::from_ref(&steps));
    let cell = values.cell(3, 5).await.unwrap();
    let own: Vec<f32> = steps
        .clone()
        .map(|step| flux(step, (3 * SUMMED[1] + 5) as usize))
        .collect();
    assert_eq!(bits(&cell), bits(&own));
    let basis = values.summed_as(&steps).unwrap();
    assert_eq!(basis.row_weights.len(), SUMMED[0] as usize);
    let blocks = [[0, 0], [0, 1], [1, 0], [1, 1]];
    let found = values.sums(&blocks, steps.clone()).await.unwrap().unwrap();
    let mut count = 0;
    let sound = found.each(
        |_| cube::Numbers::SumsAndSquares,
        |number, record| {
            let ([row, col], mut asked) = (blocks[number].map(|at| at * 8), 0);
            for step in steps.clone() {
                let (mut held, mut weight, mut sum, mut squares) = (0, 0, 0, 0);
                for row in row..(row + 8).min(SUMMED[0]) {
                    for col in 0..(col + 8).min(SUMMED[1]) {
                        let value = flux(step, (row * SUMMED[1] + col) as usize);
                        if value.is_nan() {
                            continue;
                        }
                        let own = basis.row_weights[row as usize];
                        held += 1;
                        weight += own;
                        sum += i128::from(own) * i128::from(basis.scale.steps(value));
                        squares += i128::from(own) * i128::from(basis.scale.square_steps(value));
                    }
                }
                assert_eq!((record.counts[step], record.weights[step]), (held, weight));
                assert_eq!((record.sums[step], record.squares[step]), (sum, squares));
                asked += 1;
            }
            count += 1;
            asked == SUMMED_STEPS
        },
    );
    assert!(sound.is_ok());
    assert_eq!((count, found.pieces().len()), (4, 1));
}
