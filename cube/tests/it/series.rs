//! Values along time: the same bits from time-major runs, from map-major chunks and from fields, whatever became of the cube.

use std::collections::BTreeSet;
use std::future::{Future as _, poll_fn};
use std::pin::pin;
use std::sync::Arc;
use std::task::Poll;

use contract::grid::Grid;
use contract::manifest::Manifest;
use contract::quantity::Quantity;
use cube::{At, BLOCK_CELLS, CubeError, Edit, Repository, Values, compact, follow, verify};
use storage::{Store, manifests};

use crate::follow::{holds, version};
use crate::product::{bits, description, grid, month, stores, values};

/// Steps of a run.
const RUN: usize = 128;
const FOLDER: &str = "cubes/p";

/// So many months, each with values of its own.
fn months(count: usize) -> Vec<(u32, u32)> {
    (1..=count as u32).map(|of| (of, of)).collect()
}

/// What a cell holds in these steps.
fn series(grid: &Grid, steps: &[(u32, u32)], row: u32, col: u32) -> Vec<f32> {
    let index = (row * grid.cols + col) as usize;
    let value = |(_, seed): &(u32, u32)| values(grid, *seed)[index];
    steps.iter().map(value).collect()
}

/// Has the version these values at some cells, and in the blocks that hold them?
pub(crate) async fn answers(store: &Store, manifest: &Manifest, steps: &[(u32, u32)]) -> Values {
    let (grid, of) = (manifest.grid, Arc::new(manifest.clone()));
    let found = Values::of(store, &of).await.unwrap();
    let last = (grid.rows - 1, grid.cols - 1);
    for (row, col) in [(0, 0), (7, 8), (last.0.min(13), last.1.min(17)), last] {
        let own = series(&grid, steps, row, col);
        let cell = found.cell(row, col).await.unwrap();
        assert_eq!(bits(&cell), bits(&own), "{row}, {col}");
        let block = [row / BLOCK_CELLS, col / BLOCK_CELLS];
        // Begins and ends within runs.
        let some = 3.min(steps.len())..steps.len().saturating_sub(2).max(3.min(steps.len()));
        let blocks = found.blocks(&[[0, 0], block], some.clone()).await.unwrap();
        let window = blocks[1].window;
        let at = (row - window.row) * window.cols + col - window.col;
        let run = blocks[1]
            .values
            .chunks_exact(some.len().max(1))
            .nth(at as usize);
        assert_eq!(
            bits(run.unwrap_or_default()),
            bits(&own[some]),
            "{row}, {col}"
        );
    }
    let mut covered = 0;
    for run in found.runs() {
        assert!(run.start == covered && run.len() <= RUN, "{run:?}");
        covered = run.end;
    }
    assert_eq!(covered, steps.len());
    found
}

#[tokio::test]
async fn a_series_is_the_same_before_and_after_compaction_and_of_any_version() {
    let store = Store::memory();
    let steps = months(2 * RUN + 9);
    let first = version(&store, grid(20, 30), 1, &steps).await;
    let in_fields = answers(&store, &first, &steps).await;
    assert_eq!(in_fields.in_fields_count(), steps.len(), "there is no cube");
    follow(&store, &first).await.unwrap();
    let before = answers(&store, &first, &steps).await;
    assert_eq!((before.in_fields_count(), before.is_settled()), (0, false));
    assert_eq!(compact(&store, FOLDER).await.unwrap(), 2);
    assert!(answers(&store, &first, &steps).await.is_settled());
    assert_eq!(compact(&store, FOLDER).await.unwrap(), 0, "again");
    // A revised step takes its run with it, and only that one is made anew.
    let mut revised = steps.clone();
    revised[RUN + 5].1 = 9999;
    revised.push((steps.len() as u32 + 1, 7));
    let second = version(&store, grid(20, 30), 2, &revised).await;
    let lags = answers(&store, &second, &revised).await;
    assert_eq!(lags.in_fields_count(), 2, "the cube is behind");
    assert_eq!(follow(&store, &second).await.unwrap().put_count, 2);
    assert!(!answers(&store, &second, &revised).await.is_settled());
    assert_eq!(compact(&store, FOLDER).await.unwrap(), 1);
    assert!(answers(&store, &second, &revised).await.is_settled());
    // Steps before others: all that follows lies elsewhere, and so do its runs.
    let shifted = revised[1..].to_vec();
    let third = version(&store, grid(20, 30), 3, &shifted).await;
    follow(&store, &third).await.unwrap();
    answers(&store, &third, &shifted).await;
    assert_eq!(compact(&store, FOLDER).await.unwrap(), 2);
    for (manifest, steps) in [(&first, &steps), (&second, &revised), (&third, &shifted)] {
        let found = answers(&store, manifest, steps).await;
        assert_eq!(found.in_fields_count(), 0);
        let at = At::Version(manifest.number.to_string());
        holds(&store, at, manifest, steps).await;
    }
    holds(&store, At::Newest, &third, &shifted).await;
}

