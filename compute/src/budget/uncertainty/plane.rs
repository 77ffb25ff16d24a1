//! The cells that a region lies in as rows and columns at even distances, joined to blocks where there are too many.

use contract::chunk::field_chunks;
use contract::grid::Grid;

use crate::region::loaded::RegionWeights;

/// Length of a degree of latitude on the sphere of 6371 km, km.
const KM_PER_DEG: f64 = SPHERE_RADIUS_KM * std::f64::consts::PI / 180.0;
/// The sphere that distances are measured on, km.
pub(super) const SPHERE_RADIUS_KM: f64 = 6371.0;

/// Rows and columns of blocks of cells; a block is one cell or more, and lies where its middle is.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Plane {
    /// Latitude of the middle of each row, degrees.
    pub(super) lats_deg: Vec<f64>,
    /// Distance of two columns, degrees.
    pub(super) dlon_deg: f64,
    /// Number of columns.
    pub(super) cols: usize,
    /// Do they go all the way round?
    pub(super) is_ring: bool,
}

/// Where cells of a grid lie in a plane.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Window {
    /// First row of the grid.
    first_row: usize,
    rows: usize,
    /// First column.
    first_col: usize,
    cols: usize,
    grid_cols: usize,
    /// The window goes round the whole grid, which goes round the earth.
    is_ring: bool,
    /// Cells along each side of a block.
    pub(super) block: usize,
}

impl Window {
    /// The smallest one that holds a region, its blocks of one cell; none of a region without area.
    pub(super) fn of(grid: &Grid, weights: &RegionWeights) -> Option<Self> {
        let (rows, cols) = (grid.rows as usize, grid.cols as usize);
        let (mut has_row, mut has_col) = (vec![false; rows], vec![false; cols]);
        let windows = field_chunks(grid);
        for (chunk, areas_m2) in weights.chunks() {
            let cells = windows[chunk as usize].cell_indices(grid);
            for (cell, _) in cells.zip(areas_m2.iter()).filter(|(_, area)| *area > 0.0) {
                has_row[cell / cols] = true;
                has_col[cell % cols] = true;
            }
        }
        let first_row = has_row.iter().position(|has| *has)?;
        let last_row = has_row.iter().rposition(|has| *has)?;
        let (first_col, width) = shortest_run(&has_col, grid.is_periodic());
        // Beyond half a turn it is cheaper to go round.
        let is_ring = grid.is_periodic() && 2 * width > cols;
        Some(Self {
            first_row,
            rows: last_row + 1 - first_row,
            first_col: if is_ring { 0 } else { first_col },
            cols: if is_ring { cols } else { width },
            grid_cols: cols,
            is_ring,
            block: 1,
        })
    }

    /// The same with blocks of so many cells a side; none where they do not go round evenly.
    pub(super) fn with_blocks(&self, block: usize) -> Option<Self> {
        let is_even = !self.is_ring || self.cols.is_multiple_of(block);
        is_even.then(|| Self {
            block,
            ..self.clone()
        })
    }

    /// Rows and columns of blocks.
    pub(super) fn size(&self) -> (usize, usize) {
        (
            self.rows.div_ceil(self.block),
            self.cols.div_ceil(self.block),
        )
    }

    /// Where the blocks lie.
    pub(super) fn plane(&self, grid: &Grid) -> Plane {
        let (rows, cols) = self.size();
        let end = self.first_row + self.rows;
        let lat_deg = |row: usize| {
            let north = self.first_row + row * self.block;
            let south = (north + self.block).min(end);
            0.5 * (grid.row_north_deg(north as u32) + grid.row_north_deg(south as u32))
        };
        let dlon_deg = if self.is_ring {
            360.0 / self.grid_cols as f64
        } else {
            grid.dlon_deg
        };
        Plane {
            lats_deg: (0..rows).map(lat_deg).collect(),
            dlon_deg: dlon_deg * self.block as f64,
            cols,
            is_ring: self.is_ring,
        }
    }

