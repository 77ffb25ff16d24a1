//! The generator of the synthetic China Sea product: a scale and a seed in, an HDF5 file out, the same bytes each time.
//!
//! It has the shape of the product in the paper this project continues (1800 x 2460 cells of 1/60 degree, 12 months of
//! 2009, or days of it), with a coast, clouds and seasons that look right on a globe. It is made up: every file says `synthetic = 1`.

mod writer;

use std::path::Path;

use china_sea::{Noise, coast, flux};

use crate::error::IngestError;

/// Cells at scale 1.
const ROWS: u32 = 2460;
const COLS: u32 = 1800;
/// Edges, degrees.
const NORTH_DEG: f64 = 41.0;
const WEST_DEG: f64 = 100.0;
const HEIGHT_DEG: f64 = 41.0;
const WIDTH_DEG: f64 = 30.0;
/// The year of the twelve months.
const YEAR: u16 = 2009;
/// Months of a year.
const MONTHS: usize = 12;
/// The last year that can be made up.
const LAST_YEAR: u16 = 2100;
/// What stands for no data in the file.
const FILL: f32 = -9999.0;
/// Share of the sea under cloud, averaged over the year.
const CLOUD_SHARE: f64 = 0.2;

/// The grid of a file.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Shape {
    rows: u32,
    cols: u32,
}

impl Shape {
    fn scaled(scale: f64) -> Option<Self> {
        let part = |n: u32| (f64::from(n) * scale).round() as u32;
        let shape = Self {
            rows: part(ROWS),
            cols: part(COLS),
        };
        (scale.is_finite() && scale <= 1.0 && shape.rows >= 8 && shape.cols >= 8).then_some(shape)
    }

    /// Latitude of the centre of a row, row 0 south as many files have it, degrees.
    fn lat_deg(self, row: u32) -> f64 {
        NORTH_DEG - HEIGHT_DEG + HEIGHT_DEG * (f64::from(row) + 0.5) / f64::from(self.rows)
    }

    /// Longitude of the centre of a column, degrees.
    fn lon_deg(self, col: u32) -> f64 {
        WEST_DEG + WIDTH_DEG * (f64::from(col) + 0.5) / f64::from(self.cols)
    }

    /// Centres of all cells in the order of the file: longitude, latitude.
    fn centers(self) -> impl Iterator<Item = (f64, f64)> {
        (0..self.rows).flat_map(move |row| {
            (0..self.cols).map(move |col| (self.lon_deg(col), self.lat_deg(row)))
        })
    }
}

/// Steps of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GeneratedSteps {
    /// The months of 2009.
    Months,
    /// So many days from the start of 2009, 1 to 365: the month's map, stronger and weaker over nine days.
    Days(u16),
    /// All days of a year from 2009 on, 2009 as above; eddies and clouds of other years are others.
    Year(u16),
}

impl GeneratedSteps {
    /// Days since the start of 2009 at which steps begin, and at which the last one ends.
    fn edges(self) -> Vec<f64> {
        match self {
            Self::Months => (0..=12).map(writer::first_day).collect(),
            Self::Days(count) => (0..=count).map(f64::from).collect(),
            Self::Year(year) => {
                let month = MONTHS * usize::from(year.saturating_sub(YEAR));
                let [start, end] = [month, month + MONTHS].map(|at| writer::first_day(at) as u32);
                (start..=end).map(f64::from).collect()
            }
        }
    }

    /// The month that a step lies in, counted from January 2009, and by how much its flux is multiplied.
    fn month_and_strength(self, step: usize) -> (usize, f32) {
        let (day, first_month) = match self {
            Self::Months => return (step, 1.0),
            Self::Days(_) => (step as f64, 0),
            Self::Year(year) => {
                let month = MONTHS * usize::from(year.saturating_sub(YEAR));
                (writer::first_day(month) + step as f64, month)
            }
        };
        let is_begun = |month: &usize| writer::first_day(first_month + *month) <= day;
        let month = (0..MONTHS).rev().find(is_begun).unwrap_or(0);
        let phase = day / 9.0 * std::f64::consts::TAU;
        (first_month + month, (1.0 + 0.25 * phase.sin()) as f32)
    }

    /// What a title says of the time that is covered.
    fn title(self) -> &'static str {
        match self {
            Self::Months | Self::Days(_) => " 2009",
            // Files of several years make one product.
            Self::Year(_) => "",
        }
    }
}

/// Writes the synthetic China Sea product. `scale` is 1 for 1800 x 2460 cells, 0.1 for 180 x 246; `progress` is told
/// steps done and steps in all.
pub fn generate_china_sea(
    path: &Path,
    scale: f64,
    seed: u64,
    steps: GeneratedSteps,
    progress: &dyn Fn(usize, usize),
) -> Result<(), IngestError> {
    let failed = |detail: String| IngestError::Generate {
        file: path.to_owned(),
        detail,
    };
    let shape = Shape::scaled(scale)
        .ok_or_else(|| failed(format!("scale {scale} is not above 0.005 and at most 1")))?;
    let noise = Noise::new(seed);
    let is_sea: Vec<bool> = shape
        .centers()
        .map(|(lon, lat)| !coast::is_land(lon, lat, noise))
        .collect();
    // A reader never sees half a file.
    let part = path.with_extension("part");
    match steps {
        GeneratedSteps::Days(count) if !(1..=365).contains(&count) => {
            return Err(failed(format!("{count} days are not 1 to 365")));
        }
        GeneratedSteps::Year(year) if !(YEAR..=LAST_YEAR).contains(&year) => {
            return Err(failed(format!("{year} is not {YEAR} to {LAST_YEAR}")));
        }
        _ => {}
    }
    let edges = steps.edges();
    let step_count = edges.len() - 1;
    let mut last: Option<(usize, Vec<f32>)> = None;
    let written = writer::write(&part, shape, (seed, steps.title()), &edges, |step| {
        progress(step, step_count);
        let (month, strength) = steps.month_and_strength(step);
        let map = match last.take() {
            Some((own, map)) if own == month => map,
            _ => month_values(shape, &is_sea, month, noise),
        };
        let stronger = |value: &f32| {
            if *value == FILL {
                FILL
            } else {
                value * strength
            }
        };
        let values = map.iter().map(stronger).collect();
        last = Some((month, map));
        values
    });
    written.map_err(|e| failed(e.to_string()))?;
    std::fs::rename(&part, path).map_err(|e| failed(e.to_string()))?;
    progress(step_count, step_count);
    Ok(())
}

