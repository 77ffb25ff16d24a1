//! The one grid every stored product uses: regular latitude-longitude, row 0 north, columns eastwards.

use serde::{Deserialize, Serialize};

use crate::ContractError;
use crate::earth::Earth;

/// Most cells a stored grid may have: 2^31, three times a global grid of 1/100 degree. A cell's number fits 32 bits, and a map of
/// float32 8 GiB.
pub const MAX_CELLS: u64 = 1 << 31;

/// A place: longitude in [-180, 180), latitude in [-90, 90], degrees.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LonLatDeg {
    /// Longitude, degrees east.
    pub lon: f64,
    /// Latitude, degrees north.
    pub lat: f64,
}

impl LonLatDeg {
    /// A place with its longitude wrapped into [-180, 180).
    ///
    /// # Errors
    /// Not finite, a latitude beyond the poles, or a longitude beyond two turns.
    pub fn new(lon: f64, lat: f64) -> Result<Self, ContractError> {
        if !lon.is_finite() || !lat.is_finite() || lat.abs() > 90.0 || lon.abs() > 720.0 {
            let text = format!("{lon},{lat}");
            return Err(ContractError::invalid(
                "place",
                &text,
                "degrees, the longitude first and then the latitude, which is -90 to 90",
            ));
        }
        Ok(Self {
            lon: wrap_lon_deg(lon),
            lat,
        })
    }
}

impl std::str::FromStr for LonLatDeg {
    type Err = ContractError;

    /// `LON,LAT`.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let numbers = text
            .split_once(',')
            .and_then(|(lon, lat)| Some((lon.trim().parse().ok()?, lat.trim().parse().ok()?)));
        let Some((lon, lat)) = numbers else {
            let valid = "LON,LAT: degrees east and north, such as -95,0";
            return Err(ContractError::invalid("place", text, valid));
        };
        Self::new(lon, lat)
    }
}

/// Longitude wrapped into [-180, 180).
pub fn wrap_lon_deg(lon: f64) -> f64 {
    if (-180.0..180.0).contains(&lon) {
        lon // as it is: adding and taking away 180 would round it
    } else {
        (lon + 180.0).rem_euclid(360.0) - 180.0
    }
}

/// Degrees without the noise that arithmetic adds to them: nine decimals, 0.1 mm.
pub fn rounded_deg(deg: f64) -> f64 {
    (deg * 1e9).round() / 1e9
}

/// A regular latitude-longitude grid of cells. Values are row-major `[row, col]`, NaN where there is no data.
///
/// `north_deg` and `west_deg` are *edges* of the first row and column, never centres. Grids that cross the date
/// line go on eastwards past 180.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Grid {
    /// Number of rows, north to south.
    pub rows: u32,
    /// Number of columns, west to east.
    pub cols: u32,
    /// Northern edge of row 0, degrees.
    pub north_deg: f64,
    /// Western edge of column 0, degrees, in [-180, 180).
    pub west_deg: f64,
    /// Height of a cell, degrees, positive.
    pub dlat_deg: f64,
    /// Width of a cell, degrees, positive.
    pub dlon_deg: f64,
}

/// Slack for edges computed from rounded coordinates, in cells.
const EDGE_SLACK_CELLS: f64 = 1e-3;
/// A place closer to an edge than this is on it, degrees: edges are told with nine decimals.
const ON_EDGE_DEG: f64 = 1e-9;

impl Grid {
    /// Checks the invariants of a grid that came from outside.
    ///
    /// # Errors
    /// Empty or too large (more than [`MAX_CELLS`]), not finite, past the poles, or wider than a full turn.
    pub fn validate(&self) -> Result<(), ContractError> {
        let bad = |reason: &str| Err(ContractError::invalid("grid", &self.text(), reason));
        let numbers = [self.north_deg, self.west_deg, self.dlat_deg, self.dlon_deg];
        if self.rows == 0
            || self.cols == 0
            || u64::from(self.rows) * u64::from(self.cols) > MAX_CELLS
        {
            return bad("it has no cells or more than 2147483648");
        }
        if numbers.iter().any(|v| !v.is_finite()) || self.dlat_deg <= 0.0 || self.dlon_deg <= 0.0 {
            return bad("steps must be positive and finite");
        }
        let slack = EDGE_SLACK_CELLS * self.dlat_deg;
        if self.north_deg > 90.0 + slack || self.south_deg() < -90.0 - slack {
            return bad("it reaches past a pole");
        }
        if f64::from(self.cols) * self.dlon_deg > 360.0 + EDGE_SLACK_CELLS * self.dlon_deg {
            return bad("it is wider than 360 degrees");
        }
        if !(-180.0..180.0).contains(&self.west_deg) {
            return bad("its western edge must lie in [-180, 180)");
        }
        Ok(())
    }

    /// What it is, for people; no more than it says, since it may be none.
    fn text(&self) -> String {
        let [height, width] = [self.dlat_deg, self.dlon_deg].map(rounded_deg);
        let [north, west] = [self.north_deg, self.west_deg].map(rounded_deg);
        format!(
            "{} x {} cells of {height} x {width} degrees from {north} N {west} E",
            self.rows, self.cols
        )
    }

