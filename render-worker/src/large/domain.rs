//! Which cells of a very large grid hold data in some step, and how much of cells of its levels that is.

use std::ops::Range;

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

    /// How many cells of a row hold data in each of some blocks side by side, of so many columns each.
    fn counts(&self, row: u32, blocks: Range<u32>, across: u32) -> Vec<u32> {
        let row_start = row as usize * self.grid.cols as usize;
        let cell = |block: u32| row_start + (block * across).min(self.grid.cols) as usize;
        let (first, across) = (cell(blocks.start), across as usize);
        let mut counts = vec![0; blocks.len()];
        for run in self.cells.runs(first..cell(blocks.end)) {
            let (mut at, end) = (run.start - first, run.end - first);
            while at < end {
                let block = at / across;
                let next = ((block + 1) * across).min(end);
                counts[block] += (next - at) as u32;
                at = next;
            }
        }
        counts
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
            let mut covered_m2 = vec![0.0; window.cols as usize];
            for row in row * down..((row + 1) * down).min(self.grid.rows) {
                let area_m2 = self.grid.cell_area_m2(row, EARTH);
                let mut left = &mut covered_m2[..];
                let mut col = *first_col;
                while !left.is_empty() {
                    let first = col % whole.cols;
                    let count = (whole.cols - first).min(left.len() as u32);
                    let (own, others) = left.split_at_mut(count as usize);
                    let counts = self.counts(row, first..first + count, *across);
                    for (covered_m2, count) in own.iter_mut().zip(counts) {
                        *covered_m2 += f64::from(count) * area_m2;
                    }
                    (left, col) = (others, col + count);
                }
            }
            let block_m2 = whole.cell_area_m2(row, EARTH);
            shares.extend(covered_m2.into_iter().map(|covered_m2| {
                let share = (covered_m2 / block_m2 * f64::from(COVERED)).round() as u32;
                share.clamp(u32::from(covered_m2 > 0.0), COVERED)
            }));
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
        for (row, blocks, across) in [
            (0, 0..200, 1),
            (1, 0..50, 4),
            (2, 3..13, 16),
            (2, 0..13, 16),
            (1, 5..5, 16),
            (2, 63..65, 1),
        ] {
            let of_block = |block: u32| {
                let own = block * across..((block + 1) * across).min(200);
                let own = own.map(|col| (row * 200 + col) as usize);
                own.filter(|cell| has_data(*cell)).count() as u32
            };
            let counts: Vec<u32> = blocks.clone().map(of_block).collect();
            assert_eq!(
                domain.counts(row, blocks.clone(), across),
                counts,
                "{row} {blocks:?} {across}"
            );
        }
        assert!(Domain::of(&GRID, Cells::none(599)).is_none());
    }
}
