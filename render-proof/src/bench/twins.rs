//! Interpolation and particle generation on the processor, all cores: what the first pass over particles is held against.

use std::thread;
use std::time::Instant;

use anyhow::Result;
use contract::job::RenderJob;
use render::plan::Plan;
use render::stages::interpolate::params::InterpolateParams;
use render::stages::layout::{Particle, Splat};
use render::stages::particles::cpu::{Inputs, generate};
use render::stages::{interpolate, project};
use render::{Interval, Scene};

use crate::bench::frames::weights;
use crate::bench::stats::Times;

/// Interpolates the grids and makes and projects every particle, `runs` times.
pub fn measure(job: &RenderJob, scene: &Scene, runs: usize) -> Result<(Times, usize)> {
    let plan = Plan::new(job, scene, u64::MAX)?;
    let cores = thread::available_parallelism().map_or(1, usize::from);
    let mut times = vec![];
    for run in 0..runs {
        let start = Instant::now();
        one(&plan, scene, run, cores);
        times.push(start.elapsed().as_secs_f64());
    }
    Ok((Times::of(times), cores))
}

fn one(plan: &Plan, scene: &Scene, run: usize, cores: usize) {
    let (value_weight, carbon_weight) = weights(run);
    let value = between(plan, &scene.value, value_weight, cores);
    let carbon = scene
        .accumulated
        .as_ref()
        .map(|interval| between(plan, interval, carbon_weight, cores))
        .unwrap_or_default();
    let each = plan.params.cells.particles_per_cell as usize;
    let cells = plan.active.len().div_ceil(cores).max(1);
    let mut splats = vec![Splat::default(); plan.active.len() * each];
    thread::scope(|scope| {
        for (active, splats) in plan
            .active
            .chunks(cells)
            .zip(splats.chunks_mut(cells * each))
        {
            let (value, carbon) = (&value, &carbon);
            scope.spawn(move || {
                let mut particles = vec![Particle::default(); splats.len()];
                let inputs = Inputs {
                    active,
                    rows: &plan.rows,
                    value,
                    accumulated: carbon,
                    palette: &plan.palette,
                    uncertainty: &[],
                    domain: scene.domain.content(),
                };
                generate(&plan.params, &inputs, &mut particles);
                project::cpu::project(&plan.params, &plan.rows, &plan.cols, &particles, splats);
            });
        }
    });
    std::hint::black_box(&splats);
}

fn between(plan: &Plan, interval: &Interval, weight: f32, cores: usize) -> Vec<f32> {
    let fields = [&interval.before, &interval.after].map(|field| field.cells.content());
    let mut between = vec![0.0; fields[0].len()];
    let each = between.len().div_ceil(cores).max(1);
    thread::scope(|scope| {
        let parts = between
            .chunks_mut(each)
            .zip(fields[0].chunks(each).zip(fields[1].chunks(each)));
        for (between, (before, after)) in parts {
            scope.spawn(move || {
                // A part is a grid of its own to the twin.
                let mut params = plan.params;
                params.interpolation = InterpolateParams {
                    first_cell: 0,
                    end_cell: between.len() as u32,
                };
                interpolate::cpu::interpolate(&params, weight, before, after, between);
            });
        }
    });
    between
}
