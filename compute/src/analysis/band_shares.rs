//! A region of polygons as bands see it: its weights on a grid in; its share of every cell, and the rows and columns that it touches,
//! out.

use std::ops::Range;
use std::sync::Arc;

use contract::chunk::{Window, field_chunks};
use contract::earth::Earth;
use contract::grid::{Grid, rounded_deg, wrap_lon_deg};

use crate::region::loaded::RegionWeights;

/// Share of a cell that two gaps between columns must differ by to be told apart: widths are sums.
const GAP_SLACK: f64 = 1e-3;

/// What corners of regions of many parts are rounded to, degrees, and more than that: edges along those of cells leave slivers so wide on the other side,
/// of which a band would have a mean.
const SLIVER_DEG: f64 = 3e-7;

/// What counts of a cell.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct CellArea {
    /// With its value, m².
    pub(super) area_m2: f64,
    /// For coverage, m².
    pub(super) covered_m2: f64,
}

/// A region's share of every cell of a grid, and that of its sea.
#[derive(Debug, Clone)]
pub(crate) struct BandShares {
    grid: Grid,
    whole: Arc<RegionWeights>,
    sea: Arc<RegionWeights>,
    /// Of each row, the area from which on a cell is one of the region's, m².
    least_m2: Vec<f64>,
}

/// Where a region lies on a grid.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Touched {
    /// From its northernmost row on to its southernmost.
    pub(super) rows: Range<u32>,
    /// Whether each column of the grid lies between its westernmost and its easternmost, the way round that leaves the widest gap out.
    pub(super) cols: Vec<bool>,
    /// West, south, east, north of these cells, degrees; west in [-180, 180).
    pub(super) bounds_deg: [f64; 4],
}

impl BandShares {
    /// Areas of a region and of the sea in it. Slivers of cells are left out, unless the region is no more than that.
    pub(super) fn new(
        (grid, earth): (&Grid, Earth),
        whole: Arc<RegionWeights>,
        sea: Arc<RegionWeights>,
    ) -> Self {
        let sliver = SLIVER_DEG / grid.dlat_deg.min(grid.dlon_deg);
        let least_m2 = (0..grid.rows).map(|row| sliver * grid.cell_area_m2(row, earth));
        let mut own = Self {
            grid: *grid,
            whole,
            sea,
            least_m2: least_m2.collect(),
        };
        let mut has_more = false;
        own.each_cell(|_row, _col| has_more = true);
        if !has_more {
            own.least_m2.fill(0.0);
        }
        own
    }

    /// Its areas of the cells of a row of a window.
    pub(super) fn row(&self, row: u32, window: &Window, areas: &mut [CellArea]) {
        let cols = window.col..window.col + window.cols;
        let (grid_cols, least_m2) = (self.grid.cols, self.least_m2[row as usize]);
        areas.fill(CellArea::default());
        self.whole
            .each_in_row(grid_cols, row, cols.clone(), |col, area_m2| {
                if area_m2 > least_m2 {
                    areas[(col - window.col) as usize].area_m2 = area_m2;
                }
            });
        self.sea.each_in_row(grid_cols, row, cols, |col, area_m2| {
            let own = &mut areas[(col - window.col) as usize];
            if own.area_m2 > 0.0 {
                own.covered_m2 = area_m2;
            }
        });
    }

    /// Hands over row and column of each of the region's cells.
    fn each_cell(&self, mut take: impl FnMut(u32, u32)) {
        let windows = field_chunks(&self.grid);
        for (chunk, areas_m2) in self.whole.chunks() {
            let window = windows[chunk as usize];
            let mut row_start = 0;
            for row in window.row..window.row + window.rows {
                let least_m2 = self.least_m2[row as usize];
                let own = row_start..row_start + window.cols as usize;
                for (cells, _) in areas_m2.runs(own).filter(|(_, m2)| *m2 > least_m2) {
                    cells.for_each(|cell| take(row, window.col + (cell - row_start) as u32));
                }
                row_start += window.cols as usize;
            }
        }
    }

    /// The rows and columns that it touches; none if it lies outside the grid.
    pub(super) fn touched(&self) -> Option<Touched> {
        let grid = &self.grid;
        let mut has_row = vec![false; grid.rows as usize];
        let mut has_col = vec![false; grid.cols as usize];
        self.each_cell(|row, col| {
            has_row[row as usize] = true;
            has_col[col as usize] = true;
        });
        let numbers = |has: &[bool]| -> Vec<u32> {
            let all = (0..).zip(has).filter(|(_, has)| **has);
            all.map(|(number, _)| number).collect()
        };
        let (rows, cols) = (numbers(&has_row), numbers(&has_col));
        let rows = *rows.first()?..*rows.last()? + 1;
        let (first, last) = arc(grid, &cols)?;
        let is_in = |col: u32| {
            if first <= last {
                (first..=last).contains(&col)
            } else {
                col >= first || col <= last
            }
        };
        let width_deg = if first <= last {
            f64::from(last + 1 - first) * grid.dlon_deg
        } else {
            360.0 - f64::from(first - last - 1) * grid.dlon_deg
        };
        let west = wrap_lon_deg(grid.col_west_deg(first));
        Some(Touched {
            cols: (0..grid.cols).map(is_in).collect(),
            bounds_deg: [
                west,
                grid.row_north_deg(rows.end),
                west + width_deg.min(360.0),
                grid.row_north_deg(rows.start),
            ]
            .map(rounded_deg),
            rows,
        })
    }
}

