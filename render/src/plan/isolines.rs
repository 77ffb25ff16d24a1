//! Isolines for the stages: which values have a line, how wide and in which tone it is.

use std::f64::consts::TAU;

use contract::base_map::BaseMap;
use contract::colour::TransferFunction;
use contract::job::{Mode, RenderJob, View};
use glam::Vec3;

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
const THROUGH: f32 = 0.6;
/// Greys of lines, sRGB: over what is light, and over what is dark.
const DARK: f32 = 0.07;
const LIGHT: f32 = 0.93;
/// Luminance from which on a colour is light, linear: where black and white have the same contrast ratio against it (WCAG
/// 2.1, 1.4.3).
const LIGHT_FROM: f32 = 0.179;

/// Completes the plan of a job that asks for isolines.
pub(super) fn plan(plan: &mut Plan, job: &RenderJob, scene: &Scene) {
    let transfer = &job.style.transfer;
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
        rad_per_px: 0.0,
        low: transfer.low as f32,
        per_unit: per_unit as f32,
    };
    params.context.isolines_on = u32::from(params.isolines.count > 0);
    params.context.isolines_through = if job.mode == Mode::Map { 1.0 } else { THROUGH };
    if let View::Tile { tile, size_px } = job.view {
        params.isolines.rad_per_px = (TAU / tile::world_px(tile, size_px)) as f32;
        plan.axes = tile::axes(&scene.grid, tile, size_px);
    }
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
            let color = Vec3::from(transfer.color(value).map(|share| share as f32));
            linear_of(color).dot(Vec3::new(0.2126, 0.7152, 0.0722)) > LIGHT_FROM
        }
    };
    if is_light { DARK } else { LIGHT }
}
