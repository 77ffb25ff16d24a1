//! Array kernels: values of some cells at some steps and the cells' weights in, sums by step or histograms out.

use std::ops::Range;

use cube::BLOCK_CELLS;
use cube::scale::Scale;

use super::accumulator::StepSums;
use super::cells::CellWeight;
use super::histogram::{Buckets, Histograms};
use super::values::Values;
use crate::budget::fixed::OutOfRange;

/// Sums of cells of equal weight by step, before they are multiplied with it.
#[derive(Debug, Default)]
struct Equal {
    weight: CellWeight,
    cell_count: usize,
    counts: Vec<i64>,
    sums: Vec<i64>,
    squares: Vec<i64>,
    mins: Vec<f32>,
    maxs: Vec<f32>,
}

/// Cells that are summed before they are multiplied: a value is below 2⁴⁵ steps, a square below 2⁵⁰.
const MOST_CELLS: usize = 1 << 12;

impl Equal {
    fn clear(&mut self, steps: usize) {
        self.cell_count = 0;
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
        self.cell_count += 1;
        let own = self.counts.iter_mut().zip(&mut self.sums);
        for ((count, sum), value) in own.zip(values) {
            let is_there = !value.is_nan();
            let steps = scale.steps(*value);
            // What is beyond anything physical is found when the extremes are looked at.
            *sum = sum.wrapping_add(if is_there { steps } else { 0 });
            *count += i64::from(is_there);
        }
        for ((min, max), value) in self.mins.iter_mut().zip(&mut self.maxs).zip(values) {
            *min = if *value < *min { *value } else { *min };
            *max = if *value > *max { *value } else { *max };
        }
        if with_squares {
            for (sum, value) in self.squares.iter_mut().zip(values) {
                let square = scale.square_steps(*value);
                *sum = sum.wrapping_add(if value.is_nan() { 0 } else { square });
            }
        }
    }

    /// Adds what was added up to `out`, with the cells' weight.
    fn flush(
        &mut self,
        scale: Scale,
        with_squares: bool,
        out: &mut [StepSums],
    ) -> Result<(), OutOfRange> {
        if self.cell_count == 0 {
            return Ok(());
        }
        self.check(scale)?;
        let CellWeight { weight, covered } = self.weight;
        for (step, own) in out.iter_mut().enumerate() {
            // Below 2⁵⁰: as many cells as are summed, of a weight each.
            let count = self.counts[step];
            own.count += count.unsigned_abs();
            own.weight += i128::from(count * weight);
            own.covered += i128::from(count * covered);
            own.sum += i128::from(self.sums[step]) * i128::from(weight);
            own.min = own.min.min(self.mins[step]);
            own.max = own.max.max(self.maxs[step]);
        }
        if with_squares {
            for (own, squares) in out.iter_mut().zip(&self.squares) {
                own.squares += i128::from(*squares) * i128::from(weight);
            }
        }
        self.clear(out.len());
        Ok(())
    }

    /// Is there nothing beyond anything physical?
    fn check(&self, scale: Scale) -> Result<(), OutOfRange> {
        let low = self.mins.iter().copied().fold(f32::INFINITY, f32::min);
        let high = self.maxs.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        if low > high || (scale.holds(low) && scale.holds(high)) {
            return Ok(());
        }
        for (step, count) in self.counts.iter().enumerate() {
            for value in [self.mins[step], self.maxs[step]] {
                if *count > 0 && !scale.holds(value) {
                    return Err(OutOfRange(value.into()));
                }
            }
        }
        Ok(())
    }
}

/// Rows of a block: cells side by side weigh the same, those of the next row do not.
const ROWS: usize = BLOCK_CELLS as usize;

/// Sums of some steps while cells are added.
///
/// A value counts as the nearest step of its scale, times the whole number that its cell weighs: integers, so that the order
/// of cells does not matter. Neighbours of equal weight are summed before they are multiplied, across blocks that lie
/// side by side too.
#[derive(Debug)]
pub(super) struct Summing {
    scale: Scale,
    with_squares: bool,
    out: Vec<StepSums>,
    /// Steps that are being added to.
    steps: Range<usize>,
    rows: [Equal; ROWS],
}

impl Summing {
    /// Of so many steps.
    pub(super) fn new(steps: usize, scale: Scale, with_squares: bool) -> Self {
        Self {
            scale,
            with_squares,
            out: vec![StepSums::default(); steps],
            steps: 0..0,
            rows: Default::default(),
        }
    }

    /// Adds cells, whose summed steps are these.
    ///
    /// # Errors
    /// A value beyond anything physical.
    pub(super) fn add(
        &mut self,
        values: Values<'_>,
        cells: &[CellWeight],
        steps: Range<usize>,
    ) -> Result<(), OutOfRange> {
        if self.steps != steps {
            self.flush()?;
            for row in &mut self.rows {
                row.clear(steps.len());
            }
            self.steps = steps;
        }
        let (scale, with_squares) = (self.scale, self.with_squares);
        let is_block = cells.len() == ROWS * ROWS;
        for (cell, weight) in cells.iter().enumerate() {
            if weight.weight == 0 {
                continue;
            }
            let row = &mut self.rows[if is_block { cell / ROWS } else { 0 }];
            if row.weight != *weight || row.cell_count == MOST_CELLS {
                row.flush(scale, with_squares, &mut self.out[self.steps.clone()])?;
                row.weight = *weight;
            }
            row.add(values.steps(cell, self.steps.len()), scale, with_squares);
        }
        Ok(())
    }

    fn flush(&mut self) -> Result<(), OutOfRange> {
        for row in &mut self.rows {
            row.flush(
                self.scale,
                self.with_squares,
                &mut self.out[self.steps.clone()],
            )?;
        }
        Ok(())
    }

    /// The sums of all steps.
    ///
    /// # Errors
    /// A value beyond anything physical.
    pub(super) fn finish(mut self) -> Result<Vec<StepSums>, OutOfRange> {
        self.flush()?;
        Ok(self.out)
    }
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
    block: Values<'_>,
    cells: &[CellWeight],
    targets: &[Target],
    ranges: &[Buckets],
    out: &mut Histograms,
) -> Option<()> {
    let count = targets.last().map_or(0, |last| last.step + 1);
    for (cell, weight) in cells.iter().enumerate() {
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
