//! Made-up scenes of any size: the China Seas of the synthetic product, 0 to 41 N and 100 to 130 E, on as many cells as
//! are wanted, with one particle a cell of sea. Fronts, river plumes, eddies down to a tenth of a degree, a ragged coast
//! and clouds, under which a gap was filled and eddies are missing.
//!
//! What a picture costs follows from how particles lie on the screen and from how they hide one another, so a scene that
//! looks like no data tells little of the time that data take.

use std::sync::Arc;
use std::thread;

use anyhow::Result;
use contract::camera::CameraAngles;
use contract::colour::TransferFunction;
use contract::grid::{Grid, LonLatDeg};
use contract::job::{Mode, RENDERER_VERSION, RenderJob, Style, View};
use contract::look_at::LookAt;
use contract::quantity::Quantity;
use contract::time_sample::TimeSample;
use render::{Field, Interval, Scene};
use synthetic::Noise;
use synthetic::china_sea::{coast, flux};

const NORTH_DEG: f64 = 41.0;
const WEST_DEG: f64 = 100.0;
const WIDTH_DEG: f64 = 30.0;
/// Carbon of a millimole of CO2, kg.
const KG_MMOL: f64 = 12.011e-6;
const DAY_S: f64 = 86_400.0;
const YEAR_S: f64 = 365.25 * DAY_S;
/// The camera sees the whole region in a picture that is wider than high.
const CAMERA_HEIGHT_M: f64 = 5.3e6;
/// Where a tilted camera looks: from the north, the sun behind it, over the East China Sea to the south.
const HEADING_DEG: f64 = 200.0;
/// The seed of all that is made up.
const SEED: u64 = 1;
/// The two months: January, of strong sinks in the north, and February.
const MONTHS: [usize; 2] = [0, 1];
/// Share of the sea under cloud.
const CLOUD_SHARE: f64 = 0.2;
/// Places that shares are measured at, down and across the region.
const SAMPLES: [u32; 2] = [164, 120];
/// Room for what a share measured at places is off.
const MARGIN: f64 = 1.02;

