//! Every stage on the GPU against its CPU twin, and against a shader with a planted fault that must be seen.

use std::sync::OnceLock;

use bytemuck::Pod;
use contract::job::{Mode, View};
use glam::Vec4;
use render_worker::Scene;
use render_worker::frame::{FrameContext, SceneBuffers};
use render_worker::gpu::{Gpu, Slot, Workspace};
use render_worker::plan::Plan;
use render_worker::stages::bin::{self, Bin, list_count};
use render_worker::stages::compose::{self, Compose};
use render_worker::stages::eye::{self, Eye};
use render_worker::stages::interpolate::{self, Interpolate};
use render_worker::stages::layout::{Entry, MISSING, Params, Particle, Splat};
use render_worker::stages::light::{self, Light, texel_count};
use render_worker::stages::map::{self, Map};
use render_worker::stages::particles::{self, Particles, cpu::Inputs};
use render_worker::stages::project::{self, Project};

use crate::compare::worst;
use crate::device::gpu;
use crate::scenes::{FIVE_DEGREES, globe, job, ocean, tile};

/// What every stage makes of one job, by the twins.
struct Twins {
    scene: Scene,
    plan: Plan,
    params: Params,
    value: Vec<f32>,
    accumulated: Vec<f32>,
    particles: Vec<Particle>,
    splats: Vec<Splat>,
    light: Vec<u32>,
    shaded: Vec<Splat>,
    list_ends: Vec<u32>,
    entries: Vec<Entry>,
    picture: Vec<Vec4>,
    image: Vec<u32>,
}

impl Twins {
    fn of(mode: Mode, view: View) -> Self {
        let scene = ocean(FIVE_DEGREES);
        let mut job = job(mode, view);
        job.style.globe_surface = true;
        let plan = Plan::new(&job, &scene, u64::MAX).unwrap();
        let mut params = plan.params_of(plan.parts()[0]);
        let carbon = scene.accumulated.as_ref().unwrap();
        let between = |interval: &render_worker::Interval, weight| {
            let mut between = vec![0.0; scene.grid.cell_count()];
            let (before, after) = (
                interval.before.cells.content(),
                interval.after.cells.content(),
            );
            interpolate::cpu::interpolate(&params, weight, before, after, &mut between);
            between
        };
        let (value, accumulated) = (
            between(&scene.value, params.value_weight),
            between(carbon, params.accumulated_weight),
        );
        let mut particles = vec![Particle::default(); params.particle_count as usize];
        let inputs = Inputs {
            active: &plan.active,
            rows: &plan.rows,
            value: &value,
            accumulated: &accumulated,
            palette: &plan.palette,
        };
        let mut picture = vec![Vec4::ZERO; (params.width * params.height) as usize];
        let (mut splats, mut light, mut shaded) =
            (vec![Splat::default(); particles.len()], vec![], vec![]);
        let (mut list_ends, mut entries) = (vec![], vec![]);
        if mode == Mode::Map {
            map::cpu::map(&params, &value, &plan.palette, &plan.axes, &mut picture);
        } else {
            particles::cpu::generate(&params, &inputs, &mut particles);
            project::cpu::project(&params, &plan.rows, &plan.cols, &particles, &mut splats);
            shaded.clone_from(&splats);
            if params.light_on == 1 {
                light = vec![0; texel_count(&params)];
                light::cpu::deposit(&params, &splats, &mut light);
                light::cpu::prefix(&params, &mut light);
                light::cpu::shade(&params, &light, &mut shaded);
            }
            list_ends = vec![0; list_count(&params) as usize];
            bin::cpu::count(&params, &shaded, &mut list_ends);
            entries = vec![Entry::default(); bin::cpu::scan(&mut list_ends) as usize];
            bin::cpu::scatter(&params, &shaded, &mut list_ends, &mut entries);
            params.entry_capacity = entries.len() as u32;
            eye::cpu::eye(&params, &list_ends, &entries, &mut picture);
        }
        let mut image = vec![0; picture.len()];
        compose::cpu::compose(&params, &picture, scene.domain.content(), &mut image);
        Self {
            scene,
            plan,
            params,
            value,
            accumulated,
            particles,
            splats,
            light,
            shaded,
            list_ends,
            entries,
            picture,
            image,
        }
    }

