//! No popping: what moves a little changes the picture a little, and half as far changes it about half as much.

mod levels;

use contract::job::{Mode, RenderJob, View};
use render::plan::Plan;
use render::{Backend, Image, Renderer, Scene};
use render_proof::ocean::REGION;

use crate::scenes::{FIVE_DEGREES, ONE_DEGREE, globe, job, looking_at, ocean, tile};

/// Of all channels, premultiplied: mean and largest change, levels.
fn change(a: &Image, b: &Image) -> (f64, f64) {
    let premultiplied = |image: &Image| -> Vec<f64> {
        let pixels = image.rgba8.chunks_exact(4);
        pixels
            .flat_map(|p| {
                let alpha = f64::from(p[3]) / 255.0;
                [0, 1, 2, 3].map(|i| {
                    if i == 3 {
                        255.0 * alpha
                    } else {
                        f64::from(p[i]) * alpha
                    }
                })
            })
            .collect()
    };
    let (a, b) = (premultiplied(a), premultiplied(b));
    let apart: Vec<f64> = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).collect();
    (
        apart.iter().sum::<f64>() / apart.len() as f64,
        apart.iter().copied().fold(0.0, f64::max),
    )
}

/// Change of the picture over a step and over halves of it, down to an eighth.
fn halving(what: &str, step: f64, picture: impl Fn(f64) -> Image) -> Vec<(f64, f64)> {
    let start = picture(0.0);
    let steps = [1.0, 0.5, 0.25, 0.125];
    steps
        .iter()
        .map(|share| {
            let (mean, most) = change(&start, &picture(step * share));
            println!("{what}: {share} of the step changes {mean:.4} levels in the mean, {most:.1} at most");
            (mean, most)
        })
        .collect()
}

fn later(scene: &Scene, share: f64) -> Scene {
    let mut later = scene.clone();
    later.value.weight += share;
    if let Some(accumulated) = &mut later.accumulated {
        accumulated.weight += share;
    }
    later
}

/// Each half changes at most this share of what the whole does: 0.5 where all is straight, more for what moves in
/// jumps of its own, such as the rounding to whole levels.
const MOST_OF_HALF: f64 = 0.72;

/// Why a series of changes is not smooth; none if it is.
fn roughness(changes: &[(f64, f64)], most_levels: f64) -> Option<String> {
    let (whole, most) = changes[0];
    assert!(whole > 0.1, "the step is seen: {whole}");
    if most > most_levels {
        return Some(format!("{most} levels at once"));
    }
    let halves = changes
        .windows(2)
        .find(|pair| pair[1].0 > MOST_OF_HALF * pair[0].0);
    if let Some(pair) = halves {
        return Some(format!(
            "{} levels in half a step, {} in a whole one",
            pair[1].0, pair[0].0
        ));
    }
    let (_, least_step) = changes[changes.len() - 1];
    (least_step > 0.5 * most + 2.0)
        .then(|| format!("{least_step} levels in an eighth of a step, {most} in a whole one"))
}

#[test]
fn a_little_later_the_volume_looks_a_little_different() {
    let renderer = Renderer::new(Backend::Cpu).unwrap();
    let scene = ocean(ONE_DEGREE);
    for (name, view) in [
        ("globe", globe(-150.0, 0.0, 4.0e6, 96)),
        ("tile", tile(3, 1, 3, 256)),
    ] {
        let job = job(Mode::Volume, view);
        // A fiftieth of a month: a picture of a film that shows a month in two seconds.
        let changes = halving(&format!("time, {name}"), 0.02, |share| {
            renderer.render(&job, &later(&scene, share)).unwrap()
        });
        assert_eq!(roughness(&changes, 24.0), None, "{name}");
    }
}

#[test]
fn from_a_little_farther_the_volume_looks_a_little_different() {
    let renderer = Renderer::new(Backend::Cpu).unwrap();
    let scene = ocean(FIVE_DEGREES);
    let seen = |lon: f64, height: f64| -> RenderJob {
        job(Mode::Volume, globe(-150.0 + lon, 5.0, 6.0e6 + height, 96))
    };
    // Half a pixel to the east; a hundredth higher.
    let east = halving("view, east", 0.3, |lon| {
        renderer.render(&seen(lon, 0.0), &scene).unwrap()
    });
    assert_eq!(roughness(&east, 40.0), None, "east");
    let up = halving("view, up", 6.0e4, |height| {
        renderer.render(&seen(0.0, height), &scene).unwrap()
    });
    assert_eq!(roughness(&up, 40.0), None, "up");
}

