//! Products of before, whose values lie in fields alone, brought over: every kept version, its values, and what is refused.

use std::collections::BTreeSet;
use std::future::{Future as _, poll_fn};
use std::pin::pin;
use std::sync::{Arc, Mutex};
use std::task::Poll;
use std::time::Duration;

use contract::key::ObjectKey;
use contract::manifest::{Manifest, OLDEST_MANIFEST_SCHEMA};
use contract::time::Period;
use cube::migrate::{Migrated, Stage, migrate};
use cube::{At, CubeError, Edit, Repository, clean_up, follow};
use storage::gc::Keep;
use storage::{Store, manifests};

use crate::follow::{holds, version};
use crate::kept::in_hours;
use crate::product::{bits, grid, month, stores, values};

const STEPS: [&[(u32, u32)]; 4] = [
    &[(1, 1), (2, 2), (4, 4)],
    // One revised, one before another.
    &[(1, 1), (2, 20), (3, 3), (4, 4)],
    // One dropped in the middle, and the last.
    &[(1, 1), (3, 3)],
    &[(1, 1), (3, 3), (5, 5)],
];

/// A product of four versions, without a cube.
async fn published(store: &Store) -> Vec<Manifest> {
    let mut all = vec![];
    for (at, steps) in STEPS.iter().enumerate() {
        let manifest = version(store, grid(60, 90), at as u64 + 1, steps).await;
        manifests::commit(store, &manifest).await.unwrap();
        all.push(manifest);
    }
    all
}

async fn brought_over(store: &Store) -> Result<Migrated, CubeError> {
    migrate(store, &"p".parse().unwrap(), &|_stage| ()).await
}

async fn all_hold(store: &Store, versions: &[Manifest]) {
    for (manifest, steps) in versions.iter().zip(STEPS) {
        let tag = At::Version(manifest.number.to_string());
        holds(store, tag, manifest, steps).await;
    }
    holds(store, At::Newest, &versions[3], STEPS[3]).await;
}

async fn objects(store: &Store) -> BTreeSet<ObjectKey> {
    store.list("").await.unwrap().into_iter().collect()
}

#[tokio::test]
async fn every_kept_version_is_brought_over_once_and_nothing_else_changes() {
    let (_folder, stores) = stores();
    for store in stores {
        let versions = published(&store).await;
        let before = objects(&store).await;
        let told = Mutex::new(vec![]);
        let tell = |stage| told.lock().unwrap().push(stage);
        let migrated = migrate(&store, &"p".parse().unwrap(), &tell).await.unwrap();
        let of = |migrated: &Migrated, count: fn(&cube::migrate::Version) -> usize| {
            migrated.versions.iter().map(count).collect::<Vec<_>>()
        };
        assert_eq!(of(&migrated, |it| it.put_count), [3, 2, 0, 1]);
        // What lies elsewhere than in an older version is compared anew: the fourth month, and the third.
        assert_eq!(of(&migrated, |it| it.compared_count), [3, 3, 1, 1]);
        assert_eq!(migrated.findings, []);
        let told = told.into_inner().unwrap();
        let told = |is: fn(&Stage) -> bool| told.iter().filter(|stage| is(stage)).count();
        assert_eq!(told(|it| matches!(it, Stage::Put(_))), 6);
        // All of the newest state, too.
        assert_eq!(told(|it| matches!(it, Stage::Compared(_))), 8 + 3);
        all_hold(&store, &versions).await;
        let after = objects(&store).await;
        let new: Vec<_> = after.difference(&before).collect();
        assert!(new.iter().all(|key| key.is_in("cubes/p")), "{new:?}");
        assert!(after.is_superset(&before));
        // The same again makes nothing and compares all.
        let again = brought_over(&store).await.unwrap();
        assert_eq!(of(&again, |it| it.put_count), [0; 4]);
        assert_eq!(of(&again, |it| it.compared_count), [3, 3, 1, 1]);
        assert_eq!(objects(&store).await, after);
    }
}

