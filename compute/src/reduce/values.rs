//! Values of some cells along time, as kernels are handed them.

/// Values of some cells, `[cell, step]`, stored unit, NaN no data.
#[derive(Debug, Clone, Copy)]
pub(super) struct Values<'a> {
    pub(super) values: &'a [f32],
    /// Steps of every cell.
    pub(super) step_count: usize,
    /// The first one that is summed, of them.
    pub(super) first: usize,
}

impl Values<'_> {
    /// Steps of a cell that are summed, as many as `count`.
    pub(super) fn steps(&self, cell: usize, count: usize) -> &[f32] {
        let start = cell * self.step_count + self.first;
        &self.values[start..start + count]
    }
}
