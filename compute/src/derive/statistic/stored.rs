//! Which cells of a grid the product of a statistic has: all of its source's, or those about a region.

use std::ops::Range;

use contract::ContractError;
use contract::analysis::MapOptions;
use contract::chunk::{Window, windows};
use contract::grid::Grid;
use cube::BLOCK_CELLS;

use super::wanted::Wanted;

/// Cells that are stored, whole blocks of them, so that a block of the source is one of the product.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Stored {
    source: Grid,
    /// Columns go on past the last one of a source that goes all the way round.
    part: Window,
    /// Of the product.
    pub(super) grid: Grid,
}

impl Stored {
    /// Those of statistics that are derived together.
    ///
    /// # Errors
    /// Some are asked to be cropped, others not; or there is no region to crop to.
    pub(super) fn of(
        source: &Grid,
        options: &[MapOptions],
        wanted: &Wanted,
    ) -> Result<Self, ContractError> {
        let is_cropped = options.first().is_some_and(|one| one.crop);
        if options.iter().any(|one| one.crop != is_cropped) {
            let reason = "statistics that are derived together have one grid";
            return Err(ContractError::invalid("crop", "some", reason));
        }
        if !is_cropped {
            return Ok(Self::part(source, whole(source)));
        }
        match wanted {
            Wanted::All => {
                let reason = "there is no region to crop to";
                Err(ContractError::invalid("crop", "global", reason))
            }
            Wanted::Some(_) => Ok(Self::part(source, about(source, wanted))),
        }
    }

    fn part(source: &Grid, part: Window) -> Self {
        Self {
            source: *source,
            part,
            grid: part.grid(source),
        }
    }

    /// Rows of the source that some rows of the product are.
    pub(super) fn source_rows(&self, rows: &Range<u32>) -> Range<u32> {
        self.part.row + rows.start..self.part.row + rows.end
    }

    /// Where in the product a block of the source lies that has any stored cell: row and column of blocks.
    pub(super) fn block(&self, window: &Window) -> [u32; 2] {
        let right = if window.col < self.part.col {
            window.col + self.source.cols - self.part.col
        } else {
            window.col - self.part.col
        };
        [
            (window.row - self.part.row) / BLOCK_CELLS,
            right / BLOCK_CELLS,
        ]
    }

    /// Place in a map of the product, row-major, of a cell of such a block.
    pub(super) fn place(&self, of_source: usize) -> usize {
        let cols = self.source.cols as usize;
        let (row, col) = (of_source / cols, of_source % cols);
        let (top, left) = (self.part.row as usize, self.part.col as usize);
        let right = if col < left {
            col + cols - left
        } else {
            col - left
        };
        (row - top) * self.part.cols as usize + right
    }

    /// Its cells of a map of the source, `[row, col]`.
    pub(super) fn map<T: Copy>(&self, map: Vec<T>) -> Vec<T> {
        if self.part == whole(&self.source) {
            return map;
        }
        let (cols, part) = (self.source.cols as usize, self.part);
        let rows = map.chunks_exact(cols).skip(part.row as usize);
        let rows = rows.take(part.rows as usize);
        let of_row = |row: &[T]| {
            let row = row.iter().cycle().skip(part.col as usize);
            row.take(part.cols as usize).copied().collect::<Vec<T>>()
        };
        rows.flat_map(of_row).collect()
    }
}

fn whole(grid: &Grid) -> Window {
    Window {
        row: 0,
        col: 0,
        rows: grid.rows,
        cols: grid.cols,
    }
}

/// The least box of whole blocks that has all cells that are wanted. On a grid that goes all the way round it may lie across its first
/// column, if blocks fit into it without a rest.
fn about(grid: &Grid, wanted: &Wanted) -> Window {
    let down = grid.rows.div_ceil(BLOCK_CELLS) as usize;
    let right = grid.cols.div_ceil(BLOCK_CELLS) as usize;
    let (mut rows, mut cols) = (vec![false; down], vec![false; right]);
    for window in windows(grid, BLOCK_CELLS, BLOCK_CELLS) {
        if wanted.is_any_of(grid, window) {
            rows[(window.row / BLOCK_CELLS) as usize] = true;
            cols[(window.col / BLOCK_CELLS) as usize] = true;
        }
    }
    let goes_round = grid.is_periodic() && grid.cols.is_multiple_of(BLOCK_CELLS);
    let [(row, rows), (col, cols)] = [(rows, false), (cols, goes_round)].map(|(is_in, round)| {
        let (first, count) = shortest(&is_in, round);
        (first as u32 * BLOCK_CELLS, count as u32 * BLOCK_CELLS)
    });
    Window {
        row,
        col,
        rows: rows.min(grid.rows - row),
        // Past the last column there are others only where blocks fit.
        cols: if goes_round {
            cols
        } else {
            cols.min(grid.cols - col)
        },
    }
}

