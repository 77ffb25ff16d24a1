//! How a field is cut: into chunks that are read and checked each by itself, and where there are many, shards of chunks
//! that are an object each.

use std::ops::Range;

use contract::chunk::Window;
use contract::grid::Grid;

/// Longest side of a chunk, cells: 1 MiB of values at most.
const CHUNK_SIDE: u32 = 512;
/// Above so many chunks a field's objects hold several each.
const MOST_OBJECTS: u32 = 64;
/// Chunks down and across a shard: 64 MiB of values at most.
const SHARD: [u32; 2] = [8, 8];
/// The same of grids of more cells than [`MOST_SQUARE_CELLS`], and of levels: a row of shards is what is held of a field while it is
/// written.
const FLAT_SHARD: [u32; 2] = [2, 32];
/// Grids of so many cells were the largest ones when shards became flat.
const MOST_SQUARE_CELLS: usize = 1 << 28;

/// Steps of a run of the time-major copy: a point reads 32 KiB of values for each, and of what no run holds yet a
/// map-major chunk for each step.
pub const RUN_STEPS: usize = 128;
/// Side of a block of the time-major copy, cells.
pub const BLOCK_CELLS: u32 = 8;

/// How the fields of a grid are cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    /// Rows and columns of a chunk, cells.
    pub chunk: [u32; 2],
    /// Rows and columns of an object, cells: a chunk's, or many times that.
    pub object: [u32; 2],
}

impl Layout {
    /// The layout of a grid: a small one is one chunk; others are cut evenly, so that little of the last ones is empty.
    pub fn of(grid: &Grid) -> Self {
        let is_flat = grid.cell_count() > MOST_SQUARE_CELLS;
        Self::cut(grid, if is_flat { FLAT_SHARD } else { SHARD })
    }

    /// That of the grid of a level.
    pub(crate) fn of_level(grid: &Grid) -> Self {
        Self::cut(grid, FLAT_SHARD)
    }

    fn cut(grid: &Grid, shard: [u32; 2]) -> Self {
        if grid.cell_count() <= (CHUNK_SIDE * CHUNK_SIDE) as usize {
            let whole = [grid.rows, grid.cols];
            return Self {
                chunk: whole,
                object: whole,
            };
        }
        let chunk = [grid.rows, grid.cols].map(|cells| cells.div_ceil(cells.div_ceil(CHUNK_SIDE)));
        let chunks = grid.rows.div_ceil(chunk[0]) * grid.cols.div_ceil(chunk[1]);
        let object = if chunks > MOST_OBJECTS {
            [chunk[0] * shard[0], chunk[1] * shard[1]]
        } else {
            chunk
        };
        Self { chunk, object }
    }

    /// The same chunks, each an object of its own.
    pub(crate) fn without_shards(self) -> Self {
        Self {
            object: self.chunk,
            ..self
        }
    }

    /// Rows and columns of an object of the time-major copy, cells: those of a chunk, in whole blocks.
    pub(crate) fn series_object(&self) -> [u32; 2] {
        self.chunk.map(|cells| cells.next_multiple_of(BLOCK_CELLS))
    }

    /// Is an object more than one chunk?
    pub fn is_sharded(&self) -> bool {
        self.object != self.chunk
    }

    /// Objects of a field of a grid: rows and columns of them.
    pub fn objects(&self, grid: &Grid) -> [u32; 2] {
        [
            grid.rows.div_ceil(self.object[0]),
            grid.cols.div_ceil(self.object[1]),
        ]
    }

    /// Bands of whole rows of chunks of a grid, north to south, that hold at most so many cells each, but for a band of one row of
    /// chunks.
    pub(crate) fn bands(
        &self,
        grid: &Grid,
        most_cells: u64,
    ) -> impl Iterator<Item = Range<u32>> + use<> {
        let (rows, height) = (grid.rows, self.chunk[0]);
        let chunk_row_cells = u64::from(height) * u64::from(grid.cols);
        let chunk_rows = u64::from(rows.div_ceil(height));
        let at_once = (most_cells / chunk_row_cells.max(1)).clamp(1, chunk_rows.max(1));
        let band_rows = at_once as u32 * height;
        let starts = (0..rows.div_ceil(band_rows)).map(move |band| band * band_rows);
        starts.map(move |first| first..first.saturating_add(band_rows).min(rows))
    }

    /// Chunks that a window of cells touches, by row and column of chunks.
    pub(crate) fn chunks_of(&self, window: Window) -> impl Iterator<Item = [u32; 2]> + use<> {
        let [rows, cols] = self.chunk;
        let along = |from: u32, count: u32, side: u32| from / side..(from + count).div_ceil(side);
        let columns = along(window.col, window.cols, cols);
        along(window.row, window.rows, rows)
            .flat_map(move |row| columns.clone().map(move |col| [row, col]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(rows: u32, cols: u32) -> Grid {
        Grid {
            rows,
            cols,
            north_deg: 90.0,
            west_deg: -180.0,
            dlat_deg: 180.0 / f64::from(rows),
            dlon_deg: 360.0 / f64::from(cols),
        }
    }

    #[test]
    fn small_grids_are_whole_and_large_ones_are_cut_evenly() {
        let of = |rows, cols| Layout::of(&grid(rows, cols));
        assert_eq!(of(180, 360).chunk, [180, 360]);
        assert_eq!(of(720, 1440).chunk, [360, 480]);
        assert_eq!(of(450, 615).chunk, [450, 308]);
        assert_eq!(of(450, 615).series_object(), [456, 312]);
        assert!(!of(720, 1440).is_sharded());
        let large = of(9000, 18_000);
        assert_eq!((large.chunk, large.object), ([500, 500], [4000, 4000]));
        let larger = of(18_000, 36_000);
        assert_eq!((larger.chunk, larger.object), ([500, 508], [1000, 16_256]));
        assert_eq!(larger.objects(&grid(18_000, 36_000)), [18, 3]);
        let level = Layout::of_level(&grid(4500, 9000));
        assert_eq!((level.chunk, level.object), ([500, 500], [1000, 16_000]));
    }

    #[test]
    fn bands_are_whole_rows_of_chunks() {
        let of = |grid: &Grid, most_cells| {
            let bands = Layout::of(grid).bands(grid, most_cells);
            let edges = bands.map(|band| [band.start, band.end]);
            edges.collect::<Vec<_>>()
        };
        let small = grid(1030, 600);
        assert_eq!(of(&small, 1), [[0, 344], [344, 688], [688, 1030]]);
        assert_eq!(of(&small, 688 * 600), [[0, 688], [688, 1030]]);
        assert_eq!(of(&small, u64::MAX), [[0, 1030]]);
        let large = of(&grid(18_000, 36_000), 1 << 23);
        assert_eq!((large.len(), large[1]), (36, [500, 1000]));
    }

    #[test]
    fn a_window_touches_the_chunks_that_hold_its_cells() {
        let layout = Layout {
            chunk: [10, 20],
            object: [10, 20],
        };
        let window = Window {
            row: 9,
            col: 20,
            rows: 2,
            cols: 20,
        };
        let touched: Vec<_> = layout.chunks_of(window).collect();
        assert_eq!(touched, [[0, 1], [1, 1]]);
    }
}
