//! Anomalies of runs of steps, where they are wanted: blocks of cells of the product along time in, means of their steps less the
//! normals out, as its cube holds them. Where they are not held they are made twice, for fields and for the cube, which is quicker than
//! to read the fields.

use std::ops::Range;
use std::sync::Arc;

use contract::chunk::Window;
use contract::grid::Grid;
use cube::{AtHand, BLOCK_CELLS, RUN_STEPS, RunValues, Values};
use futures::future::BoxFuture;
use futures::{FutureExt as _, StreamExt as _, TryStreamExt as _, stream};
use rayon::prelude::*;
use storage::row_check::RowCheck;

use super::blocks::{Blocks, GROUPS_AT_ONCE, Pieces};
use super::encoded::{Damaged, Encoded};
use super::held::{self, Held};
use super::means::{MeanOf, Sum};
use super::stored::Stored;
use crate::ComputeError;

/// Cells of a block.
const CELLS: usize = (BLOCK_CELLS * BLOCK_CELLS) as usize;

/// What is taken off of what.
pub(super) struct Less {
    pub(super) grid: Grid,
    pub(super) stored: Stored,
    /// What each anomaly is of.
    pub(super) of: Arc<[MeanOf]>,
    /// Which normals are taken off each.
    pub(super) bins: Vec<usize>,
    /// `[bin][row, col]` of the cells that are stored, stored unit, NaN where nothing is wanted or there is none.
    pub(super) normals: Vec<Vec<f64>>,
    /// From the product's unit to that of anomalies.
    pub(super) factor: f64,
}

impl Less {
    /// An anomaly from a mean in one cell.
    fn value(&self, anomaly: usize, place: usize, mean: f64) -> f32 {
        held::value(mean, self.normals[self.bins[anomaly]][place], self.factor)
    }

    /// An anomaly of every cell, of the sums of its steps, `[row, col]`.
    pub(super) fn map(&self, anomaly: usize, sums: &[Sum]) -> Vec<f32> {
        let mean = &self.of[anomaly];
        let value = |(place, sum): (usize, &Sum)| self.value(anomaly, place, mean.mean(*sum));
        sums.iter().enumerate().map(value).collect()
    }

    /// Some anomalies of one block, `[step, cell]` of a whole run and block, of its values at some steps, `[cell, step]`.
    fn put(
        &self,
        anomalies: &Range<usize>,
        window: Window,
        (steps, values): (&Range<usize>, &[f32]),
        out: &mut [f32],
    ) {
        let places = window.cell_indices(&self.grid);
        let places = places.map(|place| self.stored.place(place));
        for ((cell, place), values) in places.enumerate().zip(values.chunks_exact(steps.len())) {
            let (down, right) = (cell / window.cols as usize, cell % window.cols as usize);
            let in_block = down * BLOCK_CELLS as usize + right;
            for (map, anomaly) in out.chunks_exact_mut(CELLS).zip(anomalies.clone()) {
                let mean = self.of[anomaly].of(values, steps.start);
                map[in_block] = self.value(anomaly, place, mean);
            }
        }
    }