/// Flux of one month (0 for January 2009), mmol m⁻² d⁻¹, positive out of the sea, `[row, col]` from the south; land and cloud filled.
fn month_values(shape: Shape, is_sea: &[bool], month: usize, noise: Noise) -> Vec<f32> {
    let cloud: Vec<f32> = shape
        .centers()
        .map(|(lon, lat)| flux::cloudiness(lon, lat, month, noise))
        .collect();
    let threshold = cloud_threshold(&cloud, is_sea, month);
    let value = |(index, (lon, lat)): (usize, (f64, f64))| {
        if is_sea[index] && cloud[index] < threshold {
            flux::flux_mmol_m2_d(lon, lat, month, noise) as f32
        } else {
            FILL
        }
    };
    shape.centers().enumerate().map(value).collect()
}

/// The cloudiness that the wanted share of the sea is above; cloudier in winter and at the onset of the monsoon.
fn cloud_threshold(cloud: &[f32], is_sea: &[bool], month: usize) -> f32 {
    let season = (2.0 * std::f64::consts::PI * (month as f64 - 0.5) / 6.0).cos();
    let share = CLOUD_SHARE * (1.0 + 0.3 * season);
    let mut sea: Vec<f32> = cloud
        .iter()
        .zip(is_sea)
        .filter(|(_, sea)| **sea)
        .map(|(c, _)| *c)
        .collect();
    if sea.is_empty() {
        return f32::INFINITY;
    }
    let index = (((1.0 - share) * sea.len() as f64) as usize).min(sea.len() - 1);
    *sea.select_nth_unstable_by(index, f32::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bytes(scale: f64, seed: u64) -> Vec<u8> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("china-sea.nc");
        let months = GeneratedSteps::Months;
        generate_china_sea(&path, scale, seed, months, &|_, _| {}).unwrap();
        std::fs::read(path).unwrap()
    }

    #[test]
    fn the_same_seed_gives_the_same_bytes_and_another_one_others() {
        let first = bytes(0.02, 1);
        std::thread::sleep(std::time::Duration::from_millis(1100)); // past a second, in case a time stamp were written
        assert!(first == bytes(0.02, 1));
        assert!(first != bytes(0.02, 2));
    }

    #[test]
    fn days_lie_in_their_months() {
        let days = GeneratedSteps::Days(365);
        assert_eq!(days.edges().len(), 366);
        for (day, month) in [(0, 0), (30, 0), (31, 1), (58, 1), (59, 2), (364, 11)] {
            assert_eq!(days.month_and_strength(day).0, month, "{day}");
        }
        assert_eq!(GeneratedSteps::Months.month_and_strength(7), (7, 1.0));
        assert_eq!(
            GeneratedSteps::Months.edges()[12].to_bits(),
            365.0f64.to_bits()
        );
        let leap = GeneratedSteps::Year(2012);
        let edges = leap.edges();
        assert_eq!((edges.len(), edges[0] as u32), (367, 3 * 365));
        for (day, month) in [(0, 36), (59, 37), (60, 38), (365, 47)] {
            assert_eq!(leap.month_and_strength(day).0, month, "{day}");
        }
        assert_eq!(GeneratedSteps::Year(2009).edges(), days.edges());
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("none.nc");
        let none = generate_china_sea(&path, 0.02, 1, GeneratedSteps::Days(0), &|_, _| {});
        assert!(none.unwrap_err().to_string().contains("0 days"));
        let before = generate_china_sea(&path, 0.02, 1, GeneratedSteps::Year(2008), &|_, _| {});
        assert!(before.unwrap_err().to_string().contains("2008"));
    }

    #[test]
    fn clouds_cover_about_a_fifth_of_the_sea() {
        let (shape, noise) = (Shape::scaled(0.05).unwrap(), Noise::new(1));
        let is_sea: Vec<bool> = shape
            .centers()
            .map(|(lon, lat)| !coast::is_land(lon, lat, noise))
            .collect();
        let sea = is_sea.iter().filter(|s| **s).count();
        let covered: f64 = (0..12)
            .map(|month| {
                let values = month_values(shape, &is_sea, month, noise);
                1.0 - values.iter().filter(|v| **v != FILL).count() as f64 / sea as f64
            })
            .sum();
        assert!(
            (covered / 12.0 - CLOUD_SHARE).abs() < 0.02,
            "{}",
            covered / 12.0
        );
    }

    #[test]
    fn absurd_scales_are_refused() {
        for scale in [0.0, -1.0, 1.5, f64::NAN, 1e-9] {
            assert!(Shape::scaled(scale).is_none(), "{scale}");
        }
    }
}
