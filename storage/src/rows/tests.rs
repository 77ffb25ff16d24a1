//! Rows are those that were written, whatever else lies in the file; damaged ones are errors.

use contract::chunk::windows;
use contract::grid::Grid;
use contract::product::ProductId;

use super::*;
use crate::parquet_table::shape_only;
use crate::series::{self, BLOCK_CELLS};
use crate::{Store, sound};

fn product() -> ProductId {
    "p".parse().unwrap()
}

fn value(step: usize, cell: usize) -> f32 {
    if (step + cell) % 7 == 0 {
        f32::NAN
    } else {
        (step * 10_000 + cell) as f32
    }
}

/// A store with a series of a grid.
async fn stored(grid: &Grid, step_count: usize) -> (Store, Stored) {
    let store = Store::memory();
    let steps: Vec<Vec<f32>> = (0..step_count)
        .map(|step| {
            (0..grid.cell_count())
                .map(|cell| value(step, cell))
                .collect()
        })
        .collect();
    let views: Vec<&[f32]> = steps.iter().map(Vec::as_slice).collect();
    let key = series::write(&store, &product(), grid, &views)
        .await
        .unwrap();
    let (_root, objects) = store.sql_root();
    let path = Path::from(key.as_str());
    (store, Stored { objects, path, key })
}

/// Rows as they are read, each compared with what was written.
async fn read(stored: &Stored, grid: &Grid, step_count: usize, rows: &[u32]) -> Vec<u32> {
    let index = RowIndex::read(stored).await.unwrap().map(Arc::new);
    assert!(index.is_some());
    let fetched = fetch(stored, index, rows.to_vec()).await.unwrap();
    let blocks = windows(grid, BLOCK_CELLS, BLOCK_CELLS);
    let mut seen = vec![];
    let take = |row: u32, values: &[f32]| {
        let cells = blocks[row as usize].cell_indices(grid);
        let written = cells.flat_map(|cell| (0..step_count).map(move |step| value(step, cell)));
        let written: Vec<u32> = written.map(f32::to_bits).collect();
        let found: Vec<u32> = values.iter().map(|value| value.to_bits()).collect();
        assert_eq!(found, written, "{row}");
        seen.push(row);
        Ok::<_, StorageError>(())
    };
    fetched
        .each(|row| series::expected(&blocks, row, step_count), take)
        .unwrap();
    seen
}

#[tokio::test]
async fn rows_are_those_that_were_written_whether_pages_hold_one_or_several() {
    let grid = shape_only(19, 200);
    for step_count in [1, 3, 4, 50] {
        let (_store, stored) = stored(&grid, step_count).await;
        let all: Vec<u32> = (0..75).collect();
        assert_eq!(read(&stored, &grid, step_count, &all).await, all);
        for some in [&[0][..], &[74], &[31, 32], &[5, 6, 40, 73]] {
            assert_eq!(read(&stored, &grid, step_count, some).await, some);
        }
        assert_eq!(read(&stored, &grid, step_count, &[7, 3, 7]).await, [3, 7]);
    }
}

#[tokio::test]
async fn a_row_that_is_damaged_or_not_there_is_an_error_that_names_the_file() {
    let grid = shape_only(16, 80);
    let (store, mut stored) = stored(&grid, 40).await;
    let index = Arc::new(RowIndex::read(&stored).await.unwrap().unwrap());
    let lacking = fetch(&stored, Some(Arc::clone(&index)), vec![99]).await;
    assert!(matches!(lacking, Err(StorageError::Damaged { .. })));
    let blocks = windows(&grid, BLOCK_CELLS, BLOCK_CELLS);
    let whole = store.get(&stored.key).await.unwrap();
    let page = index.page_of(0, 4).unwrap();
    let take = |_row: u32, _values: &[f32]| Ok::<_, StorageError>(());
    // Levels and numbers as they are compressed.
    let middle = page.start.midpoint(page.end);
    for at in [page.start + 100, middle, page.end - 5] {
        let mut damaged = whole.to_vec();
        damaged[at as usize] ^= 4;
        store.put_over(&stored.key, damaged.into()).await.unwrap();
        let fetched = fetch(&stored, Some(Arc::clone(&index)), vec![4, 5])
            .await
            .unwrap();
        let error = fetched
            .each(|row| series::expected(&blocks, row, 40), take)
            .unwrap_err();
        assert!(error.to_string().contains(stored.key.as_str()), "{error}");
        // Others of the same file are what they were.
        let fetched = fetch(&stored, Some(Arc::clone(&index)), vec![3, 5])
            .await
            .unwrap();
        fetched
            .each(|row| series::expected(&blocks, row, 40), take)
            .unwrap();
    }
    // A name of bytes: the file is read whole, and is not what its name says.
    store.put_over(&stored.key, whole).await.unwrap();
    let wrong = contract::digest::Digest::of(b"other");
    stored.key = ObjectKey::series(&product(), &wrong);
    assert!(sound::of_bytes(&stored.key, b"x").is_err());
}
