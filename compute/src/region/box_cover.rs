//! A box on a grid: the area of each row's and each column's share, whose products are the cells' areas.

use contract::chunk::Window;
use contract::earth::Earth;
use contract::grid::Grid;

/// Bounds of a box, degrees; `east` may pass 180.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bounds {
    pub(super) west: f64,
    pub(super) south: f64,
    pub(super) east: f64,
    pub(super) north: f64,
}

impl Bounds {
    /// All of the earth, as seen from a grid.
    pub(super) fn global(grid: &Grid) -> Self {
        Self {
            west: grid.west_deg,
            south: -90.0,
            east: grid.west_deg + 360.0,
            north: 90.0,
        }
    }
}

/// Area of the box's share of every cell of a window, m², row-major in the window.
pub(super) fn areas_m2(bounds: Bounds, grid: &Grid, window: Window, earth: Earth) -> Vec<f64> {
    let widths_deg: Vec<f64> = (window.col..window.col + window.cols)
        .map(|col| width_deg(bounds, grid, col))
        .collect();
    let mut areas = Vec::with_capacity(window.cell_count());
    for row in window.row..window.row + window.rows {
        let north = grid.row_north_deg(row).min(bounds.north);
        let south = grid.row_north_deg(row + 1).max(bounds.south);
        if north <= south {
            areas.resize(areas.len() + widths_deg.len(), 0.0);
        } else {
            areas.extend(
                widths_deg
                    .iter()
                    .map(|&width| earth.cell_area_m2(south, north, width)),
            );
        }
    }
    areas
}

/// Width of the box's share of a column, degrees. The box may lie a turn east or west of the grid's longitudes.
fn width_deg(bounds: Bounds, grid: &Grid, col: u32) -> f64 {
    let (west, east) = (grid.col_west_deg(col), grid.col_west_deg(col + 1));
    let width: f64 = [-720.0, -360.0, 0.0, 360.0, 720.0]
        .map(|turn| (east.min(bounds.east + turn) - west.max(bounds.west + turn)).max(0.0))
        .iter()
        .sum();
    // A whole column is exactly the grid's step, whatever the rounding of its edges, so that regions that share whole
    // cells share their bits.
    if (width / grid.dlon_deg - 1.0).abs() < 1e-9 {
        grid.dlon_deg
    } else {
        width
    }
}