    /// Some anomalies of the blocks of a group, `[block, step, cell]` of whole blocks and runs, of what was found of them in some steps;
    /// else what cannot be decoded, and where.
    fn made(
        &self,
        found: Encoded,
        pieces: Pieces,
        anomalies: &Range<usize>,
        steps: &Range<usize>,
    ) -> Result<Vec<f32>, (Encoded, Damaged)> {
        let block_values = CELLS * RUN_STEPS;
        let mut all = vec![f32::NAN; found.windows().len() * block_values];
        let mut found = found.split(pieces.each);
        let piece_values = pieces.each * block_values;
        let at_once = pieces.at_once.min(found.len()).max(1);
        let mut damaged = None;
        for (batch, all) in all.chunks_mut(piece_values * at_once).enumerate() {
            let own = &found[batch * at_once..];
            let making = all.par_chunks_mut(piece_values).zip(own).enumerate();
            let made = making.try_for_each(|(piece, (mut out, encoded))| {
                let values = encoded.values(steps).map_err(|damaged| (piece, damaged))?;
                let mut values = values.as_slice();
                for window in encoded.windows() {
                    let (own, rest) = values.split_at(window.cell_count() * steps.len());
                    let (of_block, later) = out.split_at_mut(block_values);
                    self.put(anomalies, *window, (steps, own), of_block);
                    (values, out) = (rest, later);
                }
                Ok(())
            });
            if let Err((piece, error)) = made {
                damaged = Some((batch * at_once + piece, error));
                break;
            }
        }
        match damaged {
            None => Ok(all),
            Some((piece, damaged)) => Err((found.swap_remove(piece), damaged)),
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
    fn of(values: RunValues) -> Self {
        Self {
            check: RowCheck::new().f32s(&values.values).finish(),
            values,
        }
    }

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
    /// In which any cell is wanted.
    pub(super) blocks: Arc<Blocks>,
    pub(super) count: usize,
    pub(super) of: AnomaliesOf,
}

/// Where anomalies are had from.
pub(super) enum AnomaliesOf {
    /// They were made with their normals.
    Held(Arc<Held>),
    /// They are made of the product.
    Product { source: Values, less: Arc<Less> },
}

impl Runs {
    /// How many there are.
    pub(super) fn count(&self) -> usize {
        self.count.div_ceil(RUN_STEPS)
    }

    /// The anomalies of one.
    pub(super) fn anomalies(&self, run: usize) -> Range<usize> {
        run * RUN_STEPS..self.count.min((run + 1) * RUN_STEPS)
    }

    /// Makes one.
    pub(super) async fn make(&self, run: usize) -> Result<MadeRun, ComputeError> {
        let anomalies = self.anomalies(run);
        match &self.of {
            AnomaliesOf::Held(held) => {
                let (held, blocks) = (Arc::clone(held), Arc::clone(&self.blocks));
                off_thread(move || MadeRun::of(held.run(&blocks, anomalies))).await
            }
            AnomaliesOf::Product { source, less } => {
                let values = self.made(source, less, anomalies).await?;
                off_thread(move || MadeRun::of(values)).await
            }
        }
    }

    /// Reads the product and makes one run, on all processors.
    async fn made(
        &self,
        source: &Values,
        less: &Arc<Less>,
        anomalies: Range<usize>,
    ) -> Result<RunValues, ComputeError> {
        let of = &less.of[anomalies.clone()];
        let ends = of.first().zip(of.last());
        let steps = ends.map_or(0..0, |(first, last)| first.steps.start..last.steps.end);
        let groups = self.blocks.groups(steps.len());
        let pieces = groups.pieces;
        let make = |windows: Vec<Window>| {
            let (less, anomalies, steps) = (Arc::clone(less), anomalies.clone(), steps.clone());
            async move {
                let found = Encoded::find(source, windows, steps.clone()).await?;
                let made = off_thread(move || less.made(found, pieces, &anomalies, &steps)).await?;
                match made {
                    Ok(made) => Ok(made),
                    Err((encoded, damaged)) => Err(encoded.error(damaged).await),
                }
            }
            .boxed()
        };
        let mut making = stream::iter(groups.of_blocks().map(<[Window]>::to_vec))
            .map(make)
            .buffered(GROUPS_AT_ONCE);
        let mut values = vec![];
        while let Some(mut made) = making.try_next().await? {
            if values.is_empty() {
                values = made;
            } else {
                values.append(&mut made);
            }
        }
        drop(making);
        let blocks = self.blocks.at();
        Ok(RunValues { blocks, values })
    }
}

/// Does something that takes processors.
pub(super) async fn off_thread<T: Send + 'static>(
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, ComputeError> {
    let worked = tokio::task::spawn_blocking(work).await;
    worked.map_err(|e| ComputeError::inconsistent("a statistic", e))
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
