//! What holds values of all cells of a grid at once is refused where there are too many, before anything is allocated.

use contract::grid::Grid;

use crate::ComputeError;

/// Most cells of a grid that is held whole: 2 GiB of exact sums, and some times that beside them.
const MAX_HELD_CELLS: u64 = 1 << 28;

/// # Errors
/// `Expression` if a grid has more cells than are held at once; `what` is what would hold them.
pub(crate) fn check(grid: &Grid, what: &str) -> Result<(), ComputeError> {
    check_cells(u64::from(grid.rows) * u64::from(grid.cols), what)
}

fn check_cells(cells: u64, what: &str) -> Result<(), ComputeError> {
    if cells <= MAX_HELD_CELLS {
        return Ok(());
    }
    let reason = format!(
        "{what} needs all {cells} cells of a map at once, of which {MAX_HELD_CELLS} are held at most: land a coarser product for it; \
         budgets, series and statistics of regions, lines and points are read chunk by chunk"
    );
    Err(ComputeError::Expression { reason })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_cells_than_are_held_are_refused_and_told_of() {
        assert!(check_cells(1 << 28, "accumulating").is_ok());
        let refused = check_cells(648_000_000, "accumulating").unwrap_err();
        assert!(matches!(refused, ComputeError::Expression { .. }));
        let text = refused.to_string();
        assert!(
            text.contains("accumulating needs all 648000000 cells"),
            "{text}"
        );
    }
}
