//! The China Sea: a scale and a seed in, maps out, with a coast, clouds and seasons that look right on a globe.
//!
//! It has the shape of the product in the paper this project continues: 1800 x 2460 cells of 1/60 degree.

use std::ops::Range;

use synthetic::Noise;
use synthetic::china_sea::{coast, flux};

use super::clouds;
use super::grid::FileGrid;
use super::product::{FILL, MadeUp, Texts};

/// Cells at scale 1.
const ROWS: u32 = 2460;
const COLS: u32 = 1800;
/// Edges, degrees.
const SOUTH_DEG: f64 = 0.0;
const WEST_DEG: f64 = 100.0;
const HEIGHT_DEG: f64 = 41.0;
const WIDTH_DEG: f64 = 30.0;

/// The made-up China Sea.
pub(super) struct ChinaSea {
    grid: FileGrid,
    seed: u64,
    noise: Noise,
    is_sea: Vec<bool>,
}

impl ChinaSea {
    /// A part of the full size along each side; none if it is not above 0.005 and at most 1.
    pub(super) fn new(scale: f64, seed: u64) -> Option<Self> {
        let part = |n: u32| (f64::from(n) * scale).round() as u32;
        let grid = FileGrid {
            rows: part(ROWS),
            cols: part(COLS),
            south_deg: SOUTH_DEG,
            west_deg: WEST_DEG,
            height_deg: HEIGHT_DEG,
            width_deg: WIDTH_DEG,
        };
        if !(scale.is_finite() && scale <= 1.0 && grid.rows >= 8 && grid.cols >= 8) {
            return None;
        }
        let noise = Noise::new(seed);
        let is_sea = grid
            .centers(grid.all_rows())
            .map(|(lon, lat)| !coast::is_land(lon, lat, noise))
            .collect();
        Some(Self {
            grid,
            seed,
            noise,
            is_sea,
        })
    }
}

impl MadeUp for ChinaSea {
    fn grid(&self) -> FileGrid {
        self.grid
    }

    fn texts(&self) -> Texts {
        Texts {
            sea: "China Sea",
            command: "china-sea",
            seed: self.seed,
        }
    }

    fn month_values(&self, month: usize, rows: Range<u32>) -> Vec<f32> {
        let cloud: Vec<f32> = self
            .grid
            .centers(self.grid.all_rows())
            .map(|(lon, lat)| flux::cloudiness(lon, lat, month, self.noise))
            .collect();
        let of_sea = cloud.iter().zip(&self.is_sea).filter(|(_, sea)| **sea);
        let threshold = clouds::threshold(of_sea.map(|(cloud, _)| *cloud).collect(), month);
        let first = rows.start as usize * self.grid.cols as usize;
        let value = |(index, (lon, lat)): (usize, (f64, f64))| {
            if self.is_sea[index] && cloud[index] < threshold {
                flux::flux_mmol_m2_d(lon, lat, month, self.noise) as f32
            } else {
                FILL
            }
        };
        let indexed = (first..).zip(self.grid.centers(rows));
        indexed.map(value).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clouds_cover_about_a_fifth_of_the_sea() {
        let china_sea = ChinaSea::new(0.05, 1).unwrap();
        let sea = china_sea.is_sea.iter().filter(|s| **s).count();
        let covered: f64 = (0..12)
            .map(|month| {
                let values = china_sea.month_values(month, china_sea.grid.all_rows());
                1.0 - values.iter().filter(|v| **v != FILL).count() as f64 / sea as f64
            })
            .sum();
        assert!(
            (covered / 12.0 - clouds::CLOUD_SHARE).abs() < 0.02,
            "{}",
            covered / 12.0
        );
    }

    #[test]
    fn absurd_scales_are_refused() {
        for scale in [0.0, -1.0, 1.5, f64::NAN, 1e-9] {
            assert!(ChinaSea::new(scale, 1).is_none(), "{scale}");
        }
    }
}
