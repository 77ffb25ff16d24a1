//! Nothing is lost or made on the way from the grid to the picture: carbon, light's depth, the eye's depth.

use contract::earth::Earth;
use contract::job::Mode;
use render::plan::Plan;
use render::stages::interpolate::cpu::interpolated;
use render::stages::layout::{Particle, Splat, is_missing};
use render::stages::params::Params;
use render::stages::sizes::texel_count;
use render::stages::{light, particles, project};
use render::{Interval, Scene};

use crate::scenes::{ONE_DEGREE, globe, job, ocean, tile};

struct Drawn {
    params: Params,
    particles: Vec<Particle>,
    splats: Vec<Splat>,
    carbon: Vec<f32>,
    cells: Vec<u32>,
}

fn at(interval: &Interval) -> Vec<f32> {
    let (before, after) = (
        interval.before.cells.content(),
        interval.after.cells.content(),
    );
    let pairs = before.iter().zip(after);
    pairs
        .map(|(a, b)| interpolated(*a, *b, interval.weight as f32))
        .collect()
}

fn drawn(view: contract::job::View, scene: &Scene) -> Drawn {
    let plan = Plan::new(&job(Mode::Volume, view), scene, u64::MAX).unwrap();
    let params = plan.params_of(plan.parts()[0]);
    let (value, carbon) = (at(&scene.value), at(scene.accumulated.as_ref().unwrap()));
    let count = plan.active.len() * params.cells.particles_per_cell as usize;
    let mut particles = vec![Particle::default(); count];
    let inputs = particles::cpu::Inputs {
        active: &plan.active,
        rows: &plan.rows,
        value: &value,
        accumulated: &carbon,
        palette: &plan.palette,
        uncertainty: &[],
        domain: scene.domain.content(),
    };
    particles::cpu::generate(&params, &inputs, &mut particles);
    let mut splats = vec![Splat::default(); particles.len()];
    project::cpu::project(&params, &plan.rows, &plan.cols, &particles, &mut splats);
    Drawn {
        params,
        particles,
        splats,
        carbon,
        cells: plan.active.iter().map(|active| active.cell).collect(),
    }
}

#[test]
fn the_particles_of_a_picture_carry_the_carbon_of_its_cells_to_a_millionth() {
    let scene = ocean(ONE_DEGREE);
    for view in [
        tile(3, 1, 3, 256),
        tile(5, 6, 13, 256),
        globe(-150.0, 0.0, 4.0e6, 96),
    ] {
        let drawn = drawn(view, &scene);
        let carried_kg: f64 = drawn.particles.iter().map(|p| f64::from(p.mass_kg)).sum();
        let (mut held_kg, mut moved_kg) = (0.0, 0.0);
        for &cell in &drawn.cells {
            let kg_m2 = drawn.carbon[cell as usize];
            if !is_missing(kg_m2) {
                let area_m2 = scene
                    .grid
                    .cell_area_m2(cell / scene.grid.cols, Earth::Wgs84);
                held_kg += f64::from(kg_m2) * area_m2;
                moved_kg += f64::from(kg_m2.abs()) * area_m2;
            }
        }
        println!("{view:?}: {carried_kg:.9e} kg carried, {held_kg:.9e} kg held");
        // Sinks and sources cancel: the tolerance is of what is moved either way.
        assert!(moved_kg > 1e9 && (carried_kg - held_kg).abs() < 1e-6 * moved_kg);
    }
}

