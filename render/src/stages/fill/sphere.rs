//! Distances between cells of a grid on the sphere: rows and columns in, squared chords out.

use contract::grid::Grid;

/// A grid's cell centres on the unit sphere. Rows and columns are fractional and may lie outside the grid, so that
/// coarser levels have a place too.
#[derive(Debug, Clone, Copy)]
#[expect(clippy::struct_field_names, reason = "units last in names")]
pub struct Sphere {
    north_rad: f64,
    row_rad: f64,
    col_rad: f64,
}

impl Sphere {
    /// The sphere of a grid.
    pub fn of(grid: &Grid) -> Self {
        Self {
            north_rad: (grid.north_deg - 0.5 * grid.dlat_deg).to_radians(),
            row_rad: grid.dlat_deg.to_radians(),
            col_rad: grid.dlon_deg.to_radians(),
        }
    }

    /// Latitude of a row's centre, radians.
    pub fn lat_rad(&self, row: f64) -> f64 {
        self.north_rad - row * self.row_rad
    }

    /// Height of a cell, radians.
    pub fn row_rad(&self) -> f64 {
        self.row_rad
    }

    /// Width of a cell along its parallel, radians of arc.
    pub fn width_rad(&self, row: f64) -> f64 {
        self.col_rad * self.lat_rad(row).cos().abs()
    }

    /// Squared chord between two cells `cols` columns apart, earth radii squared.
    ///
    /// The chord is the straight way through the earth, `2 sin(θ/2)` for an angle θ at its centre: it grows with the
    /// great-circle distance and is shorter than that by θ²/24, 0.05 % at 6 degrees. Haversine form, exact also for
    /// neighbours.
    pub fn chord_sq(&self, row_a: f64, row_b: f64, cols: f64) -> f64 {
        let cosines = self.lat_rad(row_a).cos() * self.lat_rad(row_b).cos();
        4.0 * (self.half_sine_sq_rows(row_a - row_b) + cosines * self.half_sine_sq_cols(cols))
    }

    /// sin² of half the angle between two rows so many rows apart.
    pub fn half_sine_sq_rows(&self, rows: f64) -> f64 {
        (0.5 * rows * self.row_rad).sin().powi(2)
    }

    /// sin² of half the angle between two meridians so many columns apart.
    pub fn half_sine_sq_cols(&self, cols: f64) -> f64 {
        (0.5 * cols * self.col_rad).sin().powi(2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: Grid = Grid {
        rows: 180,
        cols: 360,
        north_deg: 90.0,
        west_deg: -180.0,
        dlat_deg: 1.0,
        dlon_deg: 1.0,
    };

    #[test]
    fn chords_follow_from_great_circles_of_known_length() {
        let sphere = Sphere::of(&GRID);
        // From 0.5 N to 0.5 S, one degree; and between points on the equator a quarter of a turn apart: √2.
        let degree = sphere.chord_sq(89.0, 90.0, 0.0).sqrt();
        assert!((degree - 2.0 * 0.5f64.to_radians().sin()).abs() < 1e-15);
        assert!((sphere.chord_sq(89.5, 89.5, 90.0) - 2.0).abs() < 1e-12);
        // Round the earth and back to the same place; and over the pole from 89.5 N on either side, one degree.
        assert!(sphere.chord_sq(40.0, 40.0, 360.0) < 1e-20);
        assert!((sphere.chord_sq(0.0, 0.0, 180.0).sqrt() - degree).abs() < 1e-12);
    }

    #[test]
    fn a_parallel_is_narrower_than_the_equator() {
        let sphere = Sphere::of(&GRID);
        assert!((sphere.width_rad(29.5) / sphere.row_rad() - 0.5).abs() < 1e-12);
    }
}
