//! Clean-up of what is beside versions of products: notes, indexes of observations, readings, files of killed writers.

use std::fs::File;
use std::path::Path;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use compute::gc::{self, Keep};
use contract::digest::Digest;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::quantity::Quantity;
use contract::time::TimeMs;
use storage::Store;

use crate::fixture::{folder_store, land, product, wavy_year};

const DAY_MS: i64 = 86_400_000;
const DAY: Duration = Duration::from_hours(24);
const KEEP: Keep = Keep {
    versions: 1,
    age: DAY,
};
const SMALL: Grid = Grid {
    rows: 18,
    cols: 36,
    north_deg: 90.0,
    west_deg: -180.0,
    dlat_deg: 10.0,
    dlon_deg: 10.0,
};

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

async fn doomed(store: &Store, days: i64) -> Vec<String> {
    let plan = gc::plan(store, KEEP, in_days(days)).await.unwrap();
    plan.garbage.iter().map(|g| g.key.to_string()).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn notes_of_landings_stay_as_long_as_a_notice_may_come_again() {
    let (_folder, store) = folder_store();
    let note = format!("landings/flux/{}-3-17", Digest::of(b"raw"));
    put(&store, &note, "granule.notice/3/17").await;
    assert!(doomed(&store, 0).await.is_empty());
    // Other old things go after a day; a topic keeps notices for 30.
    assert!(doomed(&store, 31).await.is_empty());
    assert_eq!(doomed(&store, 46).await, [note]);
}

#[tokio::test(flavor = "multi_thread")]
async fn old_indexes_of_observations_go_with_the_files_that_only_they_name() {
    let (_folder, store) = folder_store();
    let file = |name: &str| format!("observations/buoys/{}.parquet", Digest::of(name.as_bytes()));
    for name in ["january", "january-again", "february", "nobody's"] {
        put(&store, &file(name), name).await;
    }
    let index = |number: u64, names: &[&str]| {
        let months: Vec<_> = names
            .iter()
            .map(|name| serde_json::json!({"year": 2000, "rows": 1, "file": file(name)}))
            .collect();
        serde_json::json!({"schema": 1, "dataset": "buoys", "number": number, "months": months})
            .to_string()
    };
    let first = "observation-indexes/buoys/0000000001.json";
    put(&store, first, &index(1, &["january"])).await;
    let second = "observation-indexes/buoys/0000000002.json";
    put(&store, second, &index(2, &["january-again", "february"])).await;
    assert!(doomed(&store, 0).await.is_empty());
    let mut expected = vec![file("january"), file("nobody's")];
    expected.sort();
    expected.insert(0, first.to_owned());
    assert_eq!(doomed(&store, 2).await, expected);
    // An index that is not understood names nobody knows what: nothing is removed.
    let third = "observation-indexes/buoys/0000000003.json";
    put(&store, third, r#"{"schema": 2, "months": []}"#).await;
    assert!(gc::plan(&store, KEEP, in_days(2)).await.is_err());
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_known_of_a_raw_file_goes_with_it() {
    let (_folder, store) = folder_store();
    let year = wavy_year(&SMALL);
    let (id, flux) = (product("wavy"), Quantity::CarbonFlux);
    let manifest = land(&store, &id, flux, SMALL, &year, 12).await;
    let reading = |raw: Digest| format!("readings/wavy/{raw}-{}", Digest::of(b"recipe"));
    let (living, dead) = (
        reading(manifest.steps[0].raw_sha256),
        reading(Digest::of(b"a file that was revised")),
    );
    put(&store, &living, "{}").await;
    put(&store, &dead, "{}").await;
    assert!(doomed(&store, 0).await.is_empty());
    assert_eq!(doomed(&store, 2).await, [dead]);
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
    let plan = gc::plan(&store, KEEP, in_days(0)).await.unwrap();
    let paths: Vec<&str> = plan.leftovers.iter().map(|l| l.path.as_str()).collect();
    assert_eq!(paths, ["frames/p/abc.parquet#4242000001"]);
    assert_eq!((plan.count(), plan.size_bytes()), (1, 4));
    assert!(dead.exists(), "a plan removes nothing");
    let removed = gc::run(&store, &plan, KEEP, &|_done| ()).await.unwrap();
    assert_eq!(removed, 1);
    assert!(!dead.exists() && living.exists() && foreign.exists());
    assert!(Path::new(&folder.path().join(object.as_str())).exists());
    // Asked to keep nothing, it keeps what is younger than an hour all the same.
    let greedy = Keep {
        age: Duration::ZERO,
        ..KEEP
    };
    let fresh = aged("raw/p/abc#4244000001", Duration::from_mins(5));
    let plan = gc::plan(&store, greedy, in_days(0)).await.unwrap();
    assert_eq!(plan.leftovers.len(), 1, "{:?}", plan.leftovers);
    gc::run(&store, &plan, greedy, &|_done| ()).await.unwrap();
    assert!(fresh.exists() && !living.exists());
}
