//! Blocks of cells over all time, as many at once as fit a bound; of a region those that it touches.

use std::ops::Range;

use contract::chunk::{Window, windows};
use contract::grid::Grid;
use contract::manifest::Manifest;
use cube::{BLOCK_CELLS, RUN_STEPS, Values};

use super::wanted::Wanted;
use crate::ComputeError;

/// Share of the memory for work that the values of some blocks take.
const HELD_SHARE: usize = 8;

/// Share of the memory for work that the values of all blocks in a run of steps may take, if runs are to be held: one is read while
/// one is made, and one waits.
const RUN_SHARE: usize = 8;

/// Cells over all steps.
pub(super) struct Cells {
    /// Place of each in the grid, row-major.
    pub(super) places: Vec<usize>,
    /// `[cell, step]`, stored unit, NaN no data.
    pub(super) values: Vec<f32>,
}

/// A version whose cells are read.
pub(super) struct Reading<'a> {
    pub(super) manifest: &'a Manifest,
    pub(super) values: Values,
    /// Steps that are needed: others may be left without data.
    pub(super) steps: Range<usize>,
}

/// The blocks of a grid, and how many are read at once.
pub(super) struct Blocks {
    /// By their numbers, increasing.
    windows: Vec<(u32, Window)>,
    at_once: usize,
    /// Have all of them room at a run of steps?
    is_run_held: bool,
}

impl Blocks {
    /// Those in which some cell is wanted; work may take so much memory, and each cell has so many steps, of all versions that are
    /// read together.
    pub(super) fn of(grid: &Grid, wanted: &Wanted, step_count: usize, memory_bytes: usize) -> Self {
        let block_bytes = (BLOCK_CELLS * BLOCK_CELLS) as usize * size_of::<f32>();
        let windows: Vec<(u32, Window)> = (0..)
            .zip(windows(grid, BLOCK_CELLS, BLOCK_CELLS))
            .filter(|(_, window)| wanted.is_any_of(grid, *window))
            .collect();
        let run_bytes = windows.len().saturating_mul(block_bytes * RUN_STEPS);
        let all_bytes = block_bytes * step_count.max(1);
        Self {
            is_run_held: run_bytes <= memory_bytes / RUN_SHARE,
            windows,
            at_once: (memory_bytes / HELD_SHARE / all_bytes).max(1),
        }
    }

    /// Runs of blocks that are read together, in their order.
    pub(super) fn runs(&self) -> impl Iterator<Item = Range<usize>> + use<> {
        let (all, at_once) = (self.windows.len(), self.at_once);
        (0..all.div_ceil(at_once)).map(move |run| run * at_once..((run + 1) * at_once).min(all))
    }

    /// The cells of a run of blocks at all steps; NaN at those that are not needed.
    pub(super) async fn read(
        &self,
        reading: &Reading<'_>,
        run: Range<usize>,
    ) -> Result<Cells, ComputeError> {
        let Reading {
            manifest,
            values,
            steps: needed,
        } = reading;
        let blocks = &self.windows[run];
        let places = blocks
            .iter()
            .flat_map(|(_, block)| block.cell_indices(&manifest.grid));
        let places: Vec<usize> = places.collect();
        let asked = at(blocks, &manifest.grid);
        let step_count = manifest.steps.len();
        let mut cells = Cells {
            values: vec![f32::NAN; places.len() * step_count],
            places,
        };
        let is_needed = |steps: &Range<usize>| steps.start < needed.end && needed.start < steps.end;
        for steps in values.runs().into_iter().filter(is_needed) {
            let found = values.blocks(&asked, steps.clone()).await?;
            let mut first = 0;
            for block in &found {
                for own in block.values.chunks_exact(steps.len().max(1)) {
                    cells.values[first * step_count..][steps.clone()].copy_from_slice(own);
                    first += 1;
                }
            }
        }
        Ok(cells)
    }

    /// Rows and columns of all of them; none where a run of steps of all takes too much memory.
    pub(super) fn held_in_runs(&self, grid: &Grid) -> Option<Vec<[u32; 2]>> {
        self.is_run_held.then(|| at(&self.windows, grid))
    }
}

/// Rows and columns of blocks.
fn at(blocks: &[(u32, Window)], grid: &Grid) -> Vec<[u32; 2]> {
    let across = grid.cols.div_ceil(BLOCK_CELLS);
    let at = |(number, _): &(u32, Window)| [number / across, number % across];
    blocks.iter().map(at).collect()
}
