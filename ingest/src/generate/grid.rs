//! The grid of a generated file: cells square in degrees or nearly so, row 0 south as many files have it.

use std::ops::Range;

/// The grid of a generated file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FileGrid {
    pub(super) rows: u32,
    pub(super) cols: u32,
    /// South-western corner and extent, degrees.
    pub(super) south_deg: f64,
    pub(super) west_deg: f64,
    pub(super) height_deg: f64,
    pub(super) width_deg: f64,
}

impl FileGrid {
    /// Latitude of the centre of a row, degrees.
    pub(super) fn lat_deg(self, row: u32) -> f64 {
        self.south_deg + self.height_deg * (f64::from(row) + 0.5) / f64::from(self.rows)
    }

    /// Longitude of the centre of a column, degrees.
    pub(super) fn lon_deg(self, col: u32) -> f64 {
        self.west_deg + self.width_deg * (f64::from(col) + 0.5) / f64::from(self.cols)
    }

    /// Centres of the cells of some rows in the order of the file: longitude, latitude.
    pub(super) fn centers(self, rows: Range<u32>) -> impl Iterator<Item = (f64, f64)> {
        rows.flat_map(move |row| {
            (0..self.cols).map(move |col| (self.lon_deg(col), self.lat_deg(row)))
        })
    }

    /// All rows.
    pub(super) fn all_rows(self) -> Range<u32> {
        0..self.rows
    }
}
