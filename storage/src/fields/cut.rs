//! Windows of cells, cut out of the chunks of a field that they lie in.

use std::collections::BTreeMap;

use contract::chunk::{CHUNK_COLS, CHUNK_ROWS, Window};
use contract::grid::Grid;
use contract::time::Period;

use super::expected;
use crate::StorageError;
use crate::rows::Fetched;

/// Windows, and where in a field they lie.
#[derive(Debug)]
pub(super) struct Cut {
    windows: Vec<Window>,
    /// Of each chunk that is touched, by its number, the windows that lie in it.
    touched: BTreeMap<u32, Vec<usize>>,
}

impl Cut {
    /// Windows of a grid, none of them outside.
    pub(super) fn new(grid: &Grid, windows: &[Window]) -> Self {
        let mut touched: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for (number, window) in windows.iter().enumerate() {
            for chunk in chunks_of(grid, *window) {
                touched.entry(chunk).or_default().push(number);
            }
        }
        Self {
            windows: windows.to_vec(),
            touched,
        }
    }

    /// Numbers of the chunks that are touched, in increasing order.
    pub(super) fn chunks(&self) -> Vec<u32> {
        self.touched.keys().copied().collect()
    }

    /// Values of the windows, `[row, col]` of each, stored unit, NaN no data; `chunks` are all of the grid.
    ///
    /// # Errors
    /// A chunk is not what its check says.
    pub(super) fn of(
        &self,
        fetched: &Fetched,
        chunks: &[Window],
        period: Period,
    ) -> Result<Vec<Vec<f32>>, StorageError> {
        let blank = |window: &Window| vec![f32::NAN; window.cell_count()];
        let mut values: Vec<Vec<f32>> = self.windows.iter().map(blank).collect();
        fetched.each(
            |chunk| expected(chunks, chunk, period),
            |chunk, found| {
                for number in &self.touched[&chunk] {
                    let own = &mut values[*number];
                    copy(chunks[chunk as usize], found, self.windows[*number], own);
                }
                Ok::<_, StorageError>(())
            },
        )?;
        Ok(values)
    }
}

/// Numbers of the chunks that a window lies in.
fn chunks_of(grid: &Grid, window: Window) -> Vec<u32> {
    let touched = |first: u32, count: u32, side: u32| first / side..(first + count).div_ceil(side);
    let across = grid.cols.div_ceil(CHUNK_COLS);
    let cols = touched(window.col, window.cols, CHUNK_COLS);
    let rows = touched(window.row, window.rows, CHUNK_ROWS);
    rows.flat_map(|row| cols.clone().map(move |col| row * across + col))
        .collect()
}

/// Copies what a chunk holds of a window.
fn copy(chunk: Window, found: &[f32], window: Window, values: &mut [f32]) {
    let shared =
        |a: u32, a_count: u32, b: u32, b_count: u32| a.max(b)..(a + a_count).min(b + b_count);
    let cols = shared(chunk.col, chunk.cols, window.col, window.cols);
    let at = |own: Window, row: u32| {
        let start = (row - own.row) as usize * own.cols as usize + (cols.start - own.col) as usize;
        start..start + cols.len()
    };
    for row in shared(chunk.row, chunk.rows, window.row, window.rows) {
        values[at(window, row)].copy_from_slice(&found[at(chunk, row)]);
    }
}