/// However many particles share a cell's depth, and however small each one's share of a texel is, light keeps it all.
#[test]
fn light_keeps_its_mass_from_a_hundred_thousand_particles_to_tens_of_millions() {
    let scene = ocean(ONE_DEGREE);
    let drawn = drawn(globe(-150.0, 0.0, 4.0e6, 96), &scene);
    let shown: Vec<Splat> = drawn.splats.into_iter().filter(|s| s.tau > 0.0).collect();
    for particles in [1e5, 4.4e6, 1e7, 4.4e7] {
        // As many as there are stand for more: each has the depth that it would have among so many.
        let share = shown.len() as f64 / particles;
        let thin: Vec<Splat> = shown
            .iter()
            .map(|splat| Splat {
                light_depth: (f64::from(splat.light_depth) * share) as f32,
                ..*splat
            })
            .collect();
        let given: f64 = thin.iter().map(|splat| f64::from(splat.light_depth)).sum();
        let mut light = vec![0u32; texel_count(&drawn.params)];
        light::cpu::deposit(&drawn.params, &thin, &mut light);
        let kept = light.iter().map(|&depth| f64::from(depth)).sum::<f64>();
        let kept = kept / f64::from(drawn.params.lighting.depth_one) / given;
        println!(
            "{particles:e} particles: {:.4} % of the light's depth kept",
            100.0 * kept
        );
        assert!((kept - 1.0).abs() < 5e-3, "{particles:e}: {kept}");
    }
}

/// A camera that has the whole disc in view hides nothing but by the horizon.
#[test]
fn particles_behind_the_horizon_cast_their_shadow_on_those_before_it() {
    let scene = ocean(ONE_DEGREE);
    let drawn = drawn(globe(-150.0, 0.0, 3.0e7, 96), &scene);
    let casting = drawn.splats.iter().filter(|splat| splat.light_depth > 0.0);
    let (shown, hidden): (Vec<Splat>, Vec<Splat>) = casting.partition(|splat| splat.tau > 0.0);
    let light_of = |splats: &[Splat]| {
        let mut light = vec![0u32; texel_count(&drawn.params)];
        light::cpu::deposit(&drawn.params, splats, &mut light);
        light
    };
    let texels = light_of(&shown).into_iter().zip(light_of(&hidden));
    let both = texels.filter(|&(shown, hidden)| shown > 0 && hidden > 0);
    let both = both.count();
    println!(
        "{} particles shown, {} behind the horizon; texels of the light with both: {both}",
        shown.len(),
        hidden.len()
    );
    assert!(hidden.len() > shown.len() / 100 && both > 20);
}

#[test]
fn the_light_buffer_holds_the_depth_of_every_particle_to_the_last_integer() {
    let scene = ocean(ONE_DEGREE);
    let drawn = drawn(globe(-150.0, 0.0, 4.0e6, 96), &scene);
    let texels = texel_count(&drawn.params);
    let held = |buffer: &[u32]| buffer.iter().map(|&depth| u64::from(depth)).sum::<u64>();
    let mut all = vec![0u32; texels];
    light::cpu::deposit(&drawn.params, &drawn.splats, &mut all);

    // In two parts and the other way round: integers do not mind.
    let mut parts = vec![0u32; texels];
    let backwards: Vec<Splat> = drawn.splats.iter().rev().copied().collect();
    let (first, second) = backwards.split_at(backwards.len() / 3);
    light::cpu::deposit(&drawn.params, second, &mut parts);
    light::cpu::deposit(&drawn.params, first, &mut parts);
    assert_eq!(all, parts);

    // The sum of what each gives alone, and nothing beside the buffer: within half an integer for each of eight shares.
    let given: f64 = drawn
        .splats
        .iter()
        .filter(|splat| splat.tau > 0.0)
        .map(|splat| f64::from(splat.light_depth))
        .sum();
    let shown = drawn.splats.iter().filter(|splat| splat.tau > 0.0).count();
    let kept = held(&all) as f64 / f64::from(drawn.params.lighting.depth_one);
    println!("depth given {given:.6}, kept {kept:.6}, {shown} particles");
    let rounding = 8.0 * 0.5 * shown as f64 / f64::from(drawn.params.lighting.depth_one);
    assert!((kept - given).abs() < rounding && (kept / given - 1.0).abs() < 1e-5);

    // The layer behind the last one holds twice everything.
    let total = held(&all);
    light::cpu::prefix(&drawn.params, &mut all);
    let layer = (drawn.params.lighting.size.x * drawn.params.lighting.size.y) as usize;
    let last = &all[drawn.params.lighting.layers as usize * layer..];
    assert_eq!(held(&last[..layer]), 2 * total);
}