    /// Number of cells.
    pub fn cell_count(&self) -> usize {
        self.rows as usize * self.cols as usize
    }

    /// Southern edge of the last row, degrees.
    pub fn south_deg(&self) -> f64 {
        self.north_deg - f64::from(self.rows) * self.dlat_deg
    }

    /// Eastern edge of the last column, degrees; past 180 where the grid crosses the date line.
    pub fn east_deg(&self) -> f64 {
        self.west_deg + f64::from(self.cols) * self.dlon_deg
    }

    /// Does the grid go all the way round?
    pub fn is_periodic(&self) -> bool {
        (f64::from(self.cols) * self.dlon_deg - 360.0).abs() < EDGE_SLACK_CELLS * self.dlon_deg
    }

    /// Northern edge of `row`, degrees, never past a pole.
    pub fn row_north_deg(&self, row: u32) -> f64 {
        (self.north_deg - f64::from(row) * self.dlat_deg).clamp(-90.0, 90.0)
    }

    /// Western edge of `col`, degrees, not wrapped.
    pub fn col_west_deg(&self, col: u32) -> f64 {
        self.west_deg + f64::from(col) * self.dlon_deg
    }

    /// Centre of a cell, longitude wrapped.
    pub fn cell_center(&self, row: u32, col: u32) -> LonLatDeg {
        LonLatDeg {
            lon: wrap_lon_deg(self.col_west_deg(col) + 0.5 * self.dlon_deg),
            lat: 0.5 * (self.row_north_deg(row) + self.row_north_deg(row + 1)),
        }
    }

    /// The cell that holds a place: `(row, col)`; none outside the grid. Northern and western edges belong to a cell, and the
    /// southern and the eastern edge of the grid, beyond which there is no cell, to its last ones.
    pub fn cell_at(&self, place: LonLatDeg) -> Option<(u32, u32)> {
        let (rows, cols) = (f64::from(self.rows), f64::from(self.cols));
        let row = (self.north_deg - place.lat) / self.dlat_deg;
        // A grid that reaches a pole but for its rounding has it.
        let slack_cells = if place.lat.abs() >= 90.0 {
            EDGE_SLACK_CELLS
        } else {
            ON_EDGE_DEG / self.dlat_deg
        };
        if !(-slack_cells..=rows + slack_cells).contains(&row) {
            return None;
        }
        let col = self.east_of_edge_deg(place.lon) / self.dlon_deg;
        let col = if col >= cols && self.is_periodic() {
            0.0 // round the earth the last edge is the first
        } else if col <= cols + ON_EDGE_DEG / self.dlon_deg {
            col
        } else {
            return None;
        };
        let (row, col) = (row.clamp(0.0, rows - 1.0), col.min(cols - 1.0));
        Some((row as u32, col as u32))
    }

    /// How far east of the western edge a longitude is, degrees, from 0 to 360; 0 also a hair west of it, where rounding puts what
    /// is on it.
    pub fn east_of_edge_deg(&self, lon_deg: f64) -> f64 {
        let east_deg = (lon_deg - self.west_deg).rem_euclid(360.0);
        if east_deg > 360.0 - ON_EDGE_DEG {
            0.0
        } else {
            east_deg
        }
    }

    /// Area of one cell of `row`, m².
    pub fn cell_area_m2(&self, row: u32, earth: Earth) -> f64 {
        earth.cell_area_m2(
            self.row_north_deg(row + 1),
            self.row_north_deg(row),
            self.dlon_deg,
        )
    }

    /// Bounds as west, south, east, north in degrees.
    pub fn bounds_deg(&self) -> [f64; 4] {
        [
            self.west_deg,
            self.south_deg(),
            self.east_deg(),
            self.north_deg,
        ]
    }