#[test]
fn a_camera_that_turns_a_little_sees_the_volume_a_little_different() {
    let renderer = Renderer::new(Backend::Cpu).unwrap();
    let scene = ocean(FIVE_DEGREES);
    let turn = |what: &str, step: f64, angles: fn(f64) -> [f64; 2]| {
        let changes = halving(what, step, |by| {
            let view = looking_at([-150.0, 5.0], 5.0e6, angles(by), 96);
            renderer.render(&job(Mode::Volume, view), &scene).unwrap()
        });
        assert_eq!(roughness(&changes, 40.0), None, "{what}");
    };
    turn("tilt", 0.4, |by| [20.0, 50.0 + by]);
    turn("heading", 2.0, |by| [20.0 + by, 50.0]);
    // From one order of the slices to the other: looking along the light.
    turn("low", 0.3, |by| [135.0, 80.0 + by]);
}

#[test]
fn past_the_edge_of_a_region_slices_and_light_move_without_jumps() {
    let scene = ocean(REGION);
    let plan = |step: i32| {
        let lon_deg = -122.0 + 0.01 * f64::from(step);
        let job = job(Mode::Volume, globe(lon_deg, 20.0, 2.0e6, 96));
        Plan::for_device(&job, &scene, u64::MAX).unwrap().params
    };
    for step in 0..400 {
        let (here, there) = (plan(step), plan(step + 1));
        for (a, b) in [
            (
                here.projection.slices_per_unit,
                there.projection.slices_per_unit,
            ),
            (
                here.projection.light_texels_per_unit,
                there.projection.light_texels_per_unit,
            ),
            (
                1.0 + here.lighting.look_power,
                1.0 + there.lighting.look_power,
            ),
        ] {
            assert!((a / b - 1.0).abs() < 0.004, "step {step}: {a}, {b}");
        }
    }
}

/// Steps on either side of one that say what a step of the camera changes.
const NEIGHBOURS: usize = 4;
/// A step over a change of detail may change the picture by at most so many times what those beside it do.
const MOST_OVER_BESIDE: f64 = 1.3;

/// The steps of a series that change a picture by more than those beside them, with how many times as much.
fn jumps(changes: &[f64]) -> Vec<(usize, f64)> {
    let beside = |step: usize| {
        let around = step.saturating_sub(NEIGHBOURS)..changes.len().min(step + NEIGHBOURS + 1);
        let mut beside: Vec<f64> = around
            .filter(|at| *at != step)
            .map(|at| changes[at])
            .collect();
        beside.sort_unstable_by(f64::total_cmp);
        beside[beside.len() / 2]
    };
    (0..changes.len())
        .map(|step| (step, changes[step] / beside(step)))
        .filter(|(_, times)| *times > MOST_OVER_BESIDE)
        .collect()
}

#[test]
fn fewer_particles_and_joined_cells_come_without_a_jump() {
    let renderer = Renderer::new(Backend::Cpu).unwrap();
    let scene = ocean(REGION);
    // From nine particles a cell to one, then over two joinings of cells; straight down and aslant.
    let from_above = |distance_m: f64| globe(-135.0, 20.5, distance_m, 128);
    let aslant = |distance_m: f64| looking_at([-135.0, 20.5], distance_m, [20.0, 60.0], 128);
    let views: [(&str, &dyn Fn(f64) -> View); 2] = [("nadir", &from_above), ("aslant", &aslant)];
    for (name, view) in views {
        let picture = |step: usize| {
            let job = job(Mode::Volume, view(4.0e5 * 1.02_f64.powi(step as i32)));
            renderer.render(&job, &scene).unwrap()
        };
        let mut before = picture(0);
        let changes: Vec<f64> = (1..150)
            .map(|step| {
                let after = picture(step);
                change(&std::mem::replace(&mut before, after), &before).0
            })
            .collect();
        println!("{name}: {changes:.2?}");
        let found = jumps(&changes);
        assert!(found.is_empty(), "{name}: {found:.2?}");
    }
}

#[test]
fn a_jump_is_told_from_a_move() {
    let renderer = Renderer::new(Backend::Cpu).unwrap();
    let scene = ocean(FIVE_DEGREES);
    let job = job(Mode::Volume, globe(-150.0, 5.0, 6.0e6, 64));
    // Two slices blend into another picture than three: however small the step, it is there at once.
    let changes = halving("slices", 1.0, |share| {
        let mut job = job.clone();
        job.style.slices = if share > 0.0 { 3 } else { 2 };
        renderer.render(&job, &scene).unwrap()
    });
    let told = roughness(&changes, 255.0);
    assert!(told.is_some_and(|why| why.contains("half a step")));
}
