//! Runs that are made together: how many commits they are, and what is there where one of them cannot be made.

use std::collections::BTreeSet;
use std::sync::Arc;

use cube::{At, CubeError, Values, compact, follow};
use storage::Store;

use crate::follow::{holds, version};
use crate::product::grid;
use crate::series::answers;

/// Steps of a run.
const RUN: u32 = 128;
const FOLDER: &str = "cubes/p";

/// How many states of the cube there are.
async fn states(store: &Store) -> usize {
    let states = store.list("cubes/p/snapshots").await;
    states.unwrap().len()
}

#[tokio::test]
async fn several_runs_are_one_commit_and_so_are_those_that_a_step_before_all_others_moves() {
    let store = Store::memory();
    let months: Vec<(u32, u32)> = (1..=3 * RUN + 1).map(|of| (of, of)).collect();
    for (number, steps) in [(1, &months[1..]), (2, &months[..])] {
        let manifest = version(&store, grid(9, 11), number, steps).await;
        follow(&store, &manifest).await.unwrap();
        let before = states(&store).await;
        assert_eq!(compact(&store, FOLDER).await.unwrap(), 3);
        assert_eq!(states(&store).await, before + 1);
        assert!(answers(&store, &manifest, steps).await.is_settled());
        holds(&store, At::Newest, &manifest, steps).await;
        assert_eq!(compact(&store, FOLDER).await.unwrap(), 0);
        assert_eq!(states(&store).await, before + 1);
    }
}

#[tokio::test]
async fn runs_before_one_that_cannot_be_made_are_there() {
    let (store, grid) = (Store::memory(), grid(60, 90));
    let months: Vec<(u32, u32)> = (1..=3 * RUN).map(|of| (of, of)).collect();
    let chunks = async || {
        let chunks = store.list("cubes/p/chunks").await.unwrap();
        chunks.into_iter().collect::<BTreeSet<_>>()
    };
    let first = version(&store, grid, 1, &months[..2 * RUN as usize]).await;
    follow(&store, &first).await.unwrap();
    let before = chunks().await;
    let second = version(&store, grid, 2, &months).await;
    follow(&store, &second).await.unwrap();
    // A map of the third run: all else that is new is smaller.
    let mut damaged = 0;
    for key in chunks().await.difference(&before) {
        let mut content = store.get(key).await.unwrap().to_vec();
        if damaged == 0 && content.len() > 10 << 10 {
            let middle = content.len() / 2;
            content[middle] ^= 1;
            store.put_over(key, content.into()).await.unwrap();
            damaged += 1;
        }
    }
    assert_eq!(damaged, 1);
    let before = states(&store).await;
    for _attempt in 0..2 {
        let refused = compact(&store, FOLDER).await;
        assert!(
            matches!(refused, Err(CubeError::Chunk { .. })),
            "{refused:?}"
        );
        assert_eq!(states(&store).await, before + 1, "the first two, once");
    }
    let found = Values::of(&store, &Arc::new(second)).await.unwrap();
    assert_eq!(found.time_major(), [0..128, 128..256]);
}
