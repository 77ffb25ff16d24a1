//! Anomalies of runs of steps, where they are wanted: blocks of cells of the product along time in, means of their steps less the
//! normals out, as its cube holds them. They are made twice, for fields and for the cube, which is quicker than to read the fields.

use std::ops::Range;
use std::sync::Arc;

use contract::grid::Grid;
use cube::{AtHand, BLOCK_CELLS, Block, RUN_STEPS, RunValues, Values};
use futures::future::BoxFuture;
use rayon::prelude::*;
use storage::row_check::RowCheck;

use super::means::{MeanOf, Sum};
use crate::ComputeError;

/// Cells of a block.
const CELLS: usize = (BLOCK_CELLS * BLOCK_CELLS) as usize;

/// What is taken off of what.
pub(super) struct Less {
    pub(super) grid: Grid,
    /// What each anomaly is of.
    pub(super) of: Arc<[MeanOf]>,
    /// Which normals are taken off each.
    pub(super) bins: Vec<usize>,
    /// `[bin][row, col]`, stored unit, NaN where nothing is wanted or there is none.
    pub(super) normals: Vec<Vec<f64>>,
    /// From the product's unit to that of anomalies.
    pub(super) factor: f64,
}

impl Less {
    /// An anomaly from a mean in one cell; no data is one NaN.
    fn value(&self, anomaly: usize, place: usize, mean: f64) -> f32 {
        let value = ((mean - self.normals[self.bins[anomaly]][place]) * self.factor) as f32;
        if value.is_nan() { f32::NAN } else { value }
    }

    /// An anomaly of every cell, of the sums of its steps, `[row, col]`.
    pub(super) fn map(&self, anomaly: usize, sums: &[Sum]) -> Vec<f32> {
        let mean = &self.of[anomaly];
        let value = |(place, sum): (usize, &Sum)| self.value(anomaly, place, mean.mean(*sum));
        sums.iter().enumerate().map(value).collect()
    }

    /// Adds the values of some steps to the anomalies of one block, `[step, cell]` of a whole one, of which the first is `first`.
    /// What the steps leave incomplete is carried to the next ones: one anomaly a cell, since they follow each other.
    fn add(
        &self,
        first: usize,
        (steps, own): (&Range<usize>, &Block),
        making: (&mut [f32], &mut [Sum]),
    ) {
        let (out, carried) = making;
        let window = own.window;
        let of_run = &self.of[first..self.of.len().min(first + RUN_STEPS)];
        let from = of_run.partition_point(|mean| mean.steps.end <= steps.start);
        let to = of_run.partition_point(|mean| mean.steps.start < steps.end);
        let places = window.cell_indices(&self.grid);
        for ((cell, place), values) in places.enumerate().zip(own.values.chunks_exact(steps.len()))
        {
            let (down, right) = (cell / window.cols as usize, cell % window.cols as usize);
            let in_block = down * BLOCK_CELLS as usize + right;
            let mut sum = carried[in_block];
            for (at, mean) in (from..to).zip(&of_run[from..to]) {
                for step in mean.steps.start.max(steps.start)..mean.steps.end.min(steps.end) {
                    mean.add(&mut sum, step, values[step - steps.start]);
                }
                if mean.steps.end <= steps.end {
                    out[at * CELLS + in_block] = self.value(first + at, place, mean.mean(sum));
                    sum = Sum::default();
                }
            }
            carried[in_block] = sum;
        }
    }
}

/// A run that was made.
pub(super) struct MadeRun {
    pub(super) values: RunValues,
    /// Of all of its values.
    pub(super) check: u32,
}

