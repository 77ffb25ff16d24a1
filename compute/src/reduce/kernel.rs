//! Array kernels: values of some cells at some steps and the cells' weights in, sums by step or histograms out.

mod lanes;
mod totals;

use std::ops::Range;

use cube::BLOCK_CELLS;
use cube::scale::Scale;

use self::lanes::{ByStep, Steps};
use self::totals::Totals;
use super::accumulator::StepSums;
use super::cells::CellWeight;
use super::histogram::{Buckets, Histograms};
use super::values::{EqualCells, Values};
use crate::budget::fixed::OutOfRange;

/// Sums of cells of equal weight by step, before they are multiplied with it.
#[derive(Debug, Default)]
struct Equal {
    weight: CellWeight,
    cell_count: usize,
    counts: Vec<i64>,
    sums: Vec<i64>,
    /// Nothing where they are not wanted.
    squares: Vec<i64>,
}

/// Cells that are summed before they are multiplied: a value is below 2⁴⁵ steps, a square below 2⁵⁰.
const MOST_CELLS: usize = 1 << 12;

impl Equal {
    fn clear(&mut self, steps: usize, with_squares: bool) {
        self.cell_count = 0;
        let squares = if with_squares { steps } else { 0 };
        for (sums, steps) in [
            (&mut self.counts, steps),
            (&mut self.sums, steps),
            (&mut self.squares, squares),
        ] {
            sums.clear();
            sums.resize(steps, 0);
        }
    }

    /// Adds cells' runs of steps; is a value among them that cannot be summed?
    fn add(&mut self, cells: EqualCells<'_>, steps: Steps) -> bool {
        self.cell_count += cells.count;
        let mut to = ByStep {
            counts: &mut self.counts,
            steps: &mut self.sums,
            squares: &mut self.squares,
        };
        lanes::add(cells, steps, &mut to)
    }

    /// Adds what was added up to the totals of the steps from `first` on, with the cells' weight.
    fn flush(&mut self, first: usize, totals: &mut Totals) {
        if self.cell_count == 0 {
            return;
        }
        let sums = [&self.counts[..], &self.sums, &self.squares];
        totals.add(first, self.cell_count, self.weight, sums);
        self.clear(self.counts.len(), !self.squares.is_empty());
    }
}

/// Rows of a block: cells side by side weigh the same, those of the next row do not.
const ROWS: usize = BLOCK_CELLS as usize;

/// Sums of some steps while cells are added.
///
/// A value counts as the nearest step of its scale, times the whole number that its cell weighs: integers, so that the order
/// of cells does not matter. Neighbours of equal weight are summed before they are multiplied, across blocks that lie
/// side by side too; a cell that no neighbour weighs the same as, where a geometry ends, is multiplied by itself.
#[derive(Debug)]
pub(super) struct Summing {
    scale: Scale,
    steps_of: Steps,
    with_squares: bool,
    totals: Totals,
    /// Steps that are being added to.
    steps: Range<usize>,
    rows: [Equal; ROWS],
    alone: Equal,
}

impl Summing {
    /// Of so many steps.
    pub(super) fn new(steps: usize, scale: Scale, wanted: [bool; 2]) -> Self {
        let [with_squares, with_extremes] = wanted;
        Self {
            scale,
            steps_of: Steps::of(scale),
            with_squares,
            totals: Totals::new(steps, with_extremes),
            steps: 0..0,
            rows: Default::default(),
            alone: Equal::default(),
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
            self.flush();
            for row in self.rows.iter_mut().chain([&mut self.alone]) {
                row.clear(steps.len(), self.with_squares);
            }
            self.steps = steps;
        }
        let row_cells = if cells.len() == ROWS * ROWS {
            ROWS
        } else {
            cells.len().max(1)
        };
        let mut first = 0;
        for (row, own) in cells.chunks(row_cells).enumerate() {
            let equal = own.chunk_by(PartialEq::eq);
            for equal in equal.flat_map(|equal| equal.chunks(MOST_CELLS)) {
                let run = first..first + equal.len();
                first = run.end;
                if equal[0].weight != 0 {
                    self.add_equal(values, run, equal[0], row)?;
                }
            }
        }
        Ok(())
    }

    /// Adds cells of a row side by side that weigh the same.
    fn add_equal(
        &mut self,
        values: Values<'_>,
        cells: Range<usize>,
        weight: CellWeight,
        row: usize,
    ) -> Result<(), OutOfRange> {
        let (first, step_count) = (self.steps.start, self.steps.len());
        if self.totals.looks_at_extremes() {
            for cell in cells.clone() {
                self.totals.look_at(first, values.steps(cell, step_count));
            }
        }
        let row = &mut self.rows[row];
        let is_alone = row.cell_count > 0 && row.weight != weight && cells.len() == 1;
        let is_beyond = if is_alone && !self.with_squares {
            let own = values.steps(cells.start, step_count);
            self.totals.add_cell(first, own, self.steps_of, weight)
        } else {
            let to = if is_alone { &mut self.alone } else { row };
            if to.weight != weight || to.cell_count + cells.len() > MOST_CELLS {
                to.flush(first, &mut self.totals);
                to.weight = weight;
            }
            let is_beyond = to.add(values.equal_cells(cells.clone()), self.steps_of);
            if is_alone {
                to.flush(first, &mut self.totals);
            }
            is_beyond
        };
        if is_beyond {
            let all = cells.flat_map(|cell| values.steps(cell, step_count));
            return Err(self.beyond(all));
        }
        Ok(())
    }

    /// The value that cannot be summed.
    fn beyond<'a>(&self, mut values: impl Iterator<Item = &'a f32>) -> OutOfRange {
        let beyond = values.find(|it| !it.is_nan() && !self.scale.holds(**it));
        OutOfRange(beyond.copied().unwrap_or(f32::NAN).into())
    }

    fn flush(&mut self) {
        for row in &mut self.rows {
            row.flush(self.steps.start, &mut self.totals);
        }
    }

    /// The sums of all steps.
    pub(super) fn finish(mut self) -> Vec<StepSums> {
        self.flush();
        self.totals.finish()
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