    fn tile() -> &'static Self {
        static TWINS: OnceLock<Twins> = OnceLock::new();
        TWINS.get_or_init(|| Self::of(Mode::Volume, tile(2, 0, 1, 256)))
    }

    fn globe() -> &'static Self {
        static TWINS: OnceLock<Twins> = OnceLock::new();
        TWINS.get_or_init(|| Self::of(Mode::Volume, globe(-120.0, 10.0, 1.5e7, 160)))
    }

    /// Runs one stage on the GPU on the twins' inputs; what a slot then holds comes back.
    fn run<T: Pod>(
        &self,
        gpu: &Gpu,
        fill: impl FnOnce(&mut FrameContext<'_>),
        record: impl FnOnce(&mut FrameContext<'_>),
        output: Slot,
        len: usize,
    ) -> Vec<T> {
        let mut workspace = Workspace::default();
        let buffer = |cells: &[f32]| gpu.storage("frame", cells).unwrap();
        let pair = |i: &render_worker::Interval| {
            [
                buffer(i.before.cells.content()),
                buffer(i.after.cells.content()),
            ]
        };
        let scene = SceneBuffers {
            value: pair(&self.scene.value),
            accumulated: self.scene.accumulated.as_ref().map(pair),
            domain: gpu.storage("domain", self.scene.domain.content()).unwrap(),
        };
        let mut frame =
            FrameContext::new(gpu, &mut workspace, &self.plan, self.params, scene).unwrap();
        fill(&mut frame);
        record(&mut frame);
        let output = frame.room(output, 4).unwrap();
        frame.recorder.download(&output, len).unwrap()
    }
}

/// The shader agrees with its twin and one with `right` replaced by `wrong` does not.
fn prove(test: &str, source: &str, right: &str, wrong: &str, distance: impl Fn(&Gpu, &str) -> f32) {
    let Some(gpu) = gpu(test) else { return };
    let apart = distance(gpu, source);
    assert!(apart <= 1.0, "{test}: {apart} times the tolerance");
    let faulty = source.replace(right, wrong);
    assert_ne!(faulty, source, "the fault was planted");
    let apart = distance(gpu, &faulty);
    assert!(apart > 1.0, "{test}: the fault stays unseen, {apart}");
}

fn channels(colors: &[Vec4]) -> Vec<f32> {
    colors.iter().flat_map(Vec4::to_array).collect()
}

fn bytes(words: impl IntoIterator<Item = u32>) -> Vec<f32> {
    words
        .into_iter()
        .flat_map(u32::to_le_bytes)
        .map(f32::from)
        .collect()
}

#[test]
fn interpolate_matches_its_twin() {
    let twins = Twins::tile();
    let cells = twins.params.first_cell as usize..twins.params.end_cell as usize;
    for (slot, expected, weight) in [
        (Slot::Value, &twins.value, "params.value_weight"),
        (
            Slot::Accumulated,
            &twins.accumulated,
            "params.accumulated_weight",
        ),
    ] {
        prove(
            "interpolate",
            interpolate::SOURCE,
            weight,
            "0.5",
            |gpu, source| {
                let stage = Interpolate::new(gpu, source);
                let drawn: Vec<f32> = twins.run(
                    gpu,
                    |_| (),
                    |f| stage.record(f).unwrap(),
                    slot,
                    expected.len(),
                );
                // A device may round a product and its sum at once, the twin rounds twice: an error of the largest
                // operand's last bits, which is all there is where two frames cancel.
                let expected = &expected[cells.clone()];
                let largest = expected
                    .iter()
                    .filter(|v| **v > MISSING)
                    .fold(0.0f32, |most, v| most.max(v.abs()));
                worst(
                    &drawn[cells.clone()],
                    expected,
                    4.0 * f32::EPSILON * largest,
                    1e-5,
                )
            },
        );
    }
}

fn particle_numbers(particles: &[Particle]) -> Vec<f32> {
    let numbers = |p: &Particle| {
        let color = p.color.to_le_bytes().map(|byte| f32::from(byte) / 255.0);
        let placed = [
            p.row as f32,
            p.slot as f32,
            p.east,
            p.south,
            p.height_m / 1e5,
            p.mass_kg / 1e9,
            p.depth,
        ];
        placed.into_iter().chain(color)
    };
    particles.iter().flat_map(numbers).collect()
}

#[test]
fn particles_match_their_twin() {
    let twins = Twins::tile();
    let expected = particle_numbers(&twins.particles);
    prove(
        "particles",
        particles::SOURCE,
        "place.x + shaken",
        "place.y + shaken",
        |gpu, source| {
            let stage = Particles::new(gpu, source);
            let drawn: Vec<Particle> = twins.run(
                gpu,
                |f| {
                    f.upload(Slot::Value, &twins.value).unwrap();
                    f.upload(Slot::Accumulated, &twins.accumulated).unwrap();
                },
                |f| stage.record(f).unwrap(),
                Slot::Particles,
                twins.particles.len(),
            );
            // Colours are bytes and may round to a neighbour; a phase of a few turns loses a few bits.
            worst(&particle_numbers(&drawn), &expected, 0.0045, 1e-5)
        },
    );
}

fn splat_numbers(splats: &[Splat]) -> Vec<f32> {
    let numbers = |s: &Splat| {
        // Whole numbers may round to a neighbour: a unit of each is the tolerance, 1e-2.
        let whole = [s.x_sub, s.y_sub, s.light_u, s.light_v].map(|n| n as f32 * 1e-2);
        let real = [s.radius_px, s.tau, s.slice, s.light_depth, s.day];
        let color = s.color.to_le_bytes().map(|byte| f32::from(byte) * 1e-2);
        whole.into_iter().chain(real).chain(color)
    };
    splats.iter().flat_map(numbers).collect()
}

#[test]
fn project_matches_its_twin_on_tiles_and_on_the_globe() {
    let faults = [
        (Twins::tile(), "ground_y - nearest(", "ground_y + nearest("),
        (
            Twins::globe(),
            "1.0 + particle.height_m",
            "1.0 - particle.height_m",
        ),
    ];
    for (twins, right, wrong) in faults {
        let expected = splat_numbers(&twins.splats);
        prove("project", project::SOURCE, right, wrong, |gpu, source| {
            let stage = Project::new(gpu, source);
            let particles = |f: &mut FrameContext<'_>| {
                drop(f.upload(Slot::Particles, &twins.particles).unwrap());
            };
            let drawn: Vec<Splat> = twins.run(
                gpu,
                particles,
                |f| stage.record(f).unwrap(),
                Slot::Splats,
                twins.splats.len(),
            );
            worst(&splat_numbers(&drawn), &expected, 0.0101, 1e-4)
        });
    }
}