/// The first and the last of some columns, increasing, eastwards from the widest gap between them; of equally wide ones from the one that
/// the grid ends in.
fn arc(grid: &Grid, cols: &[u32]) -> Option<(u32, u32)> {
    let (first, last) = (*cols.first()?, *cols.last()?);
    let beyond_deg = 360.0 - f64::from(last + 1 - first) * grid.dlon_deg;
    let is_wider = |gap: u32| {
        let gap_deg = f64::from(gap) * grid.dlon_deg;
        gap_deg > beyond_deg.max(0.0) + GAP_SLACK * grid.dlon_deg
    };
    let inner = cols.windows(2).map(|pair| (pair[1] - pair[0] - 1, pair));
    Some(match inner.max_by_key(|(gap, _)| *gap) {
        Some((gap, pair)) if is_wider(gap) => (pair[1], pair[0]),
        _ => (first, last),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::region::weights;

    /// A global grid of 45 degrees, or the part of it between 90 W and 180 E.
    fn grid(cols: u32, west_deg: f64) -> Grid {
        Grid {
            rows: 4,
            cols,
            north_deg: 90.0,
            west_deg,
            dlat_deg: 45.0,
            dlon_deg: 45.0,
        }
    }

    fn touched(grid: &Grid, region: &str) -> Option<Touched> {
        let areas = weights::compute(grid, &region.parse().unwrap(), Earth::Wgs84).unwrap();
        let whole = Arc::new(RegionWeights::new(areas));
        BandShares::new((grid, Earth::Wgs84), Arc::clone(&whole), whole).touched()
    }

    #[test]
    fn what_a_region_touches_goes_round_the_way_without_the_widest_gap() {
        let global = grid(8, -180.0);
        let part = grid(6, -90.0);
        let square = |west: u32, east: u32| {
            let [west, east] = [west, east].map(|col| f64::from(col) * 45.0 - 180.0);
            format!("(({west} 1,{east} 1,{east} 40,{west} 40,{west} 1))")
        };
        for (grid, squares, bounds, cols) in [
            // Column 3 alone.
            (global, vec![square(3, 4)], [-45.0, 0.0, 0.0, 45.0], vec![3]),
            // Across the date line.
            (
                global,
                vec![square(7, 9)],
                [135.0, 0.0, 225.0, 45.0],
                vec![0, 7],
            ),
            // Two parts, the gap between them narrower than what is round them.
            (
                global,
                vec![square(2, 3), square(5, 6)],
                [-90.0, 0.0, 90.0, 45.0],
                vec![2, 3, 4, 5],
            ),
            // All the way round.
            (
                global,
                vec![square(0, 8)],
                [-180.0, 0.0, 180.0, 45.0],
                (0..8).collect(),
            ),
            // Both ends of a grid that does not go round: nothing of it lies between them.
            (
                part,
                vec![square(2, 3), square(7, 8)],
                [135.0, 0.0, 315.0, 45.0],
                vec![0, 5],
            ),
        ] {
            let region = format!("MULTIPOLYGON({})", squares.join(","));
            let found = touched(&grid, &region).unwrap();
            let all = (0..grid.cols).filter(|col| found.cols[*col as usize]);
            assert_eq!(all.collect::<Vec<_>>(), cols, "{region}");
            assert_eq!(found.rows, 1..2, "{region}");
            let apart = found.bounds_deg.iter().zip(bounds);
            let is_there = apart.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) < 1e-9;
            assert!(is_there, "{region}: {:?}", found.bounds_deg);
        }
        assert_eq!(
            touched(&part, "POLYGON((-170 1,-100 1,-100 9,-170 1))"),
            None
        );
    }
    #[test]
    fn slivers_beside_a_region_are_none_of_its_cells_and_a_region_may_be_one() {
        let global = grid(8, -180.0);
        for (region, rows) in [
            // A hair across the equator and across 45 E.
            (
                "POLYGON((0 -2e-7,45.0000002 -2e-7,45.0000002 40,0 40,0 -2e-7))",
                1..2,
            ),
            // A square of some 200 m, in two rows.
            (
                "POLYGON((1 -1e-3,1.002 -1e-3,1.002 1e-3,1 1e-3,1 -1e-3))",
                1..3,
            ),
        ] {
            let found = touched(&global, region).unwrap();
            assert_eq!(found.rows, rows, "{region}");
            let cols = found.cols.iter().filter(|is_in| **is_in);
            assert_eq!(cols.count(), 1, "{region}");
        }
    }
}
