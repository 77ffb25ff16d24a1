//! Values of a version that whoever publishes it has at hand: its cube is made of them, and no field is read for it.

use std::ops::Range;
use std::sync::Arc;

use contract::grid::Grid;
use futures::FutureExt as _;
use futures::future::BoxFuture;

use crate::CubeError;
use crate::bands::Bands;
use crate::layout::{BLOCK_CELLS, RUN_STEPS};

const SIDE: usize = BLOCK_CELLS as usize;
/// Values of a block in a run.
const BLOCK_VALUES: usize = SIDE * SIDE * RUN_STEPS;

/// Hands out values of a version, a run of [`RUN_STEPS`] of its steps after the other: run 0 are its first ones.
///
/// They are those that its fields were made of, bit for bit: nobody compares them with the digests that name fields.
pub trait AtHand: Send + Sync {
    /// Values of a run; none where they are not to be had: its fields are read.
    fn run(&self, run: usize) -> BoxFuture<'_, Option<RunValues>>;
}

/// Values of a run of steps in some blocks; no other cell holds data in any of them.
#[derive(Debug, Clone, PartialEq)]
pub struct RunValues {
    /// Rows and columns of blocks of [`BLOCK_CELLS`] cells a side, from the north-west corner on; each once.
    pub blocks: Vec<[u32; 2]>,
    /// `[block, step, row, col]` of whole blocks and runs, stored unit; no data is [`f32::NAN`], also behind the last step and beyond
    /// the edges of the grid.
    pub values: Vec<f32>,
}

impl RunValues {
    /// Are there as many values as blocks have?
    pub(crate) fn is_whole(&self) -> bool {
        self.values.len() == self.blocks.len() * BLOCK_VALUES
    }

    /// Blocks with their values, `[step, row, col]`.
    pub(crate) fn each(&self) -> impl Iterator<Item = ([u32; 2], &[f32])> {
        let values = self.values.chunks_exact(BLOCK_VALUES);
        self.blocks.iter().copied().zip(values)
    }

    /// A step of it, `[row, col]` of a grid, NaN no data.
    pub fn map(&self, step: usize, grid: &Grid) -> Vec<f32> {
        self.rows(step, grid, 0..grid.rows)
    }

    /// Some rows of that.
    fn rows(&self, step: usize, grid: &Grid, rows: Range<u32>) -> Vec<f32> {
        let cols = grid.cols as usize;
        let mut map = vec![f32::NAN; rows.len() * cols];
        for (at, values) in self.each() {
            let [top, left] = at.map(|side| side * BLOCK_CELLS);
            let width = SIDE.min(cols.saturating_sub(left as usize));
            let values = &values[step * SIDE * SIDE..][..SIDE * SIDE];
            for (row, values) in (top..).zip(values.chunks_exact(SIDE)) {
                if rows.contains(&row) && width > 0 {
                    let to = (row - rows.start) as usize * cols + left as usize;
                    map[to..to + width].copy_from_slice(&values[..width]);
                }
            }
        }
        map
    }
}

/// A step of a run, in bands.
pub(crate) struct StepOfRun {
    pub(crate) run: Arc<RunValues>,
    /// Its place in the run.
    pub(crate) step: usize,
    pub(crate) grid: Grid,
}

impl Bands for StepOfRun {
    fn rows(&mut self, rows: Range<u32>) -> BoxFuture<'_, Result<Vec<f32>, CubeError>> {
        let found = self.run.rows(self.step, &self.grid, rows);
        async move { Ok(found) }.boxed()
    }
}
