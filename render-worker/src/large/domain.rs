//! Which cells of a very large grid hold data in some step, a bit each, and how much of cells of its levels that is.

use contract::earth::Earth;
use contract::grid::Grid;
use render::stages::layout::COVERED;

use super::choice::Choice;

/// The figure of the earth that blocks of cells are weighed on, as where the renderer joins them.
const EARTH: Earth = Earth::Wgs84;
const WORD_BITS: usize = u64::BITS as usize;

/// A domain.
pub(super) struct Domain {
    grid: Grid,
    /// Row by row, each in whole words; the first cell of a word is its lowest bit.
    words: Vec<u64>,
    row_words: usize,
}

impl Domain {
    /// None if there is not one flag for each cell.
    pub(super) fn of(grid: &Grid, flags: &[bool]) -> Option<Self> {
        if flags.len() != grid.cell_count() {
            return None;
        }
        let cols = grid.cols as usize;
        let word = |flags: &[bool]| {
            let bits = flags.iter().enumerate();
            bits.fold(0, |word, (bit, flag)| word | (u64::from(*flag) << bit))
        };
        let rows = flags.chunks(cols);
        Some(Self {
            words: rows
                .flat_map(|row| row.chunks(WORD_BITS).map(word))
                .collect(),
            row_words: cols.div_ceil(WORD_BITS),
            grid: *grid,
        })
    }

    /// Is it of this grid? It is kept under its content, which says nothing of the grid of another job.
    pub(super) fn is_of(&self, grid: &Grid) -> bool {
        self.grid == *grid
    }

    /// How many of some cells side by side hold data.
    fn count(&self, row: u32, cols: std::ops::Range<u32>) -> u32 {
        let first = row as usize * self.row_words;
        let mut count = 0;
        let mut col = cols.start as usize;
        let end = cols.end as usize;
        while col < end {
            let (word, bit) = (col / WORD_BITS, col % WORD_BITS);
            let taken = (WORD_BITS - bit).min(end - col);
            let mask = u64::MAX >> (WORD_BITS - taken) << bit;
            count += (self.words[first + word] & mask).count_ones();
            col += taken;
        }
        count
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

    #[test]
    fn bits_are_counted_across_words() {
        let grid = Grid {
            rows: 3,
            cols: 200,
            north_deg: 1.0,
            west_deg: 0.0,
            dlat_deg: 0.5,
            dlon_deg: 1.0,
        };
        let flags: Vec<bool> = (0..600).map(|cell| cell % 3 == 0).collect();
        let domain = Domain::of(&grid, &flags).unwrap();
        for (row, cols) in [
            (0, 0..200),
            (1, 63..65),
            (2, 1..130),
            (1, 5..5),
            (2, 128..200),
        ] {
            let own = flags[row * 200..][cols.start as usize..cols.end as usize].iter();
            let count = own.filter(|flag| **flag).count() as u32;
            assert_eq!(
                domain.count(row as u32, cols.clone()),
                count,
                "{row} {cols:?}"
            );
        }
        assert!(Domain::of(&grid, &flags[1..]).is_none());
    }
}
