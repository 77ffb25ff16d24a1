//! Anomalies of few means, such as those of months: made of each cell while its values are there for their normals, and held.
//! Their product is not read again for them.

use std::ops::Range;
use std::sync::Arc;

use cube::{BLOCK_CELLS, RUN_STEPS, RunValues};

use super::blocks::Blocks;
use super::means::MeanOf;
use super::plan::Plan;

const SIDE: usize = BLOCK_CELLS as usize;
/// Cells of a whole block.
const CELLS: usize = SIDE * SIDE;
/// Share of the memory for work that held anomalies may take.
const HELD_SHARE: usize = 8;

/// Plans by whether their anomalies are held: those that fit, all in all, into a share of the memory, and whose runs may be held too.
pub(super) fn are_held(plans: &[Plan], blocks: &Blocks, memory_bytes: usize) -> Vec<bool> {
    let mut left = memory_bytes / HELD_SHARE;
    let mut is_held = |plan: &Plan| {
        let bytes =
            (plan.anomalies_of.len() * size_of::<f32>()).saturating_mul(blocks.cell_count());
        let fits = bytes > 0 && bytes <= left && blocks.are_held_in_runs();
        left -= if fits { bytes } else { 0 };
        fits
    };
    plans.iter().map(&mut is_held).collect()
}

/// How the anomalies of a cell are made.
pub(super) struct Anomalies {
    of: Arc<[MeanOf]>,
    /// Which of the normals is taken off each.
    bins: Vec<usize>,
    /// From the product's unit to that of anomalies.
    factor: f64,
}

impl Anomalies {
    /// Those of a plan.
    pub(super) fn new(plan: &Plan) -> Self {
        let bin = |mean: &MeanOf| plan.parts.of_period(mean.period);
        Self {
            bins: plan.anomalies_of.iter().map(bin).collect(),
            of: Arc::clone(&plan.anomalies_of),
            factor: plan.factor,
        }
    }

    /// How many there are.
    pub(super) fn count(&self) -> usize {
        self.of.len()
    }

    /// Those of a cell, of its values at all steps and its normals.
    pub(super) fn write(&self, values: &[f32], normals: &[f64], out: &mut [f32]) {
        for ((out, mean), bin) in out.iter_mut().zip(&*self.of).zip(&self.bins) {
            *out = value(mean.of(values, 0), normals[*bin], self.factor);
        }
    }
}

/// An anomaly; no data is one NaN.
pub(super) fn value(mean: f64, normal: f64, factor: f64) -> f32 {
    let value = ((mean - normal) * factor) as f32;
    if value.is_nan() { f32::NAN } else { value }
}

/// Anomalies of one statistic.
pub(super) struct Held {
    count: usize,
    /// `[cell, anomaly]`, cells as blocks have them, one block after the other; NaN no data.
    values: Vec<f32>,
}

impl Held {
    /// Room for so many of every cell.
    pub(super) fn nothing(count: usize, cells: usize) -> Self {
        Self {
            count,
            values: Vec::with_capacity(count * cells),
        }
    }

    /// Takes those of the next cell, which come first; what comes after them.
    pub(super) fn take<'a>(&mut self, anomalies: &'a [f32]) -> &'a [f32] {
        let (own, rest) = anomalies.split_at(self.count);
        self.values.extend_from_slice(own);
        rest
    }

    /// A run of them.
    pub(super) fn run(&self, blocks: &Blocks, anomalies: Range<usize>) -> RunValues {
        let at = blocks.at();
        let mut values = vec![f32::NAN; at.len() * CELLS * RUN_STEPS];
        let mut of_cells = self.values.chunks_exact(self.count.max(1));
        for (window, out) in blocks
            .windows()
            .iter()
            .zip(values.chunks_exact_mut(CELLS * RUN_STEPS))
        {
            let cells = 0..window.cell_count();
            for (cell, own) in cells.zip(&mut of_cells) {
                let (down, right) = (cell / window.cols as usize, cell % window.cols as usize);
                let maps = out.chunks_exact_mut(CELLS);
                for (map, value) in maps.zip(&own[anomalies.clone()]) {
                    map[down * SIDE + right] = *value;
                }
            }
        }
        RunValues { blocks: at, values }
    }
}
