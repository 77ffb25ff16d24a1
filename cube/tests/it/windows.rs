//! Windows and cells of a version: the same bits from fields, chunks and blocks, and fewer bytes read of the latter two.

use std::sync::Arc;

use contract::chunk::Window;
use contract::grid::Grid;
use contract::manifest::Manifest;
use cube::{CellAt, Values, compact, follow};
use futures::TryStreamExt as _;
use storage::Store;

use crate::follow::version;
use crate::product::{bits, grid, values};

/// Steps that compaction makes a run of, and some after them.
const HELD: usize = 20;
const AFTER: usize = 3;

/// Two in one chunk of four, across blocks.
const WINDOWS: [Window; 2] = [
    Window {
        row: 3,
        col: 5,
        rows: 9,
        cols: 12,
    },
    Window {
        row: 100,
        col: 240,
        rows: 2,
        cols: 7,
    },
];

/// Cells at steps out of order, some twice.
fn wanted() -> Vec<CellAt> {
    let at = |step, row, col| CellAt { step, row, col };
    vec![
        at(21, 3, 5),
        at(0, 100, 256),
        at(4, 3, 5),
        at(4, 519, 509),
        at(4, 3, 5),
        at(19, 11, 16),
    ]
}

/// Bytes that the windows and the cells of a version take, whose values are those that were stored.
async fn read(store: &Store, manifest: &Manifest, steps: &[(u32, u32)]) -> [u64; 2] {
    let grid = manifest.grid;
    let (store, traffic) = store.counted();
    let own = Values::of(&store, &Arc::new(manifest.clone()))
        .await
        .unwrap();
    let before = traffic.counts();
    let range = 1..steps.len();
    let found: Vec<_> = own
        .each(range.clone(), &WINDOWS)
        .try_collect()
        .await
        .unwrap();
    assert_eq!(found.len(), range.len());
    for (step, found) in range.zip(found) {
        let field = values(&grid, steps[step].1);
        for (window, found) in WINDOWS.iter().zip(found) {
            let expected: Vec<f32> = window.cell_indices(&grid).map(|at| field[at]).collect();
            assert_eq!(bits(&found), bits(&expected), "step {step}, {window:?}");
        }
    }
    let of_windows = traffic.counts().since(before).read_bytes;
    let before = traffic.counts();
    let wanted = wanted();
    let found = own.cells(&wanted).await.unwrap();
    let value =
        |it: &CellAt| values(&grid, steps[it.step].1)[(it.row * grid.cols + it.col) as usize];
    let expected: Vec<f32> = wanted.iter().map(value).collect();
    assert_eq!(bits(&found), bits(&expected));
    [of_windows, traffic.counts().since(before).read_bytes]
}

fn of(count: usize) -> Vec<(u32, u32)> {
    (1..=count as u32).map(|of| (of, of)).collect()
}

#[tokio::test]
async fn windows_and_cells_have_the_bits_of_their_fields_and_are_read_in_parts() {
    let (store, grid): (_, Grid) = (Store::memory(), grid(520, 510));
    let first = version(&store, grid, 1, &of(HELD)).await;
    let all = of(HELD + AFTER);
    let second = version(&store, grid, 2, &all).await;
    let of_fields = read(&store, &second, &all).await;
    follow(&store, &first).await.unwrap();
    // The last steps are in fields alone.
    read(&store, &second, &all).await;
    follow(&store, &second).await.unwrap();
    let of_maps = read(&store, &second, &all).await;
    // Chunks of fields are less than those of maps, wherever the step is.
    let mut whole = 0;
    for step in &second.steps {
        whole += store.size_bytes(&step.field).await.unwrap();
    }
    for bytes in [of_fields, of_maps] {
        assert!(
            4 * bytes[0] < whole && bytes[1] < bytes[0],
            "{bytes:?} of {whole}"
        );
    }
    assert_eq!(compact(&store, "cubes/p").await.unwrap(), 1);
    let of_blocks = read(&store, &second, &all).await;
    assert!(4 * of_blocks[0] < of_maps[0], "{of_blocks:?} {of_maps:?}");
    assert!(2 * of_blocks[1] < of_maps[1], "{of_blocks:?} {of_maps:?}");
}

#[tokio::test]
async fn what_is_outside_is_an_error_with_and_without_a_cube() {
    let (store, grid) = (Store::memory(), grid(20, 30));
    let manifest = version(&store, grid, 1, &of(2)).await;
    for _time in 0..2 {
        let own = Values::of(&store, &Arc::new(manifest.clone()))
            .await
            .unwrap();
        let wide = [Window {
            row: 15,
            col: 0,
            rows: 6,
            cols: 1,
        }];
        assert!(own.windows(0, &wide).await.is_err());
        assert!(own.windows(2, &[]).await.is_err());
        let late: Result<Vec<_>, _> = own.each(1..3, &[]).try_collect().await;
        assert!(late.is_err());
        let at = |step, row| CellAt { step, row, col: 0 };
        assert!(own.cells(&[at(0, 0), at(2, 0)]).await.is_err());
        assert!(own.cells(&[at(0, 20)]).await.is_err());
        follow(&store, &manifest).await.unwrap();
    }
}
