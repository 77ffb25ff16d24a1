//! One axis of a grid against the same axis of another: for every row (or column) of the target, those of the source that
//! it is made of, and with what weight.
//!
//! Both grids are regular in latitude and longitude, so that the weight of a cell is that of its row times that of its
//! column: the area of overlap as well as the factors of bilinear interpolation.

use contract::earth::Earth;
use contract::grid::Grid;

/// What one row or column of the target is made of.
#[derive(Debug, Clone, PartialEq)]
pub struct Parts {
    /// Index in the source and weight, in the order of the source.
    pub parts: Vec<(u32, f64)>,
    /// The weight of all of it, of which `parts` hold what lies on the source.
    pub whole: f64,
}

/// Cells that a position may be off an edge by rounding and lie on it.
const ON_EDGE: f64 = 1e-6;

/// The row or column of the source that a position lies in, counted in cells from its first edge; none outside. An edge is of the cell
/// south or east of it, whatever rounding makes of the position.
fn holding(position: f64, count: u32) -> Option<u32> {
    let edge = position.round();
    let is_on_edge = (position - edge).abs() < ON_EDGE;
    let position = if is_on_edge { edge } else { position };
    (position >= 0.0 && position < f64::from(count)).then_some(position as u32)
}

/// The column of the source that a position lies in, as [`centre_in_cells`] has it; none outside.
///
/// A place a hair west of the first edge of a grid round the earth is nearly a turn east of it, which rounding makes the last edge: it
/// is the first one.
fn holding_col(position: f64, source: &Grid) -> Option<u32> {
    let held = holding(position, source.cols);
    held.or_else(|| source.is_periodic().then_some(0))
}

/// Rows of the source that hold the centres of the target's.
pub fn nearest_rows(source: &Grid, target: &Grid) -> Vec<Parts> {
    let of_row = |row: u32| {
        let centre = target.cell_center(row, 0).lat;
        let position = (source.north_deg - centre) / source.dlat_deg;
        one(holding(position, source.rows))
    };
    (0..target.rows).map(of_row).collect()
}

/// The same of columns.
pub fn nearest_cols(source: &Grid, target: &Grid) -> Vec<Parts> {
    let of_col = |col: u32| {
        let position = centre_in_cells(source, target, col);
        one(holding_col(position, source))
    };
    (0..target.cols).map(of_col).collect()
}

fn one(index: Option<u32>) -> Parts {
    Parts {
        parts: index.map(|index| (index, 1.0)).into_iter().collect(),
        whole: 1.0,
    }
}

/// Centre of a column of the target in cells of the source from its western edge, 0 to a turn.
fn centre_in_cells(source: &Grid, target: &Grid, col: u32) -> f64 {
    let centre = target.col_west_deg(col) + 0.5 * target.dlon_deg;
    (centre - source.west_deg).rem_euclid(360.0) / source.dlon_deg
}

/// Rows between whose centres those of the target lie; beyond the outermost centre that row alone.
pub fn bilinear_rows(source: &Grid, target: &Grid) -> Vec<Parts> {
    let of_row = |row: u32| {
        let centre = target.cell_center(row, 0).lat;
        let position = (source.north_deg - centre) / source.dlat_deg;
        match holding(position, source.rows) {
            None => one(None),
            Some(_) => between(position - 0.5, source.rows, false),
        }
    };
    (0..target.rows).map(of_row).collect()
}

/// The same of columns; round the earth where the source goes all the way round.
pub fn bilinear_cols(source: &Grid, target: &Grid) -> Vec<Parts> {
    let of_col = |col: u32| {
        let position = centre_in_cells(source, target, col);
        match holding_col(position, source) {
            None => one(None),
            Some(_) => between(position - 0.5, source.cols, source.is_periodic()),
        }
    };
    (0..target.cols).map(of_col).collect()
}

/// Two neighbours of a position between centres.
fn between(position: f64, count: u32, is_periodic: bool) -> Parts {
    let low = position.floor();
    let share = position - low;
    let index = |at: f64| {
        if is_periodic {
            at.rem_euclid(f64::from(count)) as u32
        } else {
            at.clamp(0.0, f64::from(count) - 1.0) as u32
        }
    };
    let (first, second) = (index(low), index(low + 1.0));
    let parts = if first == second {
        vec![(first, 1.0)]
    } else {
        let pair = [(first, 1.0 - share), (second, share)];
        let mut parts: Vec<_> = pair
            .into_iter()
            .filter(|(_, weight)| *weight > 0.0)
            .collect();
        parts.sort_by_key(|(index, _)| *index);
        parts
    };
    Parts { parts, whole: 1.0 }
}

/// Rows that overlap those of the target: area of the band that both have, m² a radian of longitude, on WGS84.
pub fn overlapping_rows(source: &Grid, target: &Grid) -> Vec<Parts> {
    let earth = Earth::Wgs84;
    let zone = |deg: f64| earth.zone_area_m2_per_rad(deg.to_radians());
    let of_row = |row: u32| {
        let (north, south) = (target.row_north_deg(row), target.row_north_deg(row + 1));
        let first = ((source.north_deg - north) / source.dlat_deg).floor() - 1.0;
        let last = ((source.north_deg - south) / source.dlat_deg).ceil() + 1.0;
        let (first, last) = (first.max(0.0) as u32, last.min(f64::from(source.rows)));
        let overlap = |index: u32| {
            let top = north.min(source.row_north_deg(index));
            let bottom = south.max(source.row_north_deg(index + 1));
            (top > bottom).then(|| (index, zone(top) - zone(bottom)))
        };
        Parts {
            parts: (first..last.max(0.0) as u32).filter_map(overlap).collect(),
            whole: zone(north) - zone(south),
        }
    };
    (0..target.rows).map(of_row).collect()
}

/// Columns that overlap those of the target, radians of longitude.
pub fn overlapping_cols(source: &Grid, target: &Grid) -> Vec<Parts> {
    let of_col = |col: u32| {
        let start = (target.col_west_deg(col) - source.west_deg).rem_euclid(360.0);
        let mut parts: Vec<(u32, f64)> = vec![];
        // Once round the earth, so that a column across the source's western edge finds both its parts.
        for west in [start - 360.0, start] {
            parts.extend(overlaps_deg(source, west, west + target.dlon_deg));
        }
        parts.sort_by_key(|(index, _)| *index);
        let radians = |(index, deg): (u32, f64)| (index, deg.to_radians());
        Parts {
            parts: parts.into_iter().map(radians).collect(),
            whole: target.dlon_deg.to_radians(),
        }
    };
    (0..target.cols).map(of_col).collect()
}

/// Columns that overlap a range of degrees from the source's western edge, and by how many degrees.
fn overlaps_deg(source: &Grid, west: f64, east: f64) -> impl Iterator<Item = (u32, f64)> {
    let width = source.dlon_deg;
    let first = ((west / width).floor() - 1.0).max(0.0) as u32;
    let last = ((east / width).ceil() + 1.0).clamp(0.0, f64::from(source.cols)) as u32;
    (first..last).filter_map(move |index| {
        let (own_west, own_east) = (f64::from(index) * width, f64::from(index + 1) * width);
        let overlap = east.min(own_east) - west.max(own_west);
        (overlap > 0.0).then_some((index, overlap))
    })
}
