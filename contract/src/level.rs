//! Coarser levels of a grid: which blocks of cells are joined, where they lie, and means over them.

use crate::earth::Earth;
use crate::grid::Grid;

/// Cells of a level along each side of a cell of the next coarser one.
pub const LEVEL_CELLS: u32 = 4;
/// A level of at most so many cells a side is the coarsest one.
pub const COARSEST_SIDE: u32 = 512;

/// A mean by weight in double precision: what it comes to depends on the order in which cells are added.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct WeightedMean {
    sum: f64,
    weight: f64,
}

impl WeightedMean {
    /// Adds a value that counts so much.
    pub fn add(&mut self, value: f64, weight: f64) {
        self.sum += value * weight;
        self.weight += weight;
    }

    /// Adds all that another one holds.
    pub fn join(&mut self, other: &Self) {
        self.sum += other.sum;
        self.weight += other.weight;
    }

    /// Weight of all that was added.
    pub fn weight(&self) -> f64 {
        self.weight
    }

    /// The mean; none of what has no weight.
    pub fn mean(&self) -> Option<f64> {
        (self.weight > 0.0).then(|| self.sum / self.weight)
    }
}

impl Grid {
    /// The grid of blocks of two by two cells, from the north-west corner on; where one row or column is left, of pairs. Blocks at
    /// the southern and eastern edges may reach beyond this grid, and so beyond a pole, too: [`Grid::validate`] tells.
    #[must_use]
    pub fn halved(&self) -> Self {
        let joined = |count: u32, step_deg: f64| match count {
            1 => (1, step_deg),
            _ => (count.div_ceil(2), 2.0 * step_deg),
        };
        let (rows, dlat_deg) = joined(self.rows, self.dlat_deg);
        let (cols, dlon_deg) = joined(self.cols, self.dlon_deg);
        Self {
            rows,
            cols,
            dlat_deg,
            dlon_deg,
            ..*self
        }
    }
}

/// One coarser level of a grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Level {
    /// From 1 on; the grid itself is level 0.
    pub number: u32,
    /// Its grid, whose last row and column may reach beyond the grid that it is of.
    pub grid: Grid,
    /// Cells of the grid that it is of in a cell of it, down and across; fewer at the southern and eastern edges.
    pub cells: [u32; 2],
}

/// All coarser levels of a grid, the finest first: each joins the one before in blocks of [`LEVEL_CELLS`] a side, until one has at
/// most [`COARSEST_SIDE`] cells a side; none of a grid that is so small.
pub fn levels(grid: &Grid) -> Vec<Level> {
    let mut all: Vec<Level> = vec![];
    let mut last = Level {
        number: 0,
        grid: *grid,
        cells: [1; 2],
    };
    while last.grid.rows.max(last.grid.cols) > COARSEST_SIDE {
        let mut next = Level {
            number: last.number + 1,
            ..last
        };
        // Four are two halvings, so that whoever halves grids comes to the same blocks.
        let mut side = LEVEL_CELLS;
        while side > 1 {
            let halved = next.grid.halved();
            let [down, across] = next.cells;
            let twice = |count: u32, cells: u32| if count > 1 { 2 * cells } else { cells };
            next.cells = [twice(next.grid.rows, down), twice(next.grid.cols, across)];
            next.grid = halved;
            side /= 2;
        }
        all.push(next);
        last = next;
    }
    all
}

impl Level {
    /// First row of the fine grid of every row, and the end of the last one.
    pub fn row_edges(&self, fine: &Grid) -> Vec<u32> {
        let edge = |row: u32| row.saturating_mul(self.cells[0]).min(fine.rows);
        (0..=self.grid.rows).map(edge).collect()
    }

    /// The same of columns.
    pub fn col_edges(&self, fine: &Grid) -> Vec<u32> {
        let edge = |col: u32| col.saturating_mul(self.cells[1]).min(fine.cols);
        (0..=self.grid.cols).map(edge).collect()
    }

    /// Of every row the area of the cells that a cell of it joins in one column of the fine grid, m².
    pub fn row_areas_m2(&self, fine: &Grid, earth: Earth) -> Vec<f64> {
        let edges = self.row_edges(fine);
        let area = |pair: &[u32]| -> f64 {
            let rows = pair[0]..pair[1];
            rows.map(|row| fine.cell_area_m2(row, earth)).sum()
        };
        edges.windows(2).map(area).collect()
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
    fn levels_end_where_one_is_small() {
        let of = |rows, cols| -> Vec<[u32; 4]> {
            let all = levels(&grid(rows, cols));
            let shape = |it: &Level| [it.grid.rows, it.grid.cols, it.cells[0], it.cells[1]];
            all.iter().map(shape).collect()
        };
        assert!(of(512, 512).is_empty() && of(180, 360).is_empty());
        assert_eq!(of(720, 1440), [[180, 360, 4, 4]]);
        assert_eq!(
            of(18_000, 36_000),
            [
                [4500, 9000, 4, 4],
                [1125, 2250, 16, 16],
                [282, 563, 64, 64],
                [71, 141, 256, 256]
            ]
        );
        // A single row stays one.
        assert_eq!(of(1, 1000), [[1, 250, 1, 4]]);
        assert_eq!(of(3, 1000), [[1, 250, 4, 4]]);
    }

    #[test]
    fn a_level_ends_where_its_grid_does_and_keeps_its_area() {
        let fine = grid(723, 1441);
        let [level] = levels(&fine)[..] else {
            panic!("there is one");
        };
        let (rows, cols) = (level.row_edges(&fine), level.col_edges(&fine));
        assert_eq!(rows[rows.len() - 2..], [720, 723]);
        assert_eq!(cols[cols.len() - 2..], [1440, 1441]);
        let areas = level.row_areas_m2(&fine, Earth::Wgs84);
        let whole: f64 = areas.iter().map(|area| area * 1441.0).sum();
        let earth = Earth::Wgs84.cell_area_m2(-90.0, 90.0, 360.0);
        assert!((whole / earth - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_mean_is_by_weight_and_none_of_nothing() {
        let mut mean = WeightedMean::default();
        assert_eq!(mean.mean(), None);
        mean.add(1.0, 3.0);
        mean.add(5.0, 1.0);
        assert_eq!((mean.mean(), mean.weight()), (Some(2.0), 4.0));
    }
}
