//! Made-up scenes of any size: the seas off eastern Asia, 0 to 41 N and 100 to 130 E, on as many cells as are wanted,
//! with one particle a cell of sea.

use std::sync::Arc;
use std::thread;

use anyhow::Result;
use contract::camera::CameraAngles;
use contract::colour::TransferFunction;
use contract::grid::Grid;
use contract::job::{Mode, RENDERER_VERSION, RenderJob, Style, View};
use contract::quantity::Quantity;
use contract::time_sample::TimeSample;
use render::{Frame, Interval, Scene};

/// Share of the region that is sea in these scenes.
const SEA_SHARE: f64 = 0.605;
const NORTH_DEG: f64 = 41.0;
const WEST_DEG: f64 = 100.0;
const WIDTH_DEG: f64 = 30.0;
/// Kilograms of carbon per square metre and second in a gram a year.
const GRAM_A_YEAR: f64 = 1e-3 / (365.25 * 86_400.0);
const YEAR_S: f64 = 365.25 * 86_400.0;
/// The camera sees the whole region in a picture that is wider than high.
const CAMERA_HEIGHT_M: f64 = 5.3e6;

/// A grid of the region with at least so many cells of sea, square in degrees.
pub fn grid(particles: u64) -> Grid {
    let cells = particles as f64 / SEA_SHARE * 1.02;
    let cols = (cells * WIDTH_DEG / NORTH_DEG).sqrt().ceil();
    let rows = (cells / cols).ceil();
    Grid {
        rows: rows as u32,
        cols: cols as u32,
        north_deg: NORTH_DEG,
        west_deg: WEST_DEG,
        dlat_deg: NORTH_DEG / rows,
        dlon_deg: WIDTH_DEG / cols,
    }
}

/// Land in the north-west, as on the coast of a continent, and two islands.
fn is_land(lon: f64, lat: f64) -> bool {
    let coast =
        105.5 + 6.0 * ((lat - 5.0) / 36.0) + 3.0 * (lat * 0.35).sin() + 0.7 * (lat * 2.9).sin();
    let island = |x: f64, y: f64, rx: f64, ry: f64| {
        ((lon - x) / rx).powi(2) + ((lat - y) / ry).powi(2) < 1.0
    };
    lon < coast + 1.5 || island(114.0, 2.0, 5.0, 4.0) || island(121.5, 14.0, 2.0, 5.5)
}

fn frame(grid: &Grid, value: impl Fn(f64, f64) -> f64 + Sync) -> Arc<Frame> {
    everywhere(grid, |lon, lat| {
        if is_land(lon, lat) {
            f64::NAN
        } else {
            value(lon, lat)
        }
    })
}

fn everywhere(grid: &Grid, value: impl Fn(f64, f64) -> f64 + Sync) -> Arc<Frame> {
    let mut values = vec![f32::NAN; grid.cell_count()];
    let cores = thread::available_parallelism().map_or(1, usize::from);
    let rows_each = (grid.rows as usize).div_ceil(cores);
    let cols = grid.cols as usize;
    thread::scope(|scope| {
        for (part, rows) in values.chunks_mut(rows_each * cols).enumerate() {
            let value = &value;
            scope.spawn(move || {
                for (down, row) in rows.chunks_mut(cols).enumerate() {
                    let lat =
                        grid.north_deg - grid.dlat_deg * ((part * rows_each + down) as f64 + 0.5);
                    for (col, cell) in row.iter_mut().enumerate() {
                        let lon = grid.west_deg + grid.dlon_deg * (col as f64 + 0.5);
                        *cell = value(lon, lat) as f32;
                    }
                }
            });
        }
    });
    Arc::new(Frame::new(values))
}

/// Sinks in the north, sources near the equator, eddies of two degrees on top; `phase` is the season, radians.
fn flux(lon: f64, lat: f64, phase: f64) -> f64 {
    let belt = 35.0 - 2.4 * lat + 22.0 * (phase + lat * 0.05).cos();
    let eddies = 14.0 * (lon * 3.1 + phase).sin() * (lat * 2.7 - 0.4 * phase).cos();
    (belt + eddies) * GRAM_A_YEAR
}

