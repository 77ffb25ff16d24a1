//! Polygons on a grid: every edge is cut at the grid's lines and leaves its signed area in the cells it passes.
//!
//! A piece of an edge inside one cell covers the part of the cell east of it, and all of the row's cells further
//! east. Summed with the sign of its direction over all edges of all rings, what remains is the polygon's share of each
//! cell: no clipping case by case, and holes and islands need no care of their own.

use contract::chunk::{CHUNK_ROWS, Window};
use contract::earth::Earth;
use contract::grid::Grid;

use super::area::integral_m2;
use super::cut::TURNS_DEG;
use super::ring::Ring;
use crate::ComputeError;
use crate::awaited::Awaited;

/// Shares of a cell this close to none or all are none or all: rounding of sums over a row's edges.
const SNAP: f64 = 1e-12;
/// Shares of a cell beyond 0 and 1 by more than this cannot come from rings that count every place once.
const SLACK: f64 = 1e-6;
/// Edges between two looks whether anybody waits: some milliseconds.
const EDGES_A_LOOK: usize = 1 << 14;

/// Areas of the polygon's share of every cell of a band of rows, row-major over the whole width of the grid.
pub(super) struct Band {
    first_row: u32,
    cols: usize,
    areas_m2: Vec<f64>,
}

impl Band {
    /// The rows of a field's chunks that start at `first_row`.
    ///
    /// # Errors
    /// Rings that cover a cell more than once, and `NotAwaited`.
    pub(super) fn new(
        rings: &[Ring],
        grid: &Grid,
        first_row: u32,
        earth: Earth,
        awaited: &Awaited,
    ) -> Result<Self, ComputeError> {
        awaited.check()?;
        let rows = CHUNK_ROWS.min(grid.rows - first_row);
        let mut cover = Cover::new(grid, first_row, rows, earth);
        for ring in rings {
            let (west, east) = ring.lon_range_deg();
            for turn in TURNS_DEG {
                if west + turn < grid.east_deg() && east + turn > grid.west_deg {
                    for (number, edge) in ring.edges().enumerate() {
                        if number % EDGES_A_LOOK == 0 {
                            awaited.check()?;
                        }
                        cover.add_edge(edge.map(|[lon, lat]| [lon + turn, lat]));
                    }
                }
            }
        }
        Ok(Self {
            first_row,
            cols: grid.cols as usize,
            areas_m2: cover.finish()?,
        })
    }

    /// The cells of a window within the band.
    pub(super) fn window(&self, window: Window) -> Vec<f64> {
        let rows = window.row - self.first_row..window.row - self.first_row + window.rows;
        let mut areas_m2 = Vec::with_capacity(window.cell_count());
        for row in rows {
            let start = row as usize * self.cols + window.col as usize;
            areas_m2.extend_from_slice(&self.areas_m2[start..start + window.cols as usize]);
        }
        areas_m2
    }
}

/// Sums over edges, before they become areas.
struct Cover<'a> {
    grid: &'a Grid,
    first_row: u32,
    earth: Earth,
    /// Latitudes of the band's row edges, degrees, from north to south.
    lats_deg: Vec<f64>,
    /// Zone areas at those latitudes, m² per radian.
    zones: Vec<f64>,
    /// Area within a cell east of the edges in it, m², `[row, col]`.
    within: Vec<f64>,
    /// Zone height that edges in a cell bring to all cells east of it, m² per radian, `[row, col]`.
    east: Vec<f64>,
}

impl<'a> Cover<'a> {
    fn new(grid: &'a Grid, first_row: u32, rows: u32, earth: Earth) -> Self {
        let lats_deg: Vec<f64> = (first_row..=first_row + rows)
            .map(|row| grid.row_north_deg(row))
            .collect();
        let zones = lats_deg
            .iter()
            .map(|lat| earth.zone_area_m2_per_rad(lat.to_radians()))
            .collect();
        let cells = rows as usize * grid.cols as usize;
        Self {
            grid,
            first_row,
            earth,
            lats_deg,
            zones,
            within: vec![0.0; cells],
            east: vec![0.0; cells],
        }
    }

    /// Cuts an edge at the band's row lines.
    fn add_edge(&mut self, [from, to]: [[f64; 2]; 2]) {
        let (south, north) = (from[1].min(to[1]), from[1].max(to[1]));
        let rows = self.lats_deg.len() - 1;
        // An edge along a parallel has no height: it brings nothing to cells east of it.
        if south >= north || north <= self.lats_deg[rows] || south >= self.lats_deg[0] {
            return;
        }
        // Rows are found by the grid's rule, then widened by one against rounding; empty cuts fall away.
        let row_of =
            |lat: f64| (self.grid.north_deg - lat) / self.grid.dlat_deg - f64::from(self.first_row);
        let first = (row_of(north).floor() - 1.0).max(0.0) as usize;
        let last = (row_of(south).ceil() + 1.0).clamp(0.0, rows as f64) as usize;
        for row in first..last {
            let low = south.max(self.lats_deg[row + 1]);
            let high = north.min(self.lats_deg[row]);
            if low < high {
                let ends = if from[1] < to[1] {
                    [low, high]
                } else {
                    [high, low]
                };
                self.add_row_piece(row, ends.map(|lat| [lon_at(from, to, lat), lat]));
            }
        }
    }