/// The shortest run that has all that are in, where it begins and how long it is; past the end it may go on at the beginning.
fn shortest(is_in: &[bool], goes_round: bool) -> (usize, usize) {
    let places: Vec<usize> = (0..is_in.len()).filter(|at| is_in[*at]).collect();
    let (Some(first), Some(last)) = (places.first(), places.last()) else {
        return (0, is_in.len());
    };
    let straight = (*first, last - first + 1);
    if !goes_round {
        return straight;
    }
    // From each one on to the one before it, once round.
    let round = places
        .windows(2)
        .map(|pair| (pair[1], is_in.len() - pair[1] + pair[0] + 1));
    round
        .chain([straight])
        .min_by_key(|(first, count)| (*count, *first))
        .unwrap_or(straight)
}

#[cfg(test)]
mod tests {
    use storage::domain::Cells;

    use super::*;

    fn globe(cols: u32) -> Grid {
        Grid {
            rows: cols / 2,
            cols,
            north_deg: 90.0,
            west_deg: -180.0,
            dlat_deg: 360.0 / f64::from(cols),
            dlon_deg: 360.0 / f64::from(cols),
        }
    }

    /// Around some cells.
    fn stored(grid: &Grid, cells: &[(u32, u32)]) -> Stored {
        let mut wanted = Cells::none(grid.cell_count());
        for (row, col) in cells {
            wanted.insert((row * grid.cols + col) as usize);
        }
        Stored::part(grid, about(grid, &Wanted::Some(wanted)))
    }

    fn edges(stored: &Stored) -> [u32; 4] {
        let part = stored.part;
        [part.row, part.col, part.rows, part.cols]
    }

    #[test]
    fn a_box_of_whole_blocks_lies_about_what_is_wanted() {
        let grid = globe(360);
        assert_eq!(edges(&stored(&grid, &[(9, 17), (30, 40)])), [8, 16, 24, 32]);
        // The last row of blocks is half a one.
        assert_eq!(edges(&stored(&grid, &[(179, 0)])), [176, 0, 4, 8]);
        // Across the date line the short way, where blocks fit.
        assert_eq!(edges(&stored(&grid, &[(0, 3), (0, 350)])), [0, 344, 8, 24]);
        assert_eq!(
            edges(&stored(&globe(180), &[(0, 3), (0, 170)])),
            [0, 0, 8, 176]
        );
        let all: Vec<(u32, u32)> = (0..360).map(|col| (0, col)).collect();
        assert_eq!(edges(&stored(&grid, &all)), [0, 0, 8, 360]);
        let regional = Grid { cols: 352, ..grid };
        assert_eq!(
            edges(&stored(&regional, &[(0, 3), (0, 350)])),
            [0, 0, 8, 352]
        );
    }

    #[test]
    fn maps_and_blocks_are_those_of_the_same_places() {
        let grid = globe(360);
        for cells in [[(9, 17), (30, 40)], [(20, 3), (179, 350)]] {
            let stored = stored(&grid, &cells);
            let numbers: Vec<u32> = (0..grid.cell_count() as u32).collect();
            let map = stored.map(numbers);
            assert_eq!(map.len(), stored.grid.cell_count());
            for (place, number) in map.iter().enumerate() {
                let of_product = (
                    place as u32 / stored.grid.cols,
                    place as u32 % stored.grid.cols,
                );
                let of_source = (number / grid.cols, number % grid.cols);
                let centers = [
                    stored.grid.cell_center(of_product.0, of_product.1),
                    grid.cell_center(of_source.0, of_source.1),
                ];
                assert_eq!(centers[0], centers[1]);
                let own = of_source.0 / 8 * 8;
                let window = Window {
                    row: own,
                    col: of_source.1 / 8 * 8,
                    rows: 8.min(grid.rows - own),
                    cols: 8,
                };
                assert_eq!(stored.block(&window), [of_product.0 / 8, of_product.1 / 8]);
                assert_eq!(stored.place(*number as usize), place);
            }
        }
    }

    #[test]
    fn some_cropped_and_some_not_are_refused_and_so_is_a_crop_to_nothing() {
        let grid = globe(360);
        let option = |crop| MapOptions {
            crop,
            ..MapOptions::new(contract::analysis::MapStatistic::Mean)
        };
        let of = |crops: &[bool], wanted: &Wanted| {
            let options: Vec<MapOptions> = crops.iter().map(|crop| option(*crop)).collect();
            Stored::of(&grid, &options, wanted)
        };
        let mut first = Cells::none(grid.cell_count());
        first.insert(0);
        let one = Wanted::Some(first);
        assert!(of(&[true, false], &one).is_err());
        assert!(of(&[true, true], &Wanted::All).is_err());
        assert_eq!(of(&[true, true], &one).unwrap().grid.cell_count(), 64);
        assert_eq!(of(&[false], &one).unwrap().grid, grid);
    }
}
