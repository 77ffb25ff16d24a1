//! What one more step reads of a cube: its times and digests once each, and none of them where this process has committed the step before.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex};

use contract::grid::Grid;
use cube::{At, Repository, compact, follow};
use futures::FutureExt as _;
use storage::Store;

use crate::follow::version;
use crate::product::{grid, month};
use crate::watched::watched;

/// So many digests are more than a manifest holds in itself, and the last run waits for more steps before it is made anew.
const STEPS: u32 = 40;

/// Keys of chunks, with how often each was read.
type Reads = Arc<Mutex<BTreeMap<String, usize>>>;

/// The same store, and what is read of chunks of cubes from now on.
fn counted(store: &Store) -> (Store, Reads) {
    let reads = Reads::default();
    let counts = Arc::clone(&reads);
    let (store, _removed) = watched(store, move |key| {
        if key.starts_with("cubes/p/chunks/") {
            *counts.lock().unwrap().entry(key.to_owned()).or_default() += 1;
        }
        async { Ok(()) }.boxed()
    });
    (store, reads)
}

/// The cube of a version of so many steps, and of one more for each version that follows it.
async fn land(store: &Store, grid: Grid, number: u64) {
    let count = STEPS + number as u32 - 1;
    let steps: Vec<(u32, u32)> = (1..=count).map(|of| (of, of)).collect();
    let manifest = version(store, grid, number, &steps).await;
    follow(store, &manifest).await.unwrap();
}

#[tokio::test]
async fn one_more_step_and_what_is_made_behind_it_reads_no_chunk_twice() {
    // The second grid has a coarser level, whose digests are those of the steps.
    for grid in [grid(20, 30), grid(2, 600)] {
        let folder = tempfile::tempdir().unwrap();
        let [here, there] = ["here", "there"].map(|name| folder.path().join(name));
        let open = |folder: &Path| Store::open(folder.to_str().unwrap()).unwrap();
        let store = open(&here);
        land(&store, grid, 1).await;
        assert_eq!(compact(&store, "cubes/p").await.unwrap(), 1);
        // Of a cube in another place this process holds nothing.
        std::fs::rename(&here, &there).unwrap();
        let (store, reads) = counted(&open(&there));
        land(&store, grid, 2).await;
        assert_eq!(compact(&store, "cubes/p").await.unwrap(), 0);
        let reads = reads.lock().unwrap();
        assert!(!reads.is_empty(), "this test counts nothing");
        assert!(reads.values().all(|count| *count == 1), "{reads:?}");
    }
}

#[tokio::test]
async fn versions_one_after_the_other_read_no_times_and_digests_of_what_was_just_committed() {
    let store = Store::memory();
    let grid = grid(20, 30);
    land(&store, grid, 1).await;
    assert_eq!(compact(&store, "cubes/p").await.unwrap(), 1);
    let (store, reads) = counted(&store);
    // The first of them lies over the state that the run was placed in.
    for number in 2..6 {
        land(&store, grid, number).await;
        assert_eq!(compact(&store, "cubes/p").await.unwrap(), 0);
    }
    assert!(reads.lock().unwrap().is_empty(), "{reads:?}");
    // Whoever opens it reads what is stored: the same steps.
    let repository = Repository::open(&store, "cubes/p").await.unwrap();
    let cube = repository.at(&At::Newest).await.unwrap();
    let periods: Vec<_> = cube.steps().iter().map(|step| step.period).collect();
    assert_eq!(periods, (1..=STEPS + 4).map(month).collect::<Vec<_>>());
    assert!(
        !reads.lock().unwrap().is_empty(),
        "this test counts nothing"
    );
}
