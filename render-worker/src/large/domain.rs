//! Which cells of a very large grid hold data in some step, a bit each, and how much of cells of its levels that is.

use contract::earth::Earth;
use contract::grid::Grid;
use render::stages::layout::COVERED;
use storage::domain::Cells;

use super::choice::Choice;

/// The figure of the earth that blocks of cells are weighed on, as where the renderer joins them.
const EARTH: Earth = Earth::Wgs84;

/// A domain.
pub(super) struct Domain {
    grid: Grid,
    cells: Cells,
}

impl Domain {
    /// None if the map of these cells is not as large as the grid.
    pub(super) fn of(grid: &Grid, cells: Cells) -> Option<Self> {
        (cells.map_count() == grid.cell_count()).then_some(Self { grid: *grid, cells })
    }

    /// Is it of this grid? It is kept under its content, which says nothing of the grid of another job.
    pub(super) fn is_of(&self, grid: &Grid) -> bool {
        self.grid == *grid
    }

    /// How many of some cells side by side hold data.
    fn count(&self, row: u32, cols: std::ops::Range<u32>) -> u32 {
        let first = row as usize * self.grid.cols as usize;
        let cells = first + cols.start as usize..first + cols.end as usize;
        self.cells.count_in(cells) as u32
    }

    /// How much of every cell of a window holds data, `[row, col]`, of [`COVERED`]: what holds any keeps some. A cell at the edge of
    /// the grid counts as large as the others of its row.
    pub(super) fn shares(&self, choice: &Choice) -> Vec<u32> {
        let Choice {
            cells: [down, across],
            corner: [first_row, first_col],
            window,
            whole,
            ..
        } = choice;
        let mut shares = Vec::with_capacity(window.cell_count());
        for row in *first_row..first_row + window.rows {
            let rows = row * down..((row + 1) * down).min(self.grid.rows);
            let areas: Vec<f64> = rows
                .clone()
                .map(|row| self.grid.cell_area_m2(row, EARTH))
                .collect();
            let block_m2 = whole.cell_area_m2(row, EARTH);
            for col in *first_col..first_col + window.cols {
                let col = col % whole.cols;
                let cols = col * across..((col + 1) * across).min(self.grid.cols);
                let covered = rows
                    .clone()
                    .zip(&areas)
                    .map(|(row, area_m2)| f64::from(self.count(row, cols.clone())) * area_m2);
                let covered_m2: f64 = covered.sum();
                let share = (covered_m2 / block_m2 * f64::from(COVERED)).round() as u32;
                shares.push(share.clamp(u32::from(covered_m2 > 0.0), COVERED));
            }
        }
        shares
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: Grid = Grid {
        rows: 3,
        cols: 200,
        north_deg: 1.0,
        west_deg: 0.0,
        dlat_deg: 0.5,
        dlon_deg: 1.0,
    };

    #[test]
    fn cells_are_counted_within_their_rows() {
        let has_data = |cell: usize| cell.is_multiple_of(3);
        let mut cells = Cells::none(600);
        (0..600)
            .filter(|cell| has_data(*cell))
            .for_each(|cell| cells.insert(cell));
        let domain = Domain::of(&GRID, cells).unwrap();
        for (row, cols) in [
            (0, 0..200),
            (1, 63..65),
            (2, 1..130),
            (1, 5..5),
            (2, 128..200),
        ] {
            let own = cols.clone().map(|col| (row * 200 + col) as usize);
            let count = own.filter(|cell| has_data(*cell)).count() as u32;
            assert_eq!(domain.count(row, cols.clone()), count, "{row} {cols:?}");
        }
        assert!(Domain::of(&GRID, Cells::none(599)).is_none());
    }
}
