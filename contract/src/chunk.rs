//! How a grid is cut into chunks: the rows of stored fields and the unit of every array kernel.

use std::ops::Range;

use crate::grid::{Grid, rounded_deg, wrap_lon_deg};

/// Chunk rows of a field. 1-degree grids make 3 x 3 chunks, the 1/60-degree China Sea 41 x 15.
pub const CHUNK_ROWS: u32 = 60;
/// Chunk columns of a field.
pub const CHUNK_COLS: u32 = 120;
/// Cells of a band of a large field, which is what is held of it: 32 MiB of values, a quarter-degree map 8 times.
pub const BAND_CELLS: u64 = 1 << 23;

/// Most noise that the arithmetic of an edge leaves, degrees.
const EDGE_NOISE_DEG: f64 = 1e-12;

/// A rectangle of cells of a grid, row 0 north.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Window {
    /// First row.
    pub row: u32,
    /// First column.
    pub col: u32,
    /// Number of rows, at least 1.
    pub rows: u32,
    /// Number of columns, at least 1.
    pub cols: u32,
}

impl Window {
    /// Number of cells.
    pub fn cell_count(self) -> usize {
        self.rows as usize * self.cols as usize
    }

    /// Flat row-major indices into the grid, in the row-major order of the window.
    pub fn cell_indices(self, grid: &Grid) -> impl Iterator<Item = usize> + use<> {
        let grid_cols = grid.cols as usize;
        (self.row..self.row + self.rows).flat_map(move |r| {
            let start = r as usize * grid_cols + self.col as usize;
            start..start + self.cols as usize
        })
    }

    /// The grid that its cells are by themselves. Of a grid that goes all the way round its columns may go on past the last one.
    pub fn grid(self, whole: &Grid) -> Grid {
        // Where steps are no binary fraction their sum has noise, which an edge of nine decimals has not.
        let clean = |deg: f64| {
            let rounded = rounded_deg(deg);
            if (rounded - deg).abs() < EDGE_NOISE_DEG {
                rounded
            } else {
                deg
            }
        };
        Grid {
            rows: self.rows,
            cols: self.cols,
            north_deg: if self.row == 0 {
                whole.north_deg
            } else {
                clean(whole.row_north_deg(self.row))
            },
            west_deg: if self.col == 0 {
                whole.west_deg
            } else {
                wrap_lon_deg(clean(whole.col_west_deg(self.col)))
            },
            ..*whole
        }
    }
}

/// Windows that tile `grid` in blocks of `rows` x `cols`, north to south, then west to east; edge blocks are smaller.
///
/// # Panics
/// Never for blocks of at least one cell; `rows` and `cols` are compile-time constants of their callers.
pub fn windows(grid: &Grid, rows: u32, cols: u32) -> Vec<Window> {
    (0..grid.rows.div_ceil(rows))
        .flat_map(|i| (0..grid.cols.div_ceil(cols)).map(move |j| (i * rows, j * cols)))
        .map(|(row, col)| Window {
            row,
            col,
            rows: rows.min(grid.rows - row),
            cols: cols.min(grid.cols - col),
        })
        .collect()
}

/// The chunks of a field of `grid`; a chunk's number is its place in this list.
pub fn field_chunks(grid: &Grid) -> Vec<Window> {
    windows(grid, CHUNK_ROWS, CHUNK_COLS)
}

/// How many chunks a field of `grid` has.
pub fn field_chunk_count(grid: &Grid) -> u64 {
    u64::from(grid.rows.div_ceil(CHUNK_ROWS)) * u64::from(grid.cols.div_ceil(CHUNK_COLS))
}

/// Bands of whole rows of chunks, north to south, that hold at most so many cells each, but for a band of one row of chunks: what
/// large fields are read and written by.
pub fn bands(grid: &Grid, most_cells: u64) -> impl Iterator<Item = Range<u32>> + use<> {
    let (rows, chunk_row_cells) = (grid.rows, u64::from(CHUNK_ROWS) * u64::from(grid.cols));
    let chunk_rows =
        (most_cells / chunk_row_cells.max(1)).clamp(1, u64::from(u32::MAX / CHUNK_ROWS));
    let band_rows = chunk_rows as u32 * CHUNK_ROWS;
    let starts = (0..rows.div_ceil(band_rows)).map(move |band| band * band_rows);
    starts.map(move |first| first..first.saturating_add(band_rows).min(rows))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_are_whole_rows_of_chunks_and_at_least_one() {
        let grid = |rows, cols| Grid {
            rows,
            cols,
            north_deg: 90.0,
            west_deg: -180.0,
            dlat_deg: 180.0 / f64::from(rows),
            dlon_deg: 360.0 / f64::from(cols),
        };
        let of = |grid: &Grid, cells| {
            let edges = bands(grid, cells).map(|band| [band.start, band.end]);
            edges.collect::<Vec<_>>()
        };
        assert_eq!(of(&grid(150, 100), 12_500), [[0, 120], [120, 150]]);
        assert_eq!(of(&grid(150, 100), 1), [[0, 60], [60, 120], [120, 150]]);
        assert_eq!(of(&grid(150, 100), u64::MAX), [[0, 150]]);
        assert_eq!(of(&grid(1, 1), 1), [[0, 1]]);
        let large = of(&grid(18_000, 36_000), 1 << 23);
        assert_eq!((large.len(), large[1]), (100, [180, 360]));
    }

    #[test]
    fn the_cells_of_a_window_by_themselves_are_those_of_the_whole() {
        let globe = |cols: u32| Grid {
            rows: cols / 2,
            cols,
            north_deg: 90.0,
            west_deg: -180.0,
            dlat_deg: 360.0 / f64::from(cols),
            dlon_deg: 360.0 / f64::from(cols),
        };
        let window = |row, col, rows, cols| Window {
            row,
            col,
            rows,
            cols,
        };
        for whole in [globe(360), globe(3600)] {
            let all = window(0, 0, whole.rows, whole.cols);
            assert_eq!(all.grid(&whole), whole);
            let own = window(24, whole.cols - 8, 16, 24).grid(&whole);
            own.validate().unwrap();
            for (row, col) in [(0, 0), (3, 7), (15, 8), (9, 23)] {
                let (of_own, of_whole) = (
                    own.cell_center(row, col),
                    whole.cell_center(24 + row, (whole.cols - 8 + col) % whole.cols),
                );
                assert!((of_own.lat - of_whole.lat).abs() < 1e-11);
                assert!((of_own.lon - of_whole.lon).abs() < 1e-11);
            }
        }
        let own = window(502, 1203, 8, 8).grid(&globe(3600));
        let edges = format!("{} {}", own.north_deg, own.west_deg);
        assert_eq!(edges, "39.8 -59.7");
    }

    #[test]
    fn chunks_cover_every_cell_once() {
        let grid = Grid {
            rows: 125,
            cols: 250,
            north_deg: 10.0,
            west_deg: 100.0,
            dlat_deg: 0.1,
            dlon_deg: 0.1,
        };
        let mut seen = vec![0u8; grid.cell_count()];
        assert_eq!(field_chunks(&grid).len() as u64, field_chunk_count(&grid));
        for window in field_chunks(&grid) {
            window.cell_indices(&grid).for_each(|i| seen[i] += 1);
        }
        assert!(seen.iter().all(|&n| n == 1));
    }
}
