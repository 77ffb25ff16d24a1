//! Chunks without data in shards, which are not stored: land in the products of large grids.

use std::collections::BTreeSet;
use std::sync::Arc;

use contract::chunk::Window;
use contract::digest::Digest;
use contract::manifest::{Manifest, Step};
use cube::{At, Layout, Repository, Values, compact, follow, verify};
use storage::{Store, fields, manifests};

use crate::follow::version;
use crate::product::{bits, grid, month, values};

const STEPS: u32 = 20;

/// Values of a month: whole chunks of columns hold none, and all of the second shard does not.
fn with_land(grid: &contract::grid::Grid, seed: u32) -> Vec<f32> {
    let is_land = |col: usize| (400..2100).contains(&col) || (4000..8200).contains(&col);
    let land = |cell: usize| is_land(cell % grid.cols as usize);
    let sea = values(grid, seed);
    let cells = sea.iter().enumerate();
    cells
        .map(|(cell, value)| if land(cell) { f32::NAN } else { *value })
        .collect()
}

/// A published version whose cube follows it.
async fn landed(store: &Store, grid: contract::grid::Grid) -> Manifest {
    let mut manifest = version(store, grid, 1, &[]).await;
    for number in 1..=STEPS {
        let values = with_land(&grid, number);
        let field = fields::write(store, &manifest.product, &grid, &values, month(number)).await;
        manifest.steps.push(Step {
            period: month(number),
            field: field.unwrap(),
            raw_sha256: Digest::of(b""),
            origin: "f.nc".to_owned(),
            valid_cells: 1,
            masked: None,
            contributed: None,
        });
    }
    manifests::commit(store, &manifest).await.unwrap();
    follow(store, &manifest).await.unwrap();
    manifest
}

#[tokio::test]
async fn a_chunk_of_a_shard_without_data_is_no_data_to_every_reader() {
    let store = Store::memory();
    let grid = grid(8, 33_300);
    let layout = Layout::of(&grid);
    assert!(
        layout.is_sharded() && layout.chunk == [8, 505],
        "{layout:?}"
    );
    let (manifest, none) = (landed(&store, grid).await, BTreeSet::new());
    let repository = Repository::open(&store, "cubes/p").await.unwrap();
    let cube = repository.at(&At::Newest).await.unwrap();
    let expected = with_land(&grid, 3);
    assert_eq!(bits(&cube.field(2).await.unwrap()), bits(&expected));
    for (col, cols) in [
        (505, 505),
        (390, 700),
        (1200, 1),
        (2000, 300),
        (3990, 20),
        (5000, 3300),
    ] {
        let window = Window {
            row: 1,
            col,
            rows: 5,
            cols,
        };
        let found = cube.window(2, window).await.unwrap();
        let own: Vec<f32> = window
            .cell_indices(&grid)
            .map(|cell| expected[cell])
            .collect();
        assert_eq!(bits(&found), bits(&own), "{window:?}");
    }
    let checked = verify::check(&store, &manifest.product, &none).await;
    assert_eq!(checked.unwrap().findings, []);
    assert_eq!(compact(&store, "cubes/p").await.unwrap(), 1);
    let found = Values::of(&store, &Arc::new(manifest.clone()))
        .await
        .unwrap();
    for col in [390, 1200, 2099, 2100, 6000, 33_299] {
        let cell = found.cell(3, col).await.unwrap();
        let at = (3 * grid.cols + col) as usize;
        let own: Vec<f32> = (1..=STEPS)
            .map(|number| with_land(&grid, number)[at])
            .collect();
        assert_eq!(bits(&cell), bits(&own), "{col}");
    }
    let checked = verify::check(&store, &manifest.product, &none).await;
    assert_eq!(checked.unwrap().findings, []);
}
