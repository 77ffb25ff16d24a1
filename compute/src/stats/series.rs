//! One cell's run of steps out of a block of a time-major series.

/// Values of a cell: `values` is `[cell, step]` with `step_count` steps; none if the block has no such cell.
pub fn series_at(values: &[f32], cell: usize, step_count: usize) -> Option<&[f32]> {
    let start = cell.checked_mul(step_count)?;
    values.get(start..start.checked_add(step_count)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_beyond_the_block_has_no_series() {
        let values = [1.0, 2.0, 3.0, 4.0];
        assert_eq!(series_at(&values, 1, 2), Some(&[3.0, 4.0][..]));
        assert_eq!(series_at(&values, 2, 2), None);
        assert_eq!(series_at(&values, usize::MAX, 2), None);
    }
}