#[tokio::test]
async fn runs_across_shards_hold_the_cells_of_their_steps() {
    let (store, grid) = (Store::memory(), grid(520, 510));
    let description = description(Quantity::CarbonFlux, grid);
    let repository = Repository::create(&store, FOLDER, &description)
        .await
        .unwrap();
    let mut edit = Edit::begin(&repository).await.unwrap();
    let value = |step: usize, index: usize| (step * 1000 + index % 977) as f32;
    let mut steps = vec![];
    for step in 0..RUN {
        let all: Arc<[f32]> = (0..grid.cell_count())
            .map(|index| value(step, index))
            .collect();
        let put = edit.put(month(step as u32 + 1), all).await.unwrap();
        steps.push(put);
    }
    edit.commit("a run").await.unwrap();
    assert_eq!(compact(&store, FOLDER).await.unwrap(), 1);
    // A version whose fields have the names of these steps, and are not there.
    let mut manifest = version(&store, grid, 1, &[]).await;
    let blank = version(&store, crate::product::grid(1, 1), 1, &[(1, 1)]).await;
    for step in steps {
        let mut own = blank.steps[0].clone();
        own.period = step.period;
        let product = manifest.product.clone();
        own.field = contract::key::ObjectKey::field(&product, &step.values_sha256);
        manifest.steps.push(own);
    }
    let found = Values::of(&store, &Arc::new(manifest)).await.unwrap();
    assert!(found.is_settled());
    for (row, col) in [(0, 0), (259, 509), (260, 0), (263, 8), (264, 7), (519, 509)] {
        let index = row as usize * 510 + col as usize;
        let own: Vec<f32> = (0..RUN).map(|step| value(step, index)).collect();
        assert_eq!(
            bits(&found.cell(row, col).await.unwrap()),
            bits(&own),
            "{row}, {col}"
        );
    }
    for (row, col) in [(520, 0), (0, 510), (u32::MAX, 0)] {
        let refused = found.cell(row, col).await;
        assert!(
            matches!(refused, Err(CubeError::Outside { .. })),
            "{row}, {col}"
        );
    }
}

/// Removes the objects of a folder that are as large as values of a step, which are so many.
async fn removed(store: &Store, folder: &str, count: usize) {
    let mut large = vec![];
    for key in store.list(folder).await.unwrap() {
        if store.size_bytes(&key).await.unwrap() > 16 << 10 {
            large.push(key);
        }
    }
    assert_eq!(large.len(), count, "{folder}");
    for key in large {
        store.remove(&key).await.unwrap();
    }
}

#[tokio::test]
async fn a_few_cells_of_steps_that_no_run_holds_are_read_of_chunks_of_fields_or_else_of_maps() {
    let (steps, grid) = (months(20), grid(200, 300));
    for gone in [format!("{FOLDER}/chunks"), "frames".to_owned()] {
        // By requests, and of files.
        let (_folder, stores) = stores();
        for store in stores {
            let manifest = version(&store, grid, 1, &steps).await;
            follow(&store, &manifest).await.unwrap();
            removed(&store, &gone, steps.len()).await;
            let found = Values::of(&store, &Arc::new(manifest)).await.unwrap();
            assert_eq!(found.in_fields_count(), 0);
            for (row, col) in [(0, 0), (59, 119), (60, 120), (199, 299)] {
                let own = series(&grid, &steps, row, col);
                let cell = found.cell(row, col).await.unwrap();
                assert_eq!(bits(&cell), bits(&own), "{row}, {col} without {gone}");
            }
            // All cells are read of maps, which are not there in one of the two.
            let blocks = grid.rows.div_ceil(BLOCK_CELLS) * grid.cols.div_ceil(BLOCK_CELLS);
            let across = grid.cols.div_ceil(BLOCK_CELLS);
            let all: Vec<[u32; 2]> = (0..blocks).map(|at| [at / across, at % across]).collect();
            let found = found.blocks(&all, 0..steps.len()).await;
            assert_eq!(found.is_ok(), gone == "frames");
        }
    }
}