/// A grid of the region with at least so many cells of sea, square in degrees.
pub fn grid(particles: u64) -> Grid {
    let cells = particles as f64 / sea_share() * MARGIN;
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

/// Places spread over the region.
fn samples() -> impl Iterator<Item = (f64, f64)> {
    let [down, across] = SAMPLES;
    (0..down).flat_map(move |y| {
        (0..across).map(move |x| {
            let [south, east] = [(y, down), (x, across)]
                .map(|(place, all)| (f64::from(place) + 0.5) / f64::from(all));
            (WEST_DEG + WIDTH_DEG * east, NORTH_DEG * (1.0 - south))
        })
    })
}

/// Share of the region that is sea.
fn sea_share() -> f64 {
    let noise = Noise::new(SEED);
    let sea = samples().filter(|&(lon, lat)| !coast::is_land(lon, lat, noise));
    sea.count() as f64 / samples().count() as f64
}

/// The cloudiness that a fifth of all places are above in a month.
fn cloud_threshold(month: usize) -> f32 {
    let noise = Noise::new(SEED);
    let clouds = samples().map(|(lon, lat)| flux::cloudiness(lon, lat, month, noise));
    let mut clouds: Vec<f32> = clouds.collect();
    clouds.sort_unstable_by(f32::total_cmp);
    clouds[((1.0 - CLOUD_SHARE) * clouds.len() as f64) as usize]
}

/// One number a cell from its number and its place, on all cores.
fn everywhere(grid: &Grid, value: impl Fn(usize, f64, f64) -> f32 + Sync) -> Vec<f32> {
    let mut values = vec![f32::NAN; grid.cell_count()];
    let cores = thread::available_parallelism().map_or(1, usize::from);
    let rows_each = (grid.rows as usize).div_ceil(cores);
    let cols = grid.cols as usize;
    thread::scope(|scope| {
        for (part, rows) in values.chunks_mut(rows_each * cols).enumerate() {
            let value = &value;
            scope.spawn(move || {
                for (down, row) in rows.chunks_mut(cols).enumerate() {
                    let down = part * rows_each + down;
                    let lat = grid.north_deg - grid.dlat_deg * (down as f64 + 0.5);
                    for (col, cell) in row.iter_mut().enumerate() {
                        let lon = grid.west_deg + grid.dlon_deg * (col as f64 + 0.5);
                        *cell = value(down * cols + col, lon, lat);
                    }
                }
            });
        }
    });
    values
}

/// Flux of a month, kg m⁻² s⁻¹, in the cells that are sea; under clouds what is known from around them.
fn month(grid: &Grid, is_sea: &[bool], month: usize) -> Vec<f32> {
    let (noise, threshold) = (Noise::new(SEED), cloud_threshold(month));
    everywhere(grid, |cell, lon, lat| {
        if !is_sea[cell] {
            return f32::NAN;
        }
        let mmol_m2_d = if flux::cloudiness(lon, lat, month, noise) < threshold {
            flux::flux_mmol_m2_d(lon, lat, month, noise)
        } else {
            flux::smooth_flux_mmol_m2_d(lon, lat, month)
        };
        (mmol_m2_d * KG_MMOL / DAY_S) as f32
    })
}

/// Two adjacent months and what has accumulated until each.
pub fn scene(grid: &Grid) -> Scene {
    let noise = Noise::new(SEED);
    let is_sea = everywhere(grid, |_, lon, lat| {
        f32::from(u8::from(!coast::is_land(lon, lat, noise)))
    });
    let is_sea: Vec<bool> = is_sea.into_iter().map(|sea| sea > 0.5).collect();
    let [before, after] = MONTHS.map(|number| month(grid, &is_sea, number));
    // Some ten months of what the two let pass on average.
    let accumulated = |share: f64| {
        let months = before.iter().zip(&after);
        let mean = months.map(|(before, after)| 0.5 * (f64::from(*before) + f64::from(*after)));
        let field = mean.map(|flux| (flux * share * YEAR_S) as f32).collect();
        Arc::new(Field::new(field))
    };
    let accumulated = Interval {
        before: accumulated(0.8),
        after: accumulated(0.88),
        weight: 0.6,
    };
    Scene {
        grid: *grid,
        domain: Scene::domain_of(is_sea),
        value: Interval {
            before: Arc::new(Field::new(before)),
            after: Arc::new(Field::new(after)),
            weight: 0.3,
        },
        accumulated: Some(accumulated),
        terrain: None,
        northward: None,
        trails: None,
        whole: None,
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
    let noise = Noise::new(SEED);
    let water = |z: f64| {
        // A sink as strong as in the China Seas, with eddies as wide as they are there.
        let flux = |_, lon: f64, lat: f64| {
            let eddies = noise.fractal(lon / 1.6, lat / 1.6, z, 5);
            ((4.0 * eddies - 5.0) * KG_MMOL / DAY_S) as f32
        };
        Arc::new(Field::new(everywhere(&grid, flux)))
    };
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
        trails: None,
        whole: None,
    };
    let mut job = job(size_px, 64, 0.0)?;
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
        .filter(|&&covered| covered > 0)
        .count() as u64
}

fn time_sample(product: &str) -> Result<TimeSample> {
    Ok(TimeSample {
        domain: format!("domain/{product}/0").parse()?,
        before: Some(format!("frames/{product}/0").parse()?),
        after: None,
        contributed: None,
    })
}

/// The region from above, or from as far away with a tilt of so many degrees at its middle.
fn view([width_px, height_px]: [u32; 2], tilt_deg: f64) -> Result<View> {
    let (lon, lat) = (WEST_DEG + 0.5 * WIDTH_DEG, 0.5 * NORTH_DEG);
    if tilt_deg > 0.0 {
        let look_at = LookAt {
            target: LonLatDeg { lon, lat },
            distance_m: CAMERA_HEIGHT_M,
            angles: CameraAngles {
                heading_deg: HEADING_DEG,
                tilt_deg,
                ..CameraAngles::NADIR
            },
        };
        return Ok(look_at.view([width_px, height_px])?);
    }
    Ok(View::Globe {
        lon_deg: lon,
        lat_deg: lat,
        height_m: CAMERA_HEIGHT_M,
        width_px,
        height_px,
        angles: CameraAngles::NADIR,
    })
}

/// The volume of the region in slices, upright or tilted, degrees. What it is drawn from is given beside it.
///
/// # Errors
/// A tilt that is none.
pub fn job(size_px: [u32; 2], slices: u32, tilt_deg: f64) -> Result<RenderJob> {
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
        trails: None,
        mode: Mode::Volume,
        view: view(size_px, tilt_deg)?,
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

    #[test]
    fn the_sea_has_a_coast_sinks_sources_and_smooth_water_under_clouds() {
        let grid = grid(60_000);
        let scene = scene(&grid);
        let flux = scene.value.before.cells.content();
        let sea = flux.iter().filter(|flux| **flux > -1.0);
        let [low, high] = scene.value.before.range;
        assert!(low < -5e-10 && high > 1e-10, "{low} {high}");
        let share = sea.count() as f64 / flux.len() as f64;
        assert!((0.4..0.8).contains(&share), "{share}");
        // Under a cloud neighbours are alike, beside it eddies make them differ.
        let (noise, threshold) = (Noise::new(SEED), cloud_threshold(MONTHS[0]));
        let [mut clear, mut cloudy] = [(0.0, 0), (0.0, 0)];
        for cell in 1..flux.len() {
            let (row, col) = (cell as u32 / grid.cols, cell as u32 % grid.cols);
            let place = grid.cell_center(row, col);
            let pair = [flux[cell - 1], flux[cell]];
            if col == 0 || pair.iter().any(|flux| *flux < -1.0) {
                continue;
            }
            let is_cloudy = flux::cloudiness(place.lon, place.lat, MONTHS[0], noise) >= threshold;
            let side = if is_cloudy { &mut cloudy } else { &mut clear };
            *side = (side.0 + (pair[0] - pair[1]).abs(), side.1 + 1);
        }
        let mean = |(sum, count): (f32, u32)| sum / count as f32;
        let covered = f64::from(cloudy.1) / f64::from(cloudy.1 + clear.1);
        assert!((covered - CLOUD_SHARE).abs() < 0.1, "{covered}");
        assert!(mean(cloudy) < 0.5 * mean(clear));
    }
}