/// Two adjacent months and what has accumulated until each.
pub fn scene(grid: &Grid) -> Scene {
    let month = std::f64::consts::TAU / 12.0;
    let value = Interval {
        before: frame(grid, |lon, lat| flux(lon, lat, 0.0)),
        after: frame(grid, |lon, lat| flux(lon, lat, month)),
        weight: 0.3,
    };
    let carbon =
        |share: f64| move |lon: f64, lat: f64| flux(lon, lat, 0.5 * month) * share * YEAR_S;
    let accumulated = Interval {
        before: frame(grid, carbon(0.8)),
        after: frame(grid, carbon(0.88)),
        weight: 0.6,
    };
    let domain = Scene::domain_of(value.before.cells.content().iter().map(|v| *v > -1.0));
    Scene {
        grid: *grid,
        domain,
        value,
        accumulated: Some(accumulated),
        terrain: None,
        northward: None,
    }
}

/// A whole earth of sea on at least so many cells, square in degrees, and the view of its north pole, where meridians run
/// together and so do particles.
///
/// # Errors
/// Never: its fixed words are valid.
pub fn pole(cells: u64, size_px: [u32; 2]) -> Result<(Scene, RenderJob)> {
    let rows = (cells as f64 / 2.0).sqrt().ceil();
    let grid = Grid {
        rows: rows as u32,
        cols: 2 * rows as u32,
        north_deg: 90.0,
        west_deg: -180.0,
        dlat_deg: 180.0 / rows,
        dlon_deg: 180.0 / rows,
    };
    let water = |phase: f64| everywhere(&grid, move |lon, lat| flux(lon, lat, phase));
    let value = Interval {
        before: water(0.0),
        after: water(0.5),
        weight: 0.3,
    };
    let domain = Scene::domain_of(value.before.cells.content().iter().map(|_| true));
    let scene = Scene {
        grid,
        domain,
        value,
        accumulated: None,
        terrain: None,
        northward: None,
    };
    let mut job = job(size_px, 64)?;
    job.accumulated = None;
    job.view = View::Globe {
        lon_deg: 10.0,
        lat_deg: 88.0,
        height_m: 9.0e6,
        width_px: size_px[0],
        height_px: size_px[1],
        angles: CameraAngles::NADIR,
    };
    Ok((scene, job))
}

/// Cells of sea.
pub fn particles(scene: &Scene) -> u64 {
    scene
        .domain
        .content()
        .iter()
        .map(|&is_sea| u64::from(is_sea))
        .sum()
}

fn time_sample(product: &str) -> Result<TimeSample> {
    Ok(TimeSample {
        domain: format!("domain/{product}/0").parse()?,
        before: Some(format!("frames/{product}/0").parse()?),
        after: None,
        contributed: None,
    })
}

/// The volume seen from above the region, in slices. What it is drawn from is given beside it.
pub fn job(size_px: [u32; 2], slices: u32) -> Result<RenderJob> {
    let mut style = Style::with_transfer(TransferFunction::default_for(Quantity::CarbonFlux));
    style.slices = slices;
    style.particles_per_cell = 1;
    Ok(RenderJob {
        renderer_version: RENDERER_VERSION,
        grid: grid(1_000),
        value: time_sample("made-up")?,
        accumulated: Some(time_sample("made-up-carbon")?),
        relief: None,
        flow: None,
        mode: Mode::Volume,
        view: View::Globe {
            lon_deg: WEST_DEG + 0.5 * WIDTH_DEG,
            lat_deg: 0.5 * NORTH_DEG,
            height_m: CAMERA_HEIGHT_M,
            width_px: size_px[0],
            height_px: size_px[1],
            angles: CameraAngles::NADIR,
        },
        style,
        annotations: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_has_at_least_the_particles_that_were_asked_for_and_few_more() {
        for wanted in [20_000, 100_000] {
            let made = particles(&scene(&grid(wanted)));
            assert!(
                made >= wanted && made < wanted * 5 / 4,
                "{made} for {wanted}"
            );
        }
    }
}
