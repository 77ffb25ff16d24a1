//! Clean-up of files of killed writers.

use std::fs::File;
use std::path::Path;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use compute::gc::Computed;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::quantity::Quantity;
use contract::time::TimeMs;
use storage::gc::{self, Keep, Owner, Versions};
use storage::{Store, fields};

use crate::fixture::{folder_store, land, months, product};

const DAY_MS: i64 = 86_400_000;
const DAY: Duration = Duration::from_hours(24);
const KEEP: Keep = Keep {
    versions: 1,
    age: DAY,
};
const OWNERS: [&dyn Owner; 2] = [&Versions, &Computed];

fn in_days(days: i64) -> TimeMs {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
    TimeMs::new(since.as_millis() as i64 + days * DAY_MS).unwrap()
}

fn key(text: &str) -> ObjectKey {
    text.parse().unwrap()
}

async fn put(store: &Store, name: &str, content: &str) -> ObjectKey {
    let key = key(name);
    store
        .put_new(&key, content.to_owned().into())
        .await
        .unwrap();
    key
}

#[tokio::test(flavor = "multi_thread")]
async fn files_of_killed_writers_go_and_those_of_living_ones_stay() {
    let (folder, store) = folder_store();
    let object = put(&store, "weights/x.parquet", "whole").await;
    let aged = |name: &str, age: Duration| {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, "half").unwrap();
        let file = File::options().append(true).open(&path).unwrap();
        file.set_modified(SystemTime::now() - age).unwrap();
        path
    };
    let dead = aged("frames/p/abc.parquet#4242000001", 2 * DAY);
    let living = aged("frames/p/abc.parquet#4243000001", DAY / 2);
    // Of somebody else, who names files in another way.
    let foreign = aged("frames/p/notes#draft", 2 * DAY);
    let plan = gc::plan(&store, &OWNERS, KEEP, in_days(0)).await.unwrap();
    let paths: Vec<&str> = plan.leftovers.iter().map(|l| l.path.as_str()).collect();
    assert_eq!(paths, ["frames/p/abc.parquet#4242000001"]);
    assert_eq!((plan.count(), plan.size_bytes()), (1, 4));
    assert!(dead.exists(), "a plan removes nothing");
    let removed = gc::run(&store, &OWNERS, &plan, KEEP, &|_done| ())
        .await
        .unwrap();
    assert_eq!(removed, 1);
    assert!(!dead.exists() && living.exists() && foreign.exists());
    assert!(Path::new(&folder.path().join(object.as_str())).exists());
    // Asked to keep nothing, it keeps what is younger than an hour all the same.
    let greedy = Keep {
        age: Duration::ZERO,
        ..KEEP
    };
    let fresh = aged("raw/p/abc#4244000001", Duration::from_mins(5));
    let plan = gc::plan(&store, &OWNERS, greedy, in_days(0)).await.unwrap();
    assert_eq!(plan.leftovers.len(), 1, "{:?}", plan.leftovers);
    gc::run(&store, &OWNERS, &plan, greedy, &|_done| ())
        .await
        .unwrap();
    assert!(fresh.exists() && !living.exists());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_version_that_stays_for_its_age_keeps_all_that_it_is_made_of() {
    const GRID: Grid = Grid {
        rows: 2,
        cols: 3,
        north_deg: 10.0,
        west_deg: 0.0,
        dlat_deg: 1.0,
        dlon_deg: 1.0,
    };
    let (folder, store) = folder_store();
    let (flux, periods) = (product("flux"), months(2000));
    let step = |month: usize, value: f32| (periods[month], vec![value; GRID.cell_count()]);
    let mut versions = vec![];
    // The second version has the first month as it was, the third one has it revised.
    for steps in [
        vec![step(0, 1e-9)],
        vec![step(0, 1e-9), step(1, 2e-9)],
        vec![step(0, 3e-9), step(1, 2e-9)],
    ] {
        versions.push(land(&store, &flux, Quantity::CarbonFlux, GRID, &steps).await);
    }
    let young = [2, 3].map(|number| ObjectKey::manifest(&flux, number));
    for key in store.list("").await.unwrap() {
        if !young.contains(&key) {
            let path = folder.path().join(key.as_str());
            let file = File::options().append(true).open(&path).unwrap();
            file.set_modified(SystemTime::now() - 3 * DAY).unwrap();
        }
    }
    let plan = gc::plan(&store, &OWNERS, KEEP, in_days(0)).await.unwrap();
    let keys: Vec<&ObjectKey> = plan.garbage.iter().map(|garbage| &garbage.key).collect();
    assert_eq!(keys, [&ObjectKey::manifest(&flux, 1)]);
    gc::run(&store, &OWNERS, &plan, KEEP, &|_done| ())
        .await
        .unwrap();
    let revised = &versions[1].steps[0].field;
    let values = fields::read(&store, revised, &GRID).await.unwrap();
    assert_eq!(values[0].to_bits(), 1e-9_f32.to_bits());
    // It goes with what only it names.
    let plan = gc::plan(&store, &OWNERS, KEEP, in_days(2)).await.unwrap();
    let keys: Vec<&ObjectKey> = plan.garbage.iter().map(|garbage| &garbage.key).collect();
    assert_eq!(keys, [&ObjectKey::manifest(&flux, 2), revised]);
}
