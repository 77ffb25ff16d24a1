//! Array kernels: values of some cells at some steps and the cells' weights in, sums by step or histograms out.

use super::accumulator::StepSums;
use super::cells::CellWeight;
use super::histogram::{Buckets, Histograms};
use super::scale::{Scale, nearest};
use crate::budget::fixed::OutOfRange;

/// A block of values, `[cell, step]`, stored unit, NaN no data, and the cells' weights.
#[derive(Debug, Clone, Copy)]
pub(super) struct Block<'a> {
    pub(super) values: &'a [f32],
    /// Steps of every cell.
    pub(super) step_count: usize,
    /// Those that are summed, of them.
    pub(super) first: usize,
    pub(super) cells: &'a [CellWeight],
}

impl Block<'_> {
    /// Steps of a cell that are summed, as many as `count`.
    fn steps(&self, cell: usize, count: usize) -> &[f32] {
        let start = cell * self.step_count + self.first;
        &self.values[start..start + count]
    }
}

/// Sums of cells of equal weight by step, before they are multiplied with it.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    counts: Vec<i64>,
    sums: Vec<i64>,
    squares: Vec<i64>,
    mins: Vec<f32>,
    maxs: Vec<f32>,
}

impl Scratch {
    fn clear(&mut self, steps: usize) {
        for sums in [&mut self.counts, &mut self.sums, &mut self.squares] {
            sums.clear();
            sums.resize(steps, 0);
        }
        self.mins.clear();
        self.mins.resize(steps, f32::INFINITY);
        self.maxs.clear();
        self.maxs.resize(steps, f32::NEG_INFINITY);
    }

    /// Adds a cell's run of steps.
    fn add(&mut self, values: &[f32], scale: Scale, with_squares: bool) {
        let (zero, factor) = (scale.zero, scale.steps_per_value());
        let own = self.counts.iter_mut().zip(&mut self.sums);
        for ((count, sum), value) in own.zip(values) {
            let is_there = !value.is_nan();
            let steps = (f64::from(*value) - zero) * factor;
            // What is beyond anything physical is found when the extremes are looked at.
            *sum = sum.wrapping_add(nearest(if is_there { steps } else { 0.0 }));
            *count += i64::from(is_there);
        }
        for ((min, max), value) in self.mins.iter_mut().zip(&mut self.maxs).zip(values) {
            *min = if *value < *min { *value } else { *min };
            *max = if *value > *max { *value } else { *max };
        }
        if with_squares {
            let to_squares = Scale::squares_per_step();
            for (sum, value) in self.squares.iter_mut().zip(values) {
                let steps = (f64::from(*value) - zero) * factor;
                let square = steps * steps * to_squares;
                *sum = sum.wrapping_add(nearest(if value.is_nan() { 0.0 } else { square }));
            }
        }
    }

    /// Adds what was added up to `out`, with the cells' weight.
    fn flush(
        &self,
        weight: CellWeight,
        scale: Scale,
        out: &mut [StepSums],
    ) -> Result<(), OutOfRange> {
        for (step, own) in out.iter_mut().enumerate() {
            let count = self.counts[step];
            if count == 0 {
                continue;
            }
            let (min, max) = (self.mins[step], self.maxs[step]);
            for value in [min, max] {
                if !scale.holds(value) {
                    return Err(OutOfRange(value.into()));
                }
            }
            let weighed = |sum: i64| i128::from(sum) * i128::from(weight.weight);
            own.count += count.unsigned_abs();
            own.weight += weighed(count);
            own.covered += i128::from(count) * i128::from(weight.covered);
            own.sum += weighed(self.sums[step]);
            own.squares += weighed(self.squares[step]);
            own.min = own.min.min(min);
            own.max = own.max.max(max);
        }
        Ok(())
    }
}

/// Adds a block to the sums of the steps that are summed.
///
/// A value counts as the nearest step of its scale, times the whole number that its cell weighs: integers, so that the order
/// of cells does not matter. Neighbours of equal weight are summed before they are multiplied.
///
/// # Errors
/// A value beyond anything physical.
pub(super) fn add_sums(
    block: Block<'_>,
    scale: Scale,
    with_squares: bool,
    scratch: &mut Scratch,
    out: &mut [StepSums],
) -> Result<(), OutOfRange> {
    let mut cells = block.cells.iter().enumerate().peekable();
    while let Some((cell, &weight)) = cells.next() {
        if weight.weight == 0 {
            continue;
        }
        scratch.clear(out.len());
        scratch.add(block.steps(cell, out.len()), scale, with_squares);
        while let Some((cell, _)) = cells.next_if(|(_, next)| **next == weight) {
            scratch.add(block.steps(cell, out.len()), scale, with_squares);
        }
        scratch.flush(weight, scale, out)?;
    }
    Ok(())
}

/// What a step adds to.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Target {
    /// Place of the step behind the block's first summed one.
    pub(super) step: usize,
    /// Numbers of ranges, and the time that the step has in the bin of each.
    pub(super) ranges: Vec<(u32, i64)>,
}

/// Adds a block's weights to histograms. None if a sum leaves 128 bits.
pub(super) fn add_weights(
    block: Block<'_>,
    targets: &[Target],
    ranges: &[Buckets],
    out: &mut Histograms,
) -> Option<()> {
    let count = targets.last().map_or(0, |last| last.step + 1);
    for (cell, weight) in block.cells.iter().enumerate() {
        if weight.weight == 0 {
            continue;
        }
        let values = block.steps(cell, count);
        for target in targets {
            let value = values[target.step];
            if value.is_nan() {
                continue;
            }
            for (range, time) in &target.ranges {
                let weight = i128::from(weight.weight) * i128::from(*time);
                let range = *range as usize;
                out.add(range, *ranges.get(range)?, value, weight)?;
            }
        }
    }
    Some(())
}

#[cfg(test)]
mod tests;
