//! The whole sea: the size of a cell and a seed in, maps out, between the coasts of Natural Earth.

use std::f64::consts::PI;
use std::ops::Range;

use rayon::prelude::*;
use synthetic::{Noise, globe};

use super::clouds;
use super::grid::FileGrid;
use super::land::LandRows;
use super::product::{FILL, MadeUp, Texts};

/// Sides of cells, degrees: fewer than 5 show nothing, finer than 1/100 no sensor does.
const DEGREES: [f64; 2] = [0.01, 5.0];
/// Places at which a month's clouds are looked at to find out what a share of them is above.
const SAMPLES: u32 = 20_000;

/// The made-up sea.
pub(super) struct Globe {
    grid: FileGrid,
    seed: u64,
    noise: Noise,
    land: LandRows,
}

impl Globe {
    /// Cells of so many degrees; an error says why there can be none.
    pub(super) fn new(degrees: f64, seed: u64) -> Result<Self, String> {
        let [least, most] = DEGREES;
        let rows = 180.0 / degrees;
        if !(least..=most).contains(&degrees) {
            return Err(format!(
                "cells of {degrees} degrees: give {least} to {most}"
            ));
        }
        if (rows - rows.round()).abs() > 1e-6 * rows {
            return Err(format!(
                "cells of {degrees} degrees do not fill the 180 from pole to pole: give 0.25 or 1/12, for example"
            ));
        }
        let rows = rows.round() as u32;
        let grid = FileGrid {
            rows,
            cols: 2 * rows,
            south_deg: -90.0,
            west_deg: -180.0,
            height_deg: 180.0,
            width_deg: 360.0,
        };
        Ok(Self {
            grid,
            seed,
            noise: Noise::new(seed),
            land: LandRows::new(grid),
        })
    }

    /// Cloudinesses of places spread evenly over the sphere (a Fibonacci lattice), which stand for those of the sea.
    fn samples(&self, month: usize) -> Vec<f32> {
        let golden_deg = 180.0 * (3.0 - 5.0f64.sqrt());
        let sample = |index: u32| {
            let height = 1.0 - 2.0 * (f64::from(index) + 0.5) / f64::from(SAMPLES);
            let lon = (f64::from(index) * golden_deg) % 360.0 - 180.0;
            globe::cloudiness(lon, height.asin() * 180.0 / PI, month, self.noise)
        };
        (0..SAMPLES).map(sample).collect()
    }

    fn row_values(&self, month: usize, row: u32, threshold: f32) -> Vec<f32> {
        let mut is_land = vec![false; self.grid.cols as usize];
        self.land.mark(row, &mut is_land);
        let value = |((lon, lat), is_land): ((f64, f64), bool)| {
            if is_land || globe::cloudiness(lon, lat, month, self.noise) >= threshold {
                FILL
            } else {
                globe::flux_mmol_m2_d(lon, lat, month, self.noise) as f32
            }
        };
        let centers = self.grid.centers(row..row + 1);
        centers.zip(is_land).map(value).collect()
    }
}

impl MadeUp for Globe {
    fn grid(&self) -> FileGrid {
        self.grid
    }

    fn texts(&self) -> Texts {
        Texts {
            sea: "global",
            command: "globe",
            seed: self.seed,
        }
    }

    fn month_values(&self, month: usize, rows: Range<u32>) -> Vec<f32> {
        let threshold = clouds::threshold(self.samples(month), month);
        rows.into_par_iter()
            .flat_map_iter(|row| self.row_values(month, row, threshold))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_fill_the_globe_or_are_refused() {
        for (degrees, rows) in [(5.0, 36), (0.25, 720), (1.0 / 12.0, 2160), (0.01, 18_000)] {
            let grid = Globe::new(degrees, 1).unwrap().grid;
            assert_eq!((grid.rows, grid.cols), (rows, 2 * rows), "{degrees}");
        }
        for degrees in [0.0, -1.0, 0.009, 5.1, 7.0, 0.7, f64::NAN, f64::INFINITY] {
            assert!(Globe::new(degrees, 1).is_err(), "{degrees}");
        }
    }

    #[test]
    fn land_and_a_fifth_of_the_sea_have_no_values() {
        let made_up = Globe::new(1.0, 1).unwrap();
        let (mut sea, mut clear) = (0.0, 0.0);
        for month in [0, 3, 6, 9] {
            for row in 0..made_up.grid.rows {
                let mut is_land = vec![false; made_up.grid.cols as usize];
                made_up.land.mark(row, &mut is_land);
                let weight = made_up.grid.lat_deg(row).to_radians().cos();
                let values = made_up.month_values(month, row..row + 1);
                for (value, is_land) in values.iter().zip(is_land) {
                    assert!(!is_land || *value == FILL);
                    sea += if is_land { 0.0 } else { weight };
                    clear += if *value == FILL { 0.0 } else { weight };
                }
            }
        }
        let share = clear / sea;
        assert!((share - 0.8).abs() < 0.05, "{share}");
    }

    #[test]
    fn bands_of_rows_are_parts_of_the_whole() {
        let made_up = Globe::new(5.0, 3).unwrap();
        let whole = made_up.month_values(2, 0..36);
        let parts = [0..7, 7..20, 20..36].map(|rows| made_up.month_values(2, rows));
        assert_eq!(whole, parts.concat());
    }
}
