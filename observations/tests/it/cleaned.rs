//! Clean-up of files of observations.

use std::fs::File;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use contract::observation::Observation;
use contract::time::TimeMs;
use observations::{Datasets, FileStore, ObservationStore as _};
use storage::Store;
use storage::gc::{self, Keep, Owner};

use crate::sample::observation;

const OWNERS: [&dyn Owner; 1] = [&Datasets];
const KEEP: Keep = Keep {
    versions: 1,
    age: Duration::from_hours(24),
};
/// Minutes of a month and a day.
const NEXT_MONTH: i64 = 32 * 24 * 60;

fn in_days(days: i64) -> TimeMs {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
    TimeMs::new(since.as_millis() as i64 + days * 86_400_000).unwrap()
}

async fn doomed(store: &Store, days: i64) -> Vec<String> {
    let plan = gc::plan(store, &OWNERS, KEEP, in_days(days)).await.unwrap();
    plan.garbage.iter().map(|g| g.key.to_string()).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn old_indexes_go_with_the_files_that_only_they_name() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path().to_str().unwrap()).unwrap();
    let home = FileStore::new(store.clone());
    let put = |rows: Vec<Observation>| {
        let home = home.clone();
        async move { home.upsert(&rows).await.unwrap() }
    };
    let files = || async {
        let keys = store.list("observations/buoys").await.unwrap();
        keys.iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    put(vec![
        observation("a", 0, 290.0),
        observation("a", NEXT_MONTH, 290.0),
    ])
    .await;
    let first = files().await;
    put(vec![observation("a", 0, 291.0)]).await;
    let second = files().await;
    assert_eq!((first.len(), second.len()), (2, 3));
    // Of somebody who was killed before the index named it.
    let nobodys = "observations/buoys/0.parquet";
    store
        .put_new(&nobodys.parse().unwrap(), "rows".into())
        .await
        .unwrap();
    assert!(doomed(&store, 0).await.is_empty());
    let gone = doomed(&store, 2).await;
    assert_eq!(gone[0], "observation-indexes/buoys/0000000001.json");
    assert_eq!(gone.len(), 3, "{gone:?}");
    assert!(gone.contains(&nobodys.to_owned()));
    // February's file is named by both indexes, January's first one by the old index alone.
    let plan = gc::plan(&store, &OWNERS, KEEP, in_days(2)).await.unwrap();
    gc::run(&store, &OWNERS, &plan, KEEP, &|_done| ())
        .await
        .unwrap();
    let page = home.query(&observations::Filter::default()).await.unwrap();
    let values: Vec<f64> = page.observations.iter().map(|o| o.value).collect();
    assert_eq!(values, [291.0, 290.0]);
}

#[tokio::test(flavor = "multi_thread")]
async fn an_index_that_stays_for_its_age_keeps_the_files_that_it_names() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path().to_str().unwrap()).unwrap();
    let home = FileStore::new(store.clone());
    // The second index names January as it was, the third one as it was revised.
    for (minute, value) in [(0, 290.0), (NEXT_MONTH, 290.0), (0, 291.0)] {
        let row = observation("a", minute, value);
        home.upsert(&[row]).await.unwrap();
    }
    let index = |number: u32| format!("observation-indexes/buoys/{number:010}.json");
    let young = [index(2), index(3)];
    for key in store.list("").await.unwrap() {
        if !young.contains(&key.to_string()) {
            let path = folder.path().join(key.as_str());
            let file = File::options().append(true).open(&path).unwrap();
            let age = Duration::from_hours(72);
            file.set_modified(SystemTime::now() - age).unwrap();
        }
    }
    assert_eq!(doomed(&store, 0).await, [index(1)]);
    assert_eq!(doomed(&store, 2).await[..2], [index(1), index(2)]);
}

#[tokio::test(flavor = "multi_thread")]
async fn an_index_that_is_not_understood_stops_everything() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path().to_str().unwrap()).unwrap();
    let index = "observation-indexes/buoys/0000000001.json".parse().unwrap();
    let content = r#"{"schema": 2, "months": []}"#;
    store.put_new(&index, content.into()).await.unwrap();
    assert!(
        gc::plan(&store, &OWNERS, KEEP, in_days(2)).await.is_err(),
        "it names nobody knows what"
    );
}
