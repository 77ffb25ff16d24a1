//! Blocks of cells over all time, as many at once as fit a bound; of a region those that it touches.

use std::ops::Range;

use contract::chunk::{Window, windows};
use contract::manifest::Manifest;
use cube::{BLOCK_CELLS, Values};

use super::wanted::Wanted;
use crate::ComputeError;

/// Share of the memory for work that the values of some blocks take.
const HELD_SHARE: usize = 8;

/// Cells over all steps.
pub(super) struct Cells {
    /// Place of each in the grid, row-major.
    pub(super) places: Vec<usize>,
    /// `[cell, step]`, stored unit, NaN no data.
    pub(super) values: Vec<f32>,
}

/// The blocks of a product's grid, and how many are read at once.
pub(super) struct Blocks {
    /// By their numbers, increasing.
    windows: Vec<(u32, Window)>,
    at_once: usize,
}

impl Blocks {
    /// Those in which some cell is wanted; work may take so much memory.
    pub(super) fn of(manifest: &Manifest, wanted: &Wanted, memory_bytes: usize) -> Self {
        let a_block = (BLOCK_CELLS * BLOCK_CELLS) as usize * manifest.steps.len().max(1);
        Self {
            windows: (0..)
                .zip(windows(&manifest.grid, BLOCK_CELLS, BLOCK_CELLS))
                .filter(|(_, window)| wanted.is_any_of(&manifest.grid, *window))
                .collect(),
            at_once: (memory_bytes / HELD_SHARE / (a_block * size_of::<f32>())).max(1),
        }
    }

    /// Runs of blocks that are read together, in their order.
    pub(super) fn runs(&self) -> impl Iterator<Item = Range<usize>> + use<> {
        let (all, at_once) = (self.windows.len(), self.at_once);
        (0..all.div_ceil(at_once)).map(move |run| run * at_once..((run + 1) * at_once).min(all))
    }

    /// The cells of a run of blocks at all steps.
    pub(super) async fn read(
        &self,
        values: &Values,
        manifest: &Manifest,
        run: Range<usize>,
    ) -> Result<Cells, ComputeError> {
        let blocks = &self.windows[run];
        let places = blocks
            .iter()
            .flat_map(|(_, block)| block.cell_indices(&manifest.grid));
        let places: Vec<usize> = places.collect();
        let across = manifest.grid.cols.div_ceil(BLOCK_CELLS);
        let asked: Vec<[u32; 2]> = blocks
            .iter()
            .map(|(number, _)| [number / across, number % across])
            .collect();
        let step_count = manifest.steps.len();
        let mut cells = Cells {
            values: vec![f32::NAN; places.len() * step_count],
            places,
        };
        for steps in values.runs() {
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
}