    /// Cuts a piece within a row at the grid's column lines.
    fn add_row_piece(&mut self, row: usize, [from, to]: [[f64; 2]; 2]) {
        let (west, east) = (from[0].min(to[0]), from[0].max(to[0]));
        let col_of = |lon: f64| (lon - self.grid.west_deg) / self.grid.dlon_deg;
        let cols = f64::from(self.grid.cols);
        if col_of(west) >= cols {
            return;
        }
        let first = col_of(west).floor().clamp(-1.0, cols) as i64;
        let last = col_of(east).floor().clamp(-1.0, cols) as i64;
        let mut at = from;
        // From the piece's start to its end, line by line, eastwards or westwards.
        let lines: Vec<i64> = if from[0] <= to[0] {
            (first + 1..=last).collect()
        } else {
            (first + 1..=last).rev().collect()
        };
        for line in lines {
            let lon = self.grid.west_deg + line as f64 * self.grid.dlon_deg;
            let cut = [lon, lat_at(from, to, lon)];
            self.add_cell_piece(row, at, cut);
            at = cut;
        }
        self.add_cell_piece(row, at, to);
    }

    /// Adds a piece that lies within one cell, or west or east of the grid.
    fn add_cell_piece(&mut self, row: usize, from: [f64; 2], to: [f64; 2]) {
        let middle = 0.5 * (from[0] + to[0]);
        let col = ((middle - self.grid.west_deg) / self.grid.dlon_deg).floor();
        if col >= f64::from(self.grid.cols) {
            return;
        }
        let zone =
            |lat: f64| self.earth.zone_area_m2_per_rad(lat.to_radians()) - self.zones[row + 1];
        let (from_zone, to_zone) = (zone(from[1]), zone(to[1]));
        let start = row * self.grid.cols as usize;
        // A ring against the clock has its inside to the east where it runs south.
        let height = from_zone - to_zone;
        if col < 0.0 {
            // West of the grid: the whole row lies to the east, its first column too.
            self.within[start] += height * self.grid.dlon_deg.to_radians();
            self.east[start] += height;
            return;
        }
        let index = start + col as usize;
        let east_deg = self.grid.west_deg + (col + 1.0) * self.grid.dlon_deg;
        // The integral of (east - lon) over the zone function, by parts.
        let inner = (east_deg - to[0]).to_radians() * to_zone
            - (east_deg - from[0]).to_radians() * from_zone
            + integral_m2(self.earth, from, to, self.zones[row + 1]);
        self.within[index] -= inner;
        self.east[index] += height;
    }

    /// Sums along the rows, and checks that no cell is covered twice or less than not at all.
    fn finish(self) -> Result<Vec<f64>, ComputeError> {
        let mut areas = self.within;
        let cols = self.grid.cols as usize;
        for (row, cells) in areas.chunks_mut(cols).enumerate() {
            let whole = self
                .grid
                .cell_area_m2(self.first_row + row as u32, self.earth);
            let mut height = 0.0;
            for (cell, brought) in cells.iter_mut().zip(&self.east[row * cols..]) {
                *cell += height * self.grid.dlon_deg.to_radians();
                height += brought;
                *cell = checked(*cell, whole)?;
            }
        }
        Ok(areas)
    }
}

fn checked(area_m2: f64, whole_m2: f64) -> Result<f64, ComputeError> {
    let share = area_m2 / whole_m2;
    if !(-SLACK..=1.0 + SLACK).contains(&share) {
        let reason = format!("a cell would be covered {share} times");
        return Err(ComputeError::inconsistent("the region's rings", reason));
    }
    Ok(if share < SNAP {
        0.0
    } else if share > 1.0 - SNAP {
        whole_m2
    } else {
        area_m2
    })
}

fn lon_at(from: [f64; 2], to: [f64; 2], lat: f64) -> f64 {
    let lon = from[0] + (to[0] - from[0]) * (lat - from[1]) / (to[1] - from[1]);
    lon.clamp(from[0].min(to[0]), from[0].max(to[0]))
}

fn lat_at(from: [f64; 2], to: [f64; 2], lon: f64) -> f64 {
    let lat = from[1] + (to[1] - from[1]) * (lon - from[0]) / (to[0] - from[0]);
    lat.clamp(from[1].min(to[1]), from[1].max(to[1]))
}
