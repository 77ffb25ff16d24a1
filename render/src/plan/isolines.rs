//! Lines on the sea surface for the stages: which values have an isoline, how wide and in which tone it is; the graticule
//! that the annotations of a job name.

use std::f64::consts::TAU;

use contract::annotation::Graticule;
use contract::base_map::BaseMap;
use contract::colour::TransferFunction;
use contract::job::{Mode, RenderJob, View};
use glam::Vec3;

use super::camera::Camera;
use super::{Plan, tile};
use crate::scene::Scene;
use crate::stages::colour::linear_of;
use crate::stages::compose::base_map::composed_grey;
use crate::stages::isolines::params::{Isoline, IsolineParams};

/// Half the width of a line, and of that of zero, pixels.
const HALF_PX: [f32; 2] = [0.6, 1.0];
/// How much of what lies below a line hides, and that of zero.
const ALPHA: [f32; 2] = [0.72, 0.9];
/// How much of it is seen through particles.
const THROUGH: f32 = 0.8;
/// Greys of lines, sRGB: over what is light, and over what is dark.
const DARK: f32 = 0.07;
const LIGHT: f32 = 0.93;
/// Greys (sRGB) and opacities of the graticule.
const GRATICULE_ON_DARK: [f32; 2] = [0.95, 0.22];
const GRATICULE_ON_LIGHT: [f32; 2] = [0.1, 0.28];
/// Half the width of its lines for each pixel of the picture's size (the root of its area), and the least, pixels.
const GRATICULE_PER_PX: f64 = 0.0005;
const LEAST_GRATICULE_HALF_PX: f64 = 0.45;
/// Most lines of the graticule of one kind in a picture.
const MOST_LINES: f64 = 120.0;
/// Luminance from which on a colour is light, linear: where black and white have the same contrast ratio against it (WCAG
/// 2.1, 1.4.3).
const LIGHT_FROM: f32 = 0.179;

/// Completes the plan of a job that asks for isolines.
pub(super) fn plan(plan: &mut Plan, job: &RenderJob, scene: &Scene) {
    let transfer = &job.style.transfer;
    graticule(plan, job);
    let Some(isolines) = job.style.context.isolines else {
        return;
    };
    // A valid job has some.
    let values = isolines.lines(transfer).unwrap_or_default();
    let per_unit = 1.0 / (transfer.high - transfer.low);
    let places: Vec<f64> = values
        .iter()
        .map(|line| (line.value - transfer.low) * per_unit)
        .collect();
    let line = |(i, line): (usize, &contract::isolines::Isoline)| Isoline {
        value: places[i] as f32,
        gap: gap(&places, i) as f32,
        half_px: HALF_PX[usize::from(line.is_main)],
        grey: composed_grey(tone(job, transfer, line.value)),
        alpha: ALPHA[usize::from(line.is_main)],
    };
    plan.isolines = values.iter().enumerate().map(line).collect();
    let params = &mut plan.params;
    params.isolines = IsolineParams {
        count: plan.isolines.len() as u32,
        low: transfer.low as f32,
        per_unit: per_unit as f32,
        ..params.isolines
    };
    params.context.lines_on = 1;
    params.context.isolines_through = if job.mode == Mode::Map { 1.0 } else { THROUGH };
    if let View::Tile { tile, size_px } = job.view {
        params.isolines.rad_per_px = (TAU / tile::world_px(tile, size_px)) as f32;
        plan.axes = tile::axes(&scene.grid, tile, size_px);
    }
}

/// Meridians and parallels, where the annotations of a job have them: they lie on the globe, so that particles hide them.
fn graticule(plan: &mut Plan, job: &RenderJob) {
    let wanted = job.annotations.as_ref().and_then(|them| them.graticule);
    let (Some(wanted), Some(camera)) = (wanted, Camera::of(&job.view)) else {
        return;
    };
    let [width, height] = job.view.size_px().map(f64::from);
    let params = &mut plan.params;
    let step_rad = graticule_step_deg(wanted, camera.horizon()).to_radians();
    params.isolines.graticule_per_rad = (1.0 / step_rad) as f32;
    params.isolines.graticule_half_px =
        (0.5 * (width * height).sqrt() * GRATICULE_PER_PX).max(LEAST_GRATICULE_HALF_PX) as f32;
    let context = &mut params.context;
    context.lines_on = 1;
    let [grey, alpha] = match job.style.context.base_map {
        BaseMap::Dark => GRATICULE_ON_DARK,
        BaseMap::Light => GRATICULE_ON_LIGHT,
    };
    (context.graticule_grey, context.graticule_alpha) = (composed_grey(grey), alpha);
}