impl MadeRun {
    /// Tells of the cells that hold data in any step, by their places.
    pub(super) fn cells(&self, grid: &Grid, mut tell: impl FnMut(usize)) {
        let values = self.values.values.chunks_exact(CELLS * RUN_STEPS);
        for (at, values) in self.values.blocks.iter().zip(values) {
            let mut has_data = [false; CELLS];
            for map in values.chunks_exact(CELLS) {
                for (own, value) in has_data.iter_mut().zip(map) {
                    *own |= !value.is_nan();
                }
            }
            let [top, left] = at.map(|side| side * BLOCK_CELLS);
            for (cell, _) in has_data.iter().enumerate().filter(|(_, has)| **has) {
                // Beyond the grid no cell holds data.
                let (row, col) = (
                    top + cell as u32 / BLOCK_CELLS,
                    left + cell as u32 % BLOCK_CELLS,
                );
                tell(row as usize * grid.cols as usize + col as usize);
            }
        }
    }
}

/// Makes runs of anomalies.
pub(super) struct Runs {
    pub(super) source: Values,
    /// Rows and columns of the blocks in which any cell is wanted.
    pub(super) blocks: Vec<[u32; 2]>,
    pub(super) less: Arc<Less>,
}

impl Runs {
    /// How many there are.
    pub(super) fn count(&self) -> usize {
        self.less.of.len().div_ceil(RUN_STEPS)
    }

    /// The anomalies of one.
    pub(super) fn anomalies(&self, run: usize) -> Range<usize> {
        run * RUN_STEPS..self.less.of.len().min((run + 1) * RUN_STEPS)
    }

    /// Reads and makes one; of the product no more is held than one run of its own.
    pub(super) async fn make(&self, run: usize) -> Result<MadeRun, ComputeError> {
        let own = self.anomalies(run);
        let (first, of) = (own.start, &self.less.of[own]);
        let ends = of.first().zip(of.last());
        let steps = ends.map_or(0..0, |(first, last)| first.steps.start..last.steps.end);
        let mut making = Making {
            values: vec![f32::NAN; self.blocks.len() * CELLS * RUN_STEPS],
            carried: vec![Sum::default(); self.blocks.len() * CELLS],
        };
        for piece in self.source.runs() {
            let piece = piece.start.max(steps.start)..piece.end.min(steps.end);
            if piece.is_empty() {
                continue;
            }
            let read = self.source.blocks(&self.blocks, piece.clone()).await?;
            let less = Arc::clone(&self.less);
            making = off_thread(move || {
                making.take(&less, first, (&piece, &read));
                making
            })
            .await?;
        }
        let blocks = self.blocks.clone();
        off_thread(move || {
            let values = making.values;
            MadeRun {
                check: RowCheck::new().f32s(&values).finish(),
                values: RunValues { blocks, values },
            }
        })
        .await
    }
}

async fn off_thread<T: Send + 'static>(
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, ComputeError> {
    let worked = tokio::task::spawn_blocking(work).await;
    worked.map_err(|e| ComputeError::inconsistent("an anomaly", e))
}

/// A run on its way.
struct Making {
    /// `[block, step, cell]` of whole blocks.
    values: Vec<f32>,
    /// Of each cell of each block what the anomaly that is not complete has come to.
    carried: Vec<Sum>,
}

impl Making {
    fn take(&mut self, less: &Less, first: usize, (steps, read): (&Range<usize>, &[Block])) {
        let values = self.values.par_chunks_mut(CELLS * RUN_STEPS);
        let making = values.zip(self.carried.par_chunks_mut(CELLS));
        making.zip(read).for_each(|((values, carried), own)| {
            less.add(first, (steps, own), (values, carried));
        });
    }
}

/// Anomalies that fields were made of, for their cube.
pub(super) struct OfAnomalies {
    pub(super) runs: Runs,
    /// Of the values that went into fields, a run each.
    pub(super) checks: Vec<u32>,
}

impl AtHand for OfAnomalies {
    fn run(&self, run: usize) -> BoxFuture<'_, Option<RunValues>> {
        Box::pin(async move {
            let check = self.checks.get(run)?;
            match self.runs.make(run).await {
                Ok(made) if made.check == *check => Some(made.values),
                Ok(_other) => {
                    tracing::warn!(
                        run,
                        "anomalies came out otherwise the second time: the cube is made of their fields"
                    );
                    None
                }
                Err(error) => {
                    tracing::warn!(run, %error, "the cube is made of fields");
                    None
                }
            }
        })
    }
}