#[tokio::test]
async fn a_few_cells_of_fields_alone_are_read_of_their_chunks_and_all_cells_of_whole_fields() {
    let (steps, grid) = (months(20), grid(200, 300));
    let store = Store::memory();
    let manifest = version(&store, grid, 1, &steps).await;
    let mut whole = 0;
    for step in &manifest.steps {
        whole += store.size_bytes(&step.field).await.unwrap();
    }
    let (store, traffic) = store.counted();
    let found = Values::of(&store, &Arc::new(manifest)).await.unwrap();
    assert_eq!(found.in_fields_count(), steps.len());
    let before = traffic.counts();
    let cell = found.cell(60, 120).await.unwrap();
    assert_eq!(bits(&cell), bits(&series(&grid, &steps, 60, 120)));
    let few = traffic.counts().since(before).read_bytes;
    assert!(2 * few < whole, "{few} of {whole}");
    let before = traffic.counts();
    let across = grid.cols.div_ceil(BLOCK_CELLS);
    let blocks = grid.rows.div_ceil(BLOCK_CELLS) * across;
    let all: Vec<[u32; 2]> = (0..blocks).map(|at| [at / across, at % across]).collect();
    found.blocks(&all, 0..steps.len()).await.unwrap();
    // Each at once: chunk by chunk takes as many requests.
    let all = traffic.counts().since(before);
    assert_eq!((all.reads, all.read_bytes), (steps.len() as u64, whole));
}

#[tokio::test]
async fn a_version_that_is_held_is_the_newest_until_there_is_something_to_read_faster() {
    let store = Store::memory();
    let steps = months(RUN + 1);
    let old = Arc::new(version(&store, grid(9, 11), 1, &steps).await);
    let without = Values::of(&store, &old).await.unwrap();
    assert!(!without.is_current().await.unwrap(), "no cube yet");

    let mut revised = steps.clone();
    revised[3].1 += 100;
    let new = version(&store, grid(9, 11), 2, &revised).await;
    follow(&store, &new).await.unwrap();
    let (counted, traffic) = store.counted();
    let found = Values::of(&counted, &old).await.unwrap();
    assert_eq!(found.in_fields_count(), 1);
    let before = traffic.counts();
    assert!(found.is_current().await.unwrap());
    let asked = traffic.counts().since(before);
    assert!(asked.reads <= 2, "{} reads", asked.reads);
    let repository = Repository::open(&store, FOLDER).await.unwrap();
    let newest = repository.keys(&At::Newest).await.unwrap();
    repository.tag("1", newest.snapshot()).await.unwrap();
    assert!(!found.is_current().await.unwrap(), "a state has its name");

    let found = Values::of(&store, &old).await.unwrap();
    assert!(found.is_current().await.unwrap() && !found.is_settled());
    compact(&store, FOLDER).await.unwrap();
    assert!(
        !found.is_current().await.unwrap(),
        "runs of steps are there"
    );
    let found = answers(&store, &old, &steps).await;
    assert!(found.is_current().await.unwrap());
}

#[tokio::test]
async fn another_grid_begins_without_runs() {
    let store = Store::memory();
    let steps = months(RUN);
    let old = version(&store, grid(20, 30), 1, &steps).await;
    follow(&store, &old).await.unwrap();
    compact(&store, FOLDER).await.unwrap();
    let new = version(&store, grid(30, 40), 2, &steps).await;
    follow(&store, &new).await.unwrap();
    assert!(!answers(&store, &new, &steps).await.is_settled());
    assert_eq!(compact(&store, FOLDER).await.unwrap(), 1);
    assert!(answers(&store, &new, &steps).await.is_settled());
    answers(&store, &old, &steps).await;
}

/// A compaction that gets no further than to so many answers of the store, as if it were killed then; was it done?
async fn killed_after(answers: usize, store: &Store) -> bool {
    let mut compacting = pin!(compact(store, FOLDER));
    let mut count = 0;
    poll_fn(|context| {
        if count == answers {
            return Poll::Ready(false);
        }
        count += 1;
        let polled = compacting.as_mut().poll(context);
        polled.map(|made| made.map(|_runs| true).unwrap())
    })
    .await
}

