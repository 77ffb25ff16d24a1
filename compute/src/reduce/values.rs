//! Values of some cells along time, as kernels are handed them.

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

impl Values<'_> {
    /// Steps of a cell that are summed, as many as `count`.
    pub(super) fn steps(&self, cell: usize, count: usize) -> &[f32] {
        let start = cell * self.step_count + self.first;
        &self.of[start..start + count]
    }
}