#[test]
fn light_matches_its_twin() {
    for twins in [Twins::tile(), Twins::globe()] {
        let expected = bytes(twins.shaded.iter().map(|splat| splat.color));
        let buffer: Vec<f32> = twins.light.iter().map(|&depth| depth as f32).collect();
        prove(
            "light",
            light::SOURCE,
            "exp(-mix(",
            "exp(mix(",
            |gpu, source| {
                let stage = Light::new(gpu, source);
                let splats =
                    |f: &mut FrameContext<'_>| drop(f.upload(Slot::Splats, &twins.splats).unwrap());
                let drawn: Vec<Splat> = twins.run(
                    gpu,
                    splats,
                    |f| stage.record(f).unwrap(),
                    Slot::Splats,
                    twins.splats.len(),
                );
                let light: Vec<u32> = twins.run(
                    gpu,
                    splats,
                    |f| stage.record(f).unwrap(),
                    Slot::Light,
                    twins.light.len(),
                );
                let light: Vec<f32> = light.iter().map(|&depth| depth as f32).collect();
                // A deposit may round to a neighbour; a texel sums up some hundred of them.
                let deposits = worst(&light, &buffer, 40.0, 1e-3);
                deposits.max(worst(
                    &bytes(drawn.iter().map(|splat| splat.color)),
                    &expected,
                    1.01,
                    0.0,
                ))
            },
        );
    }
}

/// The entries of every list in an order that does not depend on arrival.
fn sorted_lists(list_ends: &[u32], entries: &[Entry]) -> Vec<Vec<[u32; 3]>> {
    let starts = std::iter::once(0).chain(list_ends.iter().copied());
    let lists = starts.zip(list_ends).map(|(start, end)| {
        let list = entries
            .get(start as usize..*end as usize)
            .unwrap_or_default();
        let mut list: Vec<_> = list
            .iter()
            .map(|entry| [entry.place, entry.size, entry.color])
            .collect();
        list.sort_unstable();
        list
    });
    lists.collect()
}

#[test]
fn bin_matches_its_twin_exactly() {
    for twins in [Twins::tile(), Twins::globe()] {
        let expected = sorted_lists(&twins.list_ends, &twins.entries);
        prove(
            "bin",
            bin::SOURCE,
            "min((place + radius)",
            "min((place - radius)",
            |gpu, source| {
                let stage = Bin::new(gpu, source);
                let splats =
                    |f: &mut FrameContext<'_>| drop(f.upload(Slot::Splats, &twins.shaded).unwrap());
                let ends: Vec<u32> = twins.run(
                    gpu,
                    splats,
                    |f| stage.record(f).unwrap(),
                    Slot::Counts,
                    twins.list_ends.len(),
                );
                let entries = twins.run(
                    gpu,
                    splats,
                    |f| stage.record(f).unwrap(),
                    Slot::Entries,
                    twins.entries.len(),
                );
                if sorted_lists(&ends, &entries) == expected {
                    0.0
                } else {
                    f32::INFINITY
                }
            },
        );
    }
}