#[tokio::test]
async fn a_compaction_killed_anywhere_does_no_harm() {
    let store = Store::memory();
    let steps = months(RUN + 1);
    let manifest = version(&store, grid(9, 11), 1, &steps).await;
    follow(&store, &manifest).await.unwrap();
    let mut kills = 0;
    while !killed_after(kills, &store).await {
        kills += 1;
        assert!(kills < 1000, "it comes to no end");
    }
    assert!(kills > 5, "{kills}");
    assert!(answers(&store, &manifest, &steps).await.is_settled());
    holds(&store, At::Newest, &manifest, &steps).await;
    holds(&store, At::Version("1".to_owned()), &manifest, &steps).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn compactions_and_followers_at_once_lose_nothing() {
    let (_folder, stores) = stores();
    for store in stores {
        let mut steps = months(RUN);
        let first = version(&store, grid(9, 11), 1, &steps).await;
        follow(&store, &first).await.unwrap();
        let compacting = |store: Store| tokio::spawn(async move { compact(&store, FOLDER).await });
        let two = [compacting(store.clone()), compacting(store.clone())];
        steps[3].1 = 77;
        steps.push((RUN as u32 + 1, 5));
        let second = version(&store, grid(9, 11), 2, &steps).await;
        follow(&store, &second).await.unwrap();
        for one in two {
            one.await.unwrap().unwrap();
        }
        compact(&store, FOLDER).await.unwrap();
        assert!(answers(&store, &second, &steps).await.is_settled());
        holds(&store, At::Newest, &second, &steps).await;
    }
}

#[tokio::test]
async fn a_damaged_run_is_an_error_that_names_it_and_is_made_again() {
    let store = Store::memory();
    let steps = months(RUN);
    let manifest = version(&store, grid(20, 30), 1, &steps).await;
    manifests::commit(&store, &manifest).await.unwrap();
    follow(&store, &manifest).await.unwrap();
    let before: BTreeSet<_> = store
        .list("cubes/p/chunks")
        .await
        .unwrap()
        .into_iter()
        .collect();
    compact(&store, FOLDER).await.unwrap();
    let product = manifest.product.clone();
    let sound = verify::check(&store, &product, &BTreeSet::new()).await;
    assert_eq!(sound.unwrap().findings, []);
    let after = store.list("cubes/p/chunks").await.unwrap();
    let mut shard = (after[0].clone(), 0);
    for key in after.into_iter().filter(|key| !before.contains(key)) {
        let length = store.get(&key).await.unwrap().len();
        if length > shard.1 {
            shard = (key, length);
        }
    }
    let (key, length) = shard;
    let mut flipped = store.get(&key).await.unwrap().to_vec();
    flipped[length / 2] ^= 1;
    store.put_over(&key, flipped.into()).await.unwrap();
    let found = Values::of(&store, &Arc::new(manifest.clone()))
        .await
        .unwrap();
    let mut refused = 0;
    for block in (0..3).flat_map(|row| (0..4).map(move |col| [row, col])) {
        match found.blocks(&[block], 0..RUN).await {
            Ok(blocks) => {
                let window = blocks[0].window;
                let own = series(&manifest.grid, &steps, window.row, window.col);
                assert_eq!(bits(&blocks[0].values[..RUN]), bits(&own));
            }
            Err(error @ CubeError::Chunk { .. }) => {
                assert!(
                    error.to_string().contains("along_time/carbon_flux"),
                    "{error}"
                );
                refused += 1;
            }
            Err(error) => panic!("{error}"),
        }
    }
    assert_eq!(refused, 1);
    let damaged = storage::verify::damaged(&store, store.list("cubes").await.unwrap()).await;
    let damaged = damaged.unwrap();
    assert_eq!(damaged, [key.clone()].into());
    let checked = verify::check(&store, &product, &damaged).await.unwrap();
    let place = &checked.places[&key];
    assert!(
        place.contains("of along_time/carbon_flux in the newest state"),
        "{place}"
    );
    assert_eq!(checked.findings, []);
    assert!(verify::mend(&store, &product).await.unwrap());
    assert!(answers(&store, &manifest, &steps).await.is_settled());
}