    /// How many blocks go round the earth; none if that is no whole number.
    pub(super) fn round(&self, grid: &Grid) -> Option<usize> {
        /// Share of a block: axes of grids are rounded.
        const SLACK: f64 = 1e-6;
        let round = 360.0 / self.plane(grid).dlon_deg;
        ((round - round.round()).abs() < SLACK).then_some(round.round() as usize)
    }

    /// Longer side of the largest block, km.
    pub(super) fn block_km(&self, grid: &Grid) -> f64 {
        let lats_deg = self.plane(grid).lats_deg;
        let widest = lats_deg.iter().map(|lat| lat.to_radians().cos());
        let widest = widest.fold(0.0, f64::max);
        self.block as f64 * KM_PER_DEG * grid.dlat_deg.max(grid.dlon_deg * widest)
    }

    /// The block of a cell of the grid, as a place in the plane's rows.
    pub(super) fn block_of(&self, cell: usize) -> usize {
        let (row, col) = (cell / self.grid_cols, cell % self.grid_cols);
        let col = (col + self.grid_cols - self.first_col) % self.grid_cols;
        (row - self.first_row) / self.block * self.cols.div_ceil(self.block) + col / self.block
    }
}

/// First column and number of columns of the shortest run that holds all that are marked.
fn shortest_run(has_col: &[bool], is_periodic: bool) -> (usize, usize) {
    let cols = has_col.len();
    let marked: Vec<usize> = (0..cols).filter(|col| has_col[*col]).collect();
    let (Some(first), Some(last)) = (marked.first(), marked.last()) else {
        return (0, 0);
    };
    let (mut best, mut width) = (*first, last + 1 - first);
    if is_periodic {
        for pair in marked.windows(2) {
            // From the second one round to the first one.
            let round = pair[0] + cols + 1 - pair[1];
            if round < width {
                (best, width) = (pair[1], round);
            }
        }
    }
    (best, width)
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: Grid = Grid {
        rows: 18,
        cols: 36,
        north_deg: 90.0,
        west_deg: -180.0,
        dlat_deg: 10.0,
        dlon_deg: 10.0,
    };

    fn window(cells: &[(usize, usize)]) -> Window {
        let mut areas = vec![0.0; GRID.cell_count()];
        for (row, col) in cells {
            areas[row * 36 + col] = 1.0;
        }
        Window::of(&GRID, &RegionWeights::new(vec![(0, areas)])).unwrap()
    }

    #[test]
    fn a_region_across_the_date_line_is_one_short_run() {
        let own = window(&[(3, 34), (4, 1)]);
        assert_eq!(own.size(), (2, 4));
        assert_eq!(
            (own.block_of(3 * 36 + 34), own.block_of(4 * 36 + 1)),
            (0, 7)
        );
        let plane = own.plane(&GRID);
        assert!(!plane.is_ring && plane.lats_deg == [55.0, 45.0]);
    }

    #[test]
    fn what_goes_more_than_half_round_goes_all_the_way() {
        let own = window(&[(9, 2), (9, 14), (9, 26)]);
        assert_eq!((own.size(), own.plane(&GRID).is_ring), ((1, 36), true));
        assert_eq!(own.block_of(9 * 36 + 26), 26);
        assert!(own.with_blocks(5).is_none());
        let blocks = own.with_blocks(4).unwrap();
        assert_eq!((blocks.size(), blocks.block_of(9 * 36 + 26)), ((1, 9), 6));
        assert!((blocks.plane(&GRID).dlon_deg - 40.0).abs() < 1e-12);
    }

    #[test]
    fn blocks_at_the_rim_lie_where_their_cells_do() {
        let own = window(&[(2, 3), (6, 9)]).with_blocks(2).unwrap();
        assert_eq!(own.size(), (3, 4));
        // Rows 2 and 3, 4 and 5, and 6 alone.
        assert_eq!(own.plane(&GRID).lats_deg, [60.0, 40.0, 25.0]);
        assert_eq!(own.block_of(6 * 36 + 9), 2 * 4 + 3);
    }
}
