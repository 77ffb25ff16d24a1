//! One frame on the CPU: the twins of the stages in the order of `frame.rs`.

use contract::job::Mode;
use glam::Vec4;

use crate::error::RenderError;
use crate::plan::{Part, Plan};
use crate::scene::{Interval, Scene};
use crate::stages::compose::in_context::{self, Surroundings};
use crate::stages::eye::cpu::Hiding;
use crate::stages::flow::cpu::VectorField;
use crate::stages::layout::{Entry, LIGHT_OFF, Particle, Splat};
use crate::stages::params::Params;
use crate::stages::particles::cpu::Inputs;
use crate::stages::sizes::{list_count, texel_count};
use crate::stages::{
    bin, compose, eye, flow, interpolate, isolines, light, map, particles, project, uncertainty,
};

/// Most particles of one picture.
const MOST_PARTICLES: usize = 1 << 24;
/// Most bytes that the lists of one picture may take.
const MOST_ENTRY_BYTES: u64 = 4 << 30;

/// Draws one part; its pixels as RGBA8, red lowest.
pub fn draw(plan: &Plan, part: Part, scene: &Scene) -> Result<Vec<u8>, RenderError> {
    let params = plan.params_of(part);
    let pixels = params.view.size_px.x as usize * params.view.size_px.y as usize;
    let mut picture = vec![Vec4::ZERO; pixels];
    let value = interpolated(&params, params.values.weight, &scene.value);
    let uncertainty = uncertainty::between(&params, &scene.value);
    let lines = lined(plan, &params, scene, &value);
    if plan.mode == Mode::Map {
        let inputs = map::cpu::Inputs {
            value: &value,
            palette: &plan.palette,
            axes: &plan.axes,
            uncertainty: &uncertainty,
            domain: scene.domain.content(),
        };
        map::cpu::map(&params, &inputs, &mut picture);
    } else {
        let accumulated = scene.accumulated.as_ref();
        let accumulated = accumulated
            .map(|interval| interpolated(&params, params.values.accumulated_weight, interval));
        let count = plan.active.len() * params.cells.particles_per_cell as usize;
        check_count(count)?;
        let mut particles = vec![Particle::default(); count];
        if let (Mode::Flow, Some(northward)) = (plan.mode, &scene.northward) {
            let north = interpolated(&params, params.values.northward_weight, northward);
            let velocity = flow::cpu::velocities(&value, &north);
            let field = VectorField {
                params: &params,
                rows: &plan.rows,
                velocity: &velocity,
            };
            let inputs = flow::cpu::Inputs {
                active: &plan.active,
                field,
                palette: &plan.palette,
            };
            flow::cpu::trails(&params, &inputs, &mut particles);
        } else {
            let inputs = Inputs {
                active: &plan.active,
                rows: &plan.rows,
                value: &value,
                accumulated: accumulated.as_deref().unwrap_or_default(),
                palette: &plan.palette,
                uncertainty: &uncertainty,
                domain: scene.domain.content(),
            };
            particles::cpu::generate(&params, &inputs, &mut particles);
        }
        let mut splats = vec![Splat::default(); particles.len()];
        project::cpu::project(&params, &plan.rows, &plan.cols, &particles, &mut splats);
        if params.lighting.mode != LIGHT_OFF {
            let mut buffer = vec![0u32; texel_count(&params)];
            light::cpu::deposit(&params, &splats, &mut buffer);
            light::cpu::prefix(&params, &mut buffer);
            light::cpu::shade(&params, &buffer, &mut splats);
        }
        let (list_ends, entries) = binned(&params, &splats)?;
        let hiding = Hiding::of(plan);
        eye::cpu::eye(&params, &list_ends, &entries, hiding, &mut picture);
    }
    let mut image = vec![0u32; pixels];
    if params.in_context {
        let around = Surroundings::of(plan, scene, &lines);
        in_context::compose(&params, &picture, &around, &mut image);
    } else {
        compose::cpu::compose(&params, &picture, &mut image);
    }
    Ok(image.into_iter().flat_map(u32::to_le_bytes).collect())
}

/// Lines on the sea surface; none where a picture has none.
fn lined(plan: &Plan, params: &Params, scene: &Scene, value: &[f32]) -> Vec<u32> {
    let mut lines = vec![];
    if params.context.lines_on == 1 {
        lines.resize(params.view.size_px.element_product() as usize, 0);
        let inputs = isolines::cpu::Inputs::of(plan, scene, value);
        isolines::cpu::draw_lines(params, &inputs, &mut lines);
    }
    lines
}

fn check_count(count: usize) -> Result<(), RenderError> {
    if count > MOST_PARTICLES {
        return Err(RenderError::TooManyParticles {
            count: count as u64,
            limit: MOST_PARTICLES as u64,
        });
    }
    Ok(())
}

fn interpolated(params: &Params, weight: f32, interval: &Interval) -> Vec<f32> {
    let (before, after) = (
        interval.before.cells.content(),
        interval.after.cells.content(),
    );
    let mut between = vec![0.0; before.len()];
    interpolate::cpu::interpolate(params, weight, before, after, &mut between);
    between
}

fn binned(params: &Params, splats: &[Splat]) -> Result<(Vec<u32>, Vec<Entry>), RenderError> {
    let mut counts = vec![0u32; list_count(params) as usize];
    bin::cpu::count(params, splats, &mut counts);
    let bytes =
        counts.iter().map(|&count| u64::from(count)).sum::<u64>() * size_of::<Entry>() as u64;
    if bytes > MOST_ENTRY_BYTES {
        return Err(RenderError::TooLarge {
            what: "list entries",
            bytes,
            limit: MOST_ENTRY_BYTES,
        });
    }
    let total = bin::cpu::scan(&mut counts);
    let mut entries = vec![Entry::default(); total as usize];
    bin::cpu::scatter(params, splats, &mut counts, &mut entries);
    Ok((counts, entries))
}
