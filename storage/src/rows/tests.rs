//! Rows are those that were written, whatever else lies in the file; damaged ones are errors.

use contract::chunk::field_chunks;
use contract::grid::Grid;
use contract::product::ProductId;

use super::*;
use crate::parquet_table::shape_only;
use crate::{Store, fields, sound};
use contract::time::Period;

fn product() -> ProductId {
    "p".parse().unwrap()
}

fn period() -> Period {
    Period::month(2000, 1).unwrap()
}

fn value(cell: usize) -> f32 {
    if cell.is_multiple_of(7) {
        f32::NAN
    } else {
        cell as f32
    }
}

/// A store with a field of a grid.
async fn stored(grid: &Grid) -> (Store, Stored) {
    let store = Store::memory();
    let values: Vec<f32> = (0..grid.cell_count()).map(value).collect();
    let key = fields::write(&store, &product(), grid, &values, period())
        .await
        .unwrap();
    let (_root, objects) = store.sql_root();
    let path = Path::from(key.as_str());
    (store, Stored { objects, path, key })
}

/// Rows as they are read, each compared with what was written.
async fn read(stored: &Stored, grid: &Grid, rows: &[u32]) -> Vec<u32> {
    let index = RowIndex::read(stored).await.unwrap().map(Arc::new);
    assert!(index.is_some());
    let fetched = fetch(stored, index, rows.to_vec()).await.unwrap();
    let chunks = field_chunks(grid);
    let mut seen = vec![];
    let take = |row: u32, values: &[f32]| {
        let cells = chunks[row as usize].cell_indices(grid);
        let written: Vec<u32> = cells.map(|cell| value(cell).to_bits()).collect();
        let found: Vec<u32> = values.iter().map(|value| value.to_bits()).collect();
        assert_eq!(found, written, "{row}");
        seen.push(row);
        Ok::<_, StorageError>(())
    };
    fetched
        .each(|row| fields::expected(&chunks, row, period()), take)
        .unwrap();
    seen
}

#[tokio::test]
async fn rows_are_those_that_were_written() {
    // Several chunks across and down, the last ones cut off; and many small ones.
    for (rows, cols) in [(19, 200), (300, 700), (120, 4000)] {
        let grid = shape_only(rows, cols);
        let (_store, stored) = stored(&grid).await;
        let count = field_chunks(&grid).len() as u32;
        let all: Vec<u32> = (0..count).collect();
        assert_eq!(read(&stored, &grid, &all).await, all);
        for some in [vec![0], vec![count - 1], vec![count / 2, count - 1]] {
            let mut once = some.clone();
            once.dedup();
            assert_eq!(read(&stored, &grid, &some).await, once);
        }
        let disordered = [count - 1, 0, count - 1];
        let mut sorted = vec![0, count - 1];
        sorted.dedup();
        assert_eq!(read(&stored, &grid, &disordered).await, sorted);
    }
}

#[tokio::test]
async fn a_row_that_is_damaged_or_not_there_is_an_error_that_names_the_file() {
    let grid = shape_only(100, 4000);
    let (store, mut stored) = stored(&grid).await;
    let index = Arc::new(RowIndex::read(&stored).await.unwrap().unwrap());
    let lacking = fetch(&stored, Some(Arc::clone(&index)), vec![9999]).await;
    assert!(matches!(lacking, Err(StorageError::Damaged { .. })));
    let chunks = field_chunks(&grid);
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
            .each(|row| fields::expected(&chunks, row, period()), take)
            .unwrap_err();
        assert!(error.to_string().contains(stored.key.as_str()), "{error}");
        // Others of the same file are what they were.
        let fetched = fetch(&stored, Some(Arc::clone(&index)), vec![3, 5])
            .await
            .unwrap();
        fetched
            .each(|row| fields::expected(&chunks, row, period()), take)
            .unwrap();
    }
    // A name of bytes: the file is read whole, and is not what its name says.
    store.put_over(&stored.key, whole).await.unwrap();
    let wrong = contract::digest::Digest::of(b"other");
    stored.key = ObjectKey::field(&product(), &wrong);
    assert!(sound::of_bytes(&stored.key, b"x").is_err());
}

#[tokio::test]
async fn a_page_that_says_it_is_larger_than_its_column_is_refused_before_there_is_room_for_it() {
    let grid = shape_only(100, 4000);
    let (_store, stored) = stored(&grid).await;
    let index = RowIndex::read(&stored).await.unwrap().unwrap();
    let column = index.metadata().row_group(0).column(index.check);
    let most = usize::try_from(column.uncompressed_size()).unwrap();
    let page = |length: usize| zstd::bulk::compress(&vec![7; length], 1).unwrap();
    assert_eq!(decompressed::page(&page(most), column).unwrap().len(), most);
    let refused = decompressed::page(&page(most + 1), column).unwrap_err();
    assert!(refused.to_string().contains("larger"), "{refused}");
    assert!(decompressed::page(b"no page", column).is_err());
}