#[tokio::test]
async fn older_versions_than_the_cube_is_of_get_their_names_beside_it_and_keep_them() {
    let (_folder, stores) = stores();
    for store in stores {
        let versions = published(&store).await;
        // As a landing leaves it that finds a store of before.
        follow(&store, &versions[3]).await.unwrap();
        let repository = Repository::open(&store, "cubes/p").await.unwrap();
        assert_eq!(repository.versions().await.unwrap(), ["4"]);
        let migrated = brought_over(&store).await.unwrap();
        let put: Vec<usize> = migrated.versions.iter().map(|it| it.put_count).collect();
        // What the newest version holds is not put again, and nothing leads from one older version to the next.
        assert_eq!(put, [2, 2, 0, 0]);
        all_hold(&store, &versions).await;
        // They are no garbage, and the newest goes on as if nothing was.
        let keep = Keep {
            versions: 10,
            age: Duration::from_hours(1),
        };
        let cleaned = clean_up::run(&store, keep, in_hours(2), false).await;
        assert_eq!(cleaned.unwrap()[0].versions, [""; 0]);
        all_hold(&store, &versions).await;
        let steps = &[(1, 1), (3, 3), (5, 5), (6, 6)];
        let next = version(&store, grid(60, 90), 5, steps).await;
        assert_eq!(follow(&store, &next).await.unwrap().put_count, 1);
        holds(&store, At::Newest, &next, steps).await;
        for (manifest, steps) in versions.iter().zip(STEPS) {
            let tag = At::Version(manifest.number.to_string());
            holds(&store, tag, manifest, steps).await;
        }
    }
}

#[tokio::test]
async fn killed_anywhere_the_next_one_goes_on() {
    let (mut answers, mut is_done) = (0, false);
    while !is_done {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(folder.path().to_str().unwrap()).unwrap();
        let versions = published(&store).await;
        follow(&store, &versions[2]).await.unwrap();
        let product = "p".parse().unwrap();
        {
            let mut migrating = pin!(migrate(&store, &product, &|_stage| ()));
            let mut count = 0;
            is_done = poll_fn(|context| {
                if count == answers {
                    return Poll::Ready(false);
                }
                count += 1;
                let polled = migrating.as_mut().poll(context);
                polled.map(|migrated| migrated.is_ok())
            })
            .await;
        }
        brought_over(&store).await.unwrap();
        all_hold(&store, &versions).await;
        answers += 23;
    }
    assert!(answers > 60, "{answers}");
}

/// Another value in one cell of a step, committed to the cube as if it were the version's.
async fn change(store: &Store, grid: contract::grid::Grid, of: Period, seed: u32) -> usize {
    let repository = Repository::open(store, "cubes/p").await.unwrap();
    let mut edit = Edit::begin(&repository).await.unwrap();
    let mut other = values(&grid, seed).to_vec();
    let cell = 7 * grid.cols as usize + 5;
    other[cell] = f32::from_bits(other[cell].to_bits() ^ 1);
    edit.put(of, Arc::from(other)).await.unwrap();
    edit.commit("a lie").await.unwrap();
    cell
}

#[tokio::test]
async fn one_bit_that_differs_is_refused_with_array_step_and_cell() {
    let store = Store::memory();
    let versions = published(&store).await;
    brought_over(&store).await.unwrap();
    change(&store, versions[3].grid, month(3), 3).await;
    let error = brought_over(&store).await.unwrap_err();
    assert!(matches!(error, CubeError::Differs { .. }), "{error}");
    let text = error.to_string();
    let step = format!("step {}", month(3));
    let id = versions[3].id().to_string();
    for part in ["carbon_flux", &step, "row 7, column 5", &id, "frames/p/"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    // The field of an older version that is damaged is named, and nothing is made of it.
    let store = Store::memory();
    let versions = published(&store).await;
    let field = &versions[1].steps[1].field;
    let mut content = store.get(field).await.unwrap().to_vec();
    content[60] ^= 1;
    store.put_over(field, content.into()).await.unwrap();
    let error = brought_over(&store).await.unwrap_err().to_string();
    assert!(error.contains(field.as_str()), "{error}");
    // One version of two is over.
    holds(&store, At::Newest, &versions[0], STEPS[0]).await;
}

#[tokio::test]
async fn frozen_stores_are_brought_over_with_their_values() {
    for schema in [OLDEST_MANIFEST_SCHEMA, 2] {
        let (_folder, store) = crate::frozen::copy(schema);
        for product in manifests::products(&store).await.unwrap() {
            let told = &|_stage| ();
            let migrated = migrate(&store, &product, told).await.unwrap();
            assert_eq!(migrated.findings, []);
            let numbers = manifests::numbers(&store, &product).await.unwrap();
            assert_eq!(migrated.versions.len(), numbers.len());
            for number in numbers {
                let manifest = manifests::numbered(&store, &product, number).await;
                let manifest = manifest.unwrap().unwrap();
                let repository = Repository::open(&store, &cube::folder(&product)).await;
                let tag = At::Version(number.to_string());
                let cube = repository.unwrap().at(&tag).await.unwrap();
                assert_eq!(cube.description().version, Some(manifest.id()));
                for (place, step) in manifest.steps.iter().enumerate() {
                    let field = storage::fields::read(&store, &step.field, &manifest.grid);
                    let found = cube.field(place).await.unwrap();
                    assert_eq!(bits(&found), bits(&field.await.unwrap()), "step {place}");
                }
            }
        }
    }
}