#[test]
fn eye_matches_its_twin_in_every_kernel() {
    let modes =
        [Mode::Volume, Mode::Sprites, Mode::Points].map(|mode| Twins::of(mode, tile(1, 0, 0, 256)));
    for twins in &modes {
        let expected = channels(&twins.picture);
        prove(
            "eye",
            eye::SOURCE,
            "let alpha = 1.0 - exp(-",
            "let alpha = 1.0 - exp(-0.9 * ",
            |gpu, source| {
                let stage = Eye::new(gpu, source);
                let lists = |f: &mut FrameContext<'_>| {
                    f.upload(Slot::Counts, &twins.list_ends).unwrap();
                    f.upload(Slot::Entries, &twins.entries).unwrap();
                };
                let drawn: Vec<Vec4> = twins.run(
                    gpu,
                    lists,
                    |f| stage.record(f).unwrap(),
                    Slot::Picture,
                    expected.len() / 4,
                );
                // Depths are whole parts of 1/4096 and may round to a neighbour, some ten a pixel; exp is good to 1e-6.
                worst(&channels(&drawn), &expected, 3e-3, 0.0)
            },
        );
    }
}

#[test]
fn eye_blends_away_from_the_light_behind_as_its_twin_does() {
    let mut twins = Twins::of(Mode::Volume, globe(-120.0, 10.0, 1.5e7, 96));
    let front = twins.picture.clone();
    twins.params.front_to_back = 0;
    eye::cpu::eye(
        &twins.params,
        &twins.list_ends,
        &twins.entries,
        &mut twins.picture,
    );
    assert!(
        worst(&channels(&front), &channels(&twins.picture), 0.01, 0.0) > 1.0,
        "the order is seen"
    );
    prove(
        "eye",
        eye::SOURCE,
        "params.front_to_back == 1u",
        "params.front_to_back == 0u",
        |gpu, source| {
            let stage = Eye::new(gpu, source);
            let lists = |f: &mut FrameContext<'_>| {
                f.upload(Slot::Counts, &twins.list_ends).unwrap();
                f.upload(Slot::Entries, &twins.entries).unwrap();
            };
            let drawn: Vec<Vec4> = twins.run(
                gpu,
                lists,
                |f| stage.record(f).unwrap(),
                Slot::Picture,
                front.len(),
            );
            worst(&channels(&drawn), &channels(&twins.picture), 3e-3, 0.0)
        },
    );
}

/// Share of numbers farther apart than the tolerance, in units of one in five hundred: an edge may fall to the other
/// side of a pixel.
fn far_apart(a: &[f32], b: &[f32], tolerance: f32) -> f32 {
    let apart = a
        .iter()
        .zip(b)
        .filter(|(a, b)| worst(&[**a], &[**b], tolerance, 0.0) > 1.0)
        .count();
    apart as f32 / a.len() as f32 * 500.0
}

#[test]
fn map_matches_its_twin_on_tiles_and_on_the_globe() {
    for view in [tile(2, 0, 1, 256), globe(-120.0, 10.0, 1.5e7, 160)] {
        let twins = Twins::of(Mode::Map, view);
        let expected = channels(&twins.picture);
        prove(
            "map",
            map::SOURCE,
            "mix(north, south",
            "mix(south, north",
            |gpu, source| {
                let stage = Map::new(gpu, source);
                let value =
                    |f: &mut FrameContext<'_>| drop(f.upload(Slot::Value, &twins.value).unwrap());
                let drawn: Vec<Vec4> = twins.run(
                    gpu,
                    value,
                    |f| stage.record(f).unwrap(),
                    Slot::Picture,
                    expected.len() / 4,
                );
                // A colour may be the next of the palette's 256.
                far_apart(&channels(&drawn), &expected, 0.02)
            },
        );
    }
}

#[test]
fn compose_matches_its_twin() {
    let twins = Twins::globe();
    let expected = bytes(twins.image.iter().copied());
    for (right, wrong) in [
        ("rgb.y << 8u", "rgb.z << 8u"),
        ("0.55 * haze", "0.05 * haze"),
    ] {
        prove("compose", compose::SOURCE, right, wrong, |gpu, source| {
            let stage = Compose::new(gpu, source);
            let picture =
                |f: &mut FrameContext<'_>| drop(f.upload(Slot::Picture, &twins.picture).unwrap());
            let drawn: Vec<u32> = twins.run(
                gpu,
                picture,
                |f| stage.record(f).unwrap(),
                Slot::Image,
                twins.image.len(),
            );
            far_apart(&bytes(drawn), &expected, 1.01)
        });
    }
}