/// The distance of lines asked for, or a round number of times that, so that they can be told apart: by a camera with
/// its horizon so far from the place below or above it, radians.
pub fn graticule_step_deg(asked: Graticule, horizon: f64) -> f64 {
    let least_deg = 2.0 * horizon.to_degrees() / MOST_LINES;
    let mut step = asked.step_deg;
    for factor in [2.0, 2.5, 2.0].into_iter().cycle() {
        // It ends, even for a camera that has no horizon.
        if step >= least_deg || !least_deg.is_finite() {
            break;
        }
        step *= factor;
    }
    step
}

/// To the nearest neighbour; a line alone has the whole range.
fn gap(places: &[f64], i: usize) -> f64 {
    let before = i.checked_sub(1).map(|before| places[i] - places[before]);
    let after = places.get(i + 1).map(|after| after - places[i]);
    before.into_iter().chain(after).fold(1.0, f64::min)
}

/// The grey of a line: against the colours of its value, which lie on both sides of it; against the ground where that is
/// seen between particles.
fn tone(job: &RenderJob, transfer: &TransferFunction, value: f64) -> f32 {
    let is_light = match (job.mode, job.view) {
        // As coast lines of tiles have it, which lie over the dark map of their client.
        (Mode::Points, View::Tile { .. }) => false,
        (Mode::Points, View::Globe { .. }) => job.style.context.base_map == BaseMap::Light,
        _ => {
            let colour = Vec3::from(transfer.colour(value).map(|share| share as f32));
            linear_of(colour).dot(Vec3::new(0.2126, 0.7152, 0.0722)) > LIGHT_FROM
        }
    };
    if is_light { DARK } else { LIGHT }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::camera::CameraAngles;
    use contract::earth::SPHERE_RADIUS_M;

    #[test]
    fn a_graticule_that_nobody_could_tell_apart_has_fewer_lines() {
        let step = |asked, height_m: f64| {
            let view = View::Globe {
                lon_deg: 0.0,
                lat_deg: 0.0,
                height_m,
                width_px: 64,
                height_px: 64,
                angles: CameraAngles::NADIR,
            };
            let horizon = Camera::of(&view).unwrap().horizon();
            graticule_step_deg(Graticule::every(asked).unwrap(), horizon)
        };
        // From two earth radii up 141 degrees are seen.
        assert!((step(10.0, 2.0 * SPHERE_RADIUS_M) - 10.0).abs() < 1e-9);
        assert!((step(0.01, 2.0 * SPHERE_RADIUS_M) - 2.0).abs() < 1e-9);
        assert!((step(0.01, 5e-5 * SPHERE_RADIUS_M) - 0.01).abs() < 1e-9);
        // From below the sea too.
        for height_m in [-1e3, -4.5e5, -1e6] {
            let step_deg = step(0.01, height_m);
            assert!((0.5..5.0).contains(&step_deg), "{height_m}: {step_deg}");
        }
        let nowhere = graticule_step_deg(Graticule::every(1.0).unwrap(), f64::NAN);
        assert!((nowhere - 1.0).abs() < 1e-9, "{nowhere}");
    }

    #[test]
    fn a_line_is_as_far_from_others_as_the_nearest_of_them() {
        let places = [0.0, 0.1, 0.4];
        let gaps: Vec<f64> = (0..3).map(|i| gap(&places, i)).collect();
        assert!((gaps[0] - 0.1).abs() < 1e-12 && (gaps[1] - 0.1).abs() < 1e-12);
        assert!((gaps[2] - 0.3).abs() < 1e-12 && (gap(&[0.5], 0) - 1.0).abs() < 1e-12);
    }
}