    /// The same without the noise of its steps' sum; east may pass 180.
    pub fn shown_bounds_deg(&self) -> [f64; 4] {
        let [west, south, east, north] = self.bounds_deg().map(rounded_deg);
        [west, south.max(-90.0), east, north.min(90.0)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    pub(crate) const ONE_DEGREE: Grid = Grid {
        rows: 180,
        cols: 360,
        north_deg: 90.0,
        west_deg: -180.0,
        dlat_deg: 1.0,
        dlon_deg: 1.0,
    };

    #[test]
    fn cell_areas_sum_to_the_earth() {
        for earth in [Earth::Wgs84, Earth::Sphere] {
            let sum: f64 = (0..180)
                .map(|r| 360.0 * ONE_DEGREE.cell_area_m2(r, earth))
                .sum();
            assert!((sum / earth.cell_area_m2(-90.0, 90.0, 360.0) - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn of_a_place_the_wrong_way_round_it_is_said_which_comes_first() {
        let refused = LonLatDeg::new(0.0, -150.0).unwrap_err().to_string();
        assert!(refused.contains("longitude first"), "{refused}");
    }

    #[test]
    fn poles_and_date_line_have_a_cell() {
        let at = |lon, lat| ONE_DEGREE.cell_at(LonLatDeg::new(lon, lat).unwrap());
        assert_eq!(at(0.0, 90.0), Some((0, 180)));
        assert_eq!(at(0.0, -90.0), Some((179, 180)));
        assert_eq!(at(180.0, 0.5), Some((89, 0)));
        assert_eq!(at(-180.0, 0.5), Some((89, 0)));
        assert_eq!(at(179.999, 0.5), Some((89, 359)));
    }

    #[test]
    fn a_place_a_rounding_west_of_the_first_edge_of_a_globe_has_a_cell() {
        let quarter = Grid {
            rows: 720,
            cols: 1440,
            west_deg: -0.125,
            dlat_deg: 0.25,
            dlon_deg: 0.25,
            ..ONE_DEGREE
        };
        let lon = -0.125 - f64::EPSILON;
        assert_eq!(quarter.cell_at(LonLatDeg { lon, lat: 0.1 }), Some((359, 0)));
        let half = Grid {
            cols: 720,
            ..quarter
        };
        assert_eq!(half.cell_at(LonLatDeg { lon, lat: 0.1 }), Some((359, 0)));
        let lon = -0.126;
        assert_eq!(half.cell_at(LonLatDeg { lon, lat: 0.1 }), None);
    }

    #[test]
    fn all_edges_of_a_part_of_the_globe_are_inside_and_nothing_beyond_them() {
        // In double precision its edges are some hairs off the tenths of a degree that are told of them.
        let grid = Grid {
            rows: 33,
            cols: 57,
            north_deg: 40.1,
            west_deg: 120.3,
            dlat_deg: 0.1,
            dlon_deg: 0.1,
        };
        let [west, south, east, north] = grid.shown_bounds_deg();
        let told = [west, south, east, north].map(|deg| deg.to_string());
        assert_eq!(told, ["120.3", "36.8", "126", "40.1"]);
        let at = |lon, lat| grid.cell_at(LonLatDeg { lon, lat });
        assert_eq!(at(west, north), Some((0, 0)));
        assert_eq!(at(east, south), Some((32, 56)));
        assert_eq!(at(west, south), Some((32, 0)));
        assert_eq!(at(east, north), Some((0, 56)));
        // An edge within it belongs to the cell south or east of it.
        assert_eq!(at(122.299_999_9, 38.100_000_1), Some((19, 19)));
        assert_eq!(at(122.300_000_1, 38.099_999_9), Some((20, 20)));
        for (lon, lat) in [
            (west - 1e-6, 38.0),
            (east + 1e-6, 38.0),
            (123.0, south - 1e-6),
            (123.0, north + 1e-6),
        ] {
            assert_eq!(at(lon, lat), None, "{lon} {lat}");
        }
    }

    #[test]
    fn a_pole_is_in_grids_that_reach_it_alone() {
        let at = |grid: Grid, lat| grid.cell_at(LonLatDeg { lon: 0.5, lat });
        let tropics = Grid {
            rows: 10,
            north_deg: 5.0,
            ..ONE_DEGREE
        };
        assert_eq!([-90.0, 90.0].map(|lat| at(tropics, lat)), [None, None]);
        // Labels of single precision may end a little before it.
        let rounded = Grid {
            north_deg: 90.0 - 1e-5,
            dlat_deg: 1.0 - 1e-7,
            ..ONE_DEGREE
        };
        let found = [-90.0, 90.0].map(|lat| at(rounded, lat).map(|(row, _)| row));
        assert_eq!(found, [Some(179), Some(0)]);
    }

    #[test]
    fn a_grid_across_the_date_line_finds_both_sides() {
        let grid = Grid {
            rows: 10,
            cols: 20,
            north_deg: 5.0,
            west_deg: 170.0,
            dlat_deg: 1.0,
            dlon_deg: 1.0,
        };
        assert_eq!(
            grid.cell_at(LonLatDeg {
                lon: -179.5,
                lat: 4.5
            }),
            Some((0, 10))
        );
        assert_eq!(
            grid.cell_at(LonLatDeg {
                lon: 169.5,
                lat: 4.5
            }),
            None
        );
    }

    #[test]
    fn hostile_grids_are_refused() {
        let huge = Grid {
            rows: u32::MAX,
            cols: u32::MAX,
            ..ONE_DEGREE
        };
        let past_pole = Grid {
            north_deg: 90.5,
            ..ONE_DEGREE
        };
        let not_a_number = Grid {
            dlat_deg: f64::NAN,
            ..ONE_DEGREE
        };
        assert!(
            [huge, past_pole, not_a_number]
                .iter()
                .all(|g| g.validate().is_err())
        );
        assert!(ONE_DEGREE.validate().is_ok());
        let told = past_pole.validate().unwrap_err().to_string();
        let words = "180 x 360 cells of 1 x 1 degrees from 90.5 N -180 E";
        assert!(told.contains(words), "{told}");
    }

    proptest! {
        #[test]
        fn a_cell_holds_its_centre(row in 0u32..180, col in 0u32..360) {
            prop_assert_eq!(ONE_DEGREE.cell_at(ONE_DEGREE.cell_center(row, col)), Some((row, col)));
        }
    }
}
