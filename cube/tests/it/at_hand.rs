//! Cubes that are made of values at hand: the same values as of fields, which nobody reads.

use std::sync::Arc;

use contract::grid::Grid;
use contract::manifest::Manifest;
use contract::quantity::Quantity;
use cube::{AtHand, BLOCK_CELLS, RUN_STEPS, RunValues, Values, compact, follow, follow_with};
use futures::FutureExt as _;
use futures::future::BoxFuture;
use storage::Store;

use crate::follow::version;
use crate::product::{bits, grid, values};

const SIDE: usize = BLOCK_CELLS as usize;

/// A version whose steps were made of seeds.
struct Seeds {
    grid: Grid,
    steps: Vec<(u32, u32)>,
    /// A run that is not to be had.
    gone: Option<usize>,
}

impl AtHand for Seeds {
    fn run(&self, run: usize) -> BoxFuture<'_, Option<RunValues>> {
        let is_there = self.gone != Some(run);
        async move { is_there.then(|| self.values(run)) }.boxed()
    }
}

impl Seeds {
    fn values(&self, run: usize) -> RunValues {
        let (rows, cols) = (
            self.grid.rows.div_ceil(BLOCK_CELLS),
            self.grid.cols.div_ceil(BLOCK_CELLS),
        );
        // In some order.
        let blocks = (0..rows)
            .rev()
            .flat_map(|row| (0..cols).map(move |col| [row, col]));
        let blocks: Vec<[u32; 2]> = blocks.collect();
        let mut all = vec![f32::NAN; blocks.len() * SIDE * SIDE * RUN_STEPS];
        for (step, (_of, seed)) in self
            .steps
            .iter()
            .skip(run * RUN_STEPS)
            .take(RUN_STEPS)
            .enumerate()
        {
            let map = values(&self.grid, *seed);
            for (block, [row, col]) in blocks.iter().enumerate() {
                for at in 0..SIDE * SIDE {
                    let (row, col) = (
                        *row as usize * SIDE + at / SIDE,
                        *col as usize * SIDE + at % SIDE,
                    );
                    if row < self.grid.rows as usize && col < self.grid.cols as usize {
                        let place = (block * RUN_STEPS + step) * SIDE * SIDE + at;
                        all[place] = map[row * self.grid.cols as usize + col];
                    }
                }
            }
        }
        RunValues {
            blocks,
            values: all,
        }
    }
}

/// A version of a quantity that has no sums beside its time-major copy.
async fn open_version(store: &Store, grid: Grid, number: u64, steps: &[(u32, u32)]) -> Manifest {
    Manifest {
        quantity: Quantity::open("flux_anomaly", "g m-2", "Flux, anomaly").unwrap(),
        ..version(store, grid, number, steps).await
    }
}

async fn forget_fields(store: &Store, manifest: &Manifest, steps: std::ops::Range<usize>) {
    for step in &manifest.steps[steps] {
        store.remove(&step.field).await.unwrap();
    }
}

/// Every value of a version, of its cube alone.
async fn holds(store: &Store, manifest: &Manifest, steps: &[(u32, u32)]) -> Values {
    let of = Arc::new(manifest.clone());
    let found = Values::of(store, &of).await.unwrap();
    assert_eq!(found.in_fields_count(), 0);
    let grid = &manifest.grid;
    let whole = contract::chunk::Window {
        row: 0,
        col: 0,
        rows: grid.rows,
        cols: grid.cols,
    };
    for (step, (_of, seed)) in steps.iter().enumerate() {
        let own = values(grid, *seed);
        let map = found.windows(step, &[whole]).await.unwrap();
        assert_eq!(bits(&map[0]), bits(&own), "{step}");
    }
    for (row, col) in [(0, 0), (11, 29), (grid.rows - 1, grid.cols - 1)] {
        let index = (row * grid.cols + col) as usize;
        let own = steps.iter().map(|(_of, seed)| values(grid, *seed)[index]);
        let cell = found.cell(row, col).await.unwrap();
        assert_eq!(
            bits(&cell),
            bits(&own.collect::<Vec<f32>>()),
            "{row}, {col}"
        );
    }
    found
}

#[tokio::test]
async fn a_cube_of_values_at_hand_is_that_of_its_fields_and_no_field_is_read() {
    // One is cut into two shards.
    for (grid, count) in [(grid(21, 44), 2 * RUN_STEPS + 20), (grid(515, 511), 16)] {
        let steps: Vec<(u32, u32)> = (1..=count as u32).map(|of| (of, of)).collect();
        let (store, other) = (Store::memory(), Store::memory());
        let manifest = open_version(&store, grid, 1, &steps).await;
        let seeds = Seeds {
            grid,
            steps: steps.clone(),
            gone: None,
        };
        forget_fields(&store, &manifest, 0..count).await;
        let followed = follow_with(&store, &manifest, manifest.id(), Some(&seeds)).await;
        assert_eq!(followed.unwrap().put_count, count);
        let found = holds(&store, &manifest, &steps).await;
        assert_eq!(
            found.time_major().len(),
            count.div_ceil(RUN_STEPS),
            "without compaction"
        );
        assert!(found.is_settled());
        assert_eq!(
            compact(&store, "cubes/p").await.unwrap(),
            0,
            "nothing is left to make"
        );
        // Levels and what they were made of, and the time-major copy: as they are of fields.
        let of_fields = open_version(&other, grid, 1, &steps).await;
        follow(&other, &of_fields).await.unwrap();
        compact(&other, "cubes/p").await.unwrap();
        holds(&other, &of_fields, &steps).await;
        let of = Arc::new(of_fields);
        let same = Values::of(&other, &of).await.unwrap();
        let level = contract::chunk::Window {
            row: 60,
            col: 0,
            rows: 5,
            cols: 128,
        };
        for step in [0, count - 1].into_iter().filter(|_| grid.rows > 256) {
            let own = found.window_at(1, level, step).await.unwrap();
            let right = same.window_at(1, level, step).await.unwrap();
            assert_eq!(bits(&own.values), bits(&right.values));
            assert_eq!(own.coverage, right.coverage);
        }
    }
}

#[tokio::test]
async fn what_is_not_at_hand_is_read_of_fields_and_what_is_there_is_not_put_again() {
    let (store, grid) = (Store::memory(), grid(21, 30));
    let steps: Vec<(u32, u32)> = (1..=2 * RUN_STEPS as u32 + 3).map(|of| (of, of)).collect();
    let manifest = open_version(&store, grid, 1, &steps).await;
    let mut seeds = Seeds {
        grid,
        steps: steps.clone(),
        gone: Some(1),
    };
    forget_fields(&store, &manifest, 0..RUN_STEPS).await;
    let followed = follow_with(&store, &manifest, manifest.id(), Some(&seeds)).await;
    assert_eq!(followed.unwrap().put_count, steps.len());
    let found = holds(&store, &manifest, &steps).await;
    let runs = found.time_major();
    assert_eq!(runs.len(), 1, "others are too short, or were not at hand");
    assert_eq!(runs[0], 0..RUN_STEPS);
    assert_eq!(compact(&store, "cubes/p").await.unwrap(), 1);
    // The last run alone is another.
    let mut revised = steps.clone();
    revised[2 * RUN_STEPS + 1].1 = 7777;
    let second = open_version(&store, grid, 2, &revised).await;
    seeds.steps.clone_from(&revised);
    forget_fields(&store, &second, 0..2 * RUN_STEPS).await;
    let followed = follow_with(&store, &second, second.id(), Some(&seeds)).await;
    assert_eq!(followed.unwrap().put_count, 1);
    holds(&store, &second, &revised).await;
}
