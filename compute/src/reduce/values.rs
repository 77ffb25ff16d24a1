//! Values of some cells along time, as kernels are handed them.

use std::ops::Range;

/// Values of some cells.
#[derive(Debug, Clone, Copy)]
pub(super) struct Values<'a> {
    /// `[cell, step]`, stored unit, NaN no data.
    pub(super) of: &'a [f32],
    /// Steps of every cell.
    pub(super) step_count: usize,
    /// The first one that is summed, of them.
    pub(super) first: usize,
}

impl<'a> Values<'a> {
    /// Cells that weigh the same, from the first step on that is summed.
    pub(super) fn equal_cells(&self, cells: Range<usize>) -> EqualCells<'a> {
        EqualCells {
            of: &self.of[cells.start * self.step_count + self.first..],
            stride: self.step_count,
            count: cells.len(),
        }
    }

    /// Steps of a cell that are summed, as many as `count`.
    pub(super) fn steps(&self, cell: usize, count: usize) -> &'a [f32] {
        let start = cell * self.step_count + self.first;
        &self.of[start..start + count]
    }
}

/// Values of cells that weigh the same, all of one length.
#[derive(Debug, Clone, Copy)]
pub(super) struct EqualCells<'a> {
    /// From the first step of the first cell on.
    pub(super) of: &'a [f32],
    /// Values from the first step of a cell to that of the next one.
    pub(super) stride: usize,
    pub(super) count: usize,
}

impl EqualCells<'_> {
    /// Some steps of every cell.
    #[expect(
        clippy::inline_always,
        reason = "a part of loops that are compiled several times"
    )]
    #[inline(always)]
    pub(super) fn lanes<const N: usize>(&self, first: usize) -> impl Iterator<Item = &[f32; N]> {
        let cells = (0..self.count).map(move |cell| cell * self.stride + first);
        cells.filter_map(|at| self.of[at..].first_chunk())
    }
}
