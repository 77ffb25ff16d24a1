//! Every stage on the GPU against its CPU twin, and against a shader with a planted fault that must be seen.

use std::sync::OnceLock;

use bytemuck::Pod;
use contract::job::{Mode, RenderJob, Style, View};
use glam::Vec4;
use render_worker::Scene;
use render_worker::frame::{FrameContext, SceneBuffers};
use render_worker::gpu::{Gpu, Slot, Workspace};
use render_worker::passes::splat::{self, HALF_BYTES, Splats, stored_at, unpacked};
use render_worker::passes::{
    self,
    place::{self, Place},
    trails::{self, Trails},
};
use render_worker::plan::Plan;
use render_worker::proof::currents::{self, gyres};
use render_worker::stages::bin::{self, Bin, list_count};
use render_worker::stages::compose::in_context::Surroundings;
use render_worker::stages::compose::{self, Compose};
use render_worker::stages::eye::{self, Eye};
use render_worker::stages::flow::cpu::Field;
use render_worker::stages::flow::{self, Flow};
use render_worker::stages::interpolate::{self, Interpolate};
use render_worker::stages::layout::{
    Active, Entry, KERNEL_CLOUD, MISSING, Params, Particle, Splat, Velocity,
};
use render_worker::stages::light::{self, Light, texel_count};
use render_worker::stages::map::{self, Map};
use render_worker::stages::particles::cpu::Inputs;
use render_worker::stages::{doubt, particles, project};

use crate::compare::worst;
use crate::context::{everything, with_terrain};
use crate::device::{checked_gpu, gpu};
use crate::scenes::{FIVE_DEGREES, clouded, globe, job, ocean, tile};

/// What every stage makes of one job, by the twins.
struct Twins {
    scene: Scene,
    plan: Plan,
    params: Params,
    value: Vec<f32>,
    velocity: Vec<Velocity>,
    splats: Vec<Splat>,
    deposited: Vec<u32>,
    light: Vec<u32>,
    list_ends: Vec<u32>,
    entries: Vec<Entry>,
    picture: Vec<Vec4>,
    image: Vec<u32>,
}

impl Twins {
    fn of(mode: Mode, view: View) -> Self {
        Self::styled(mode, view, ocean(FIVE_DEGREES), |_style| ())
    }

    /// Of an ocean under clouds, in stops of opacity and size and with doubt.
    fn doubted(mode: Mode, view: View) -> Self {
        Self::styled(mode, view, clouded(FIVE_DEGREES), |style| {
            style.transfer.opacity = "-1e-9:0.9,0:0.1,1e-9:0.7".parse().unwrap();
            style.transfer.size = "-1e-9:0.4,0:1,1e-9:0.6".parse().unwrap();
            style.doubt = true;
        })
    }

    /// Currents in trails.
    fn of_flow(view: View) -> Self {
        let mut job = currents::job(view, 1e7);
        job.style.globe_surface = true;
        Self::of_job(&job, gyres(FIVE_DEGREES))
    }

    fn styled(mode: Mode, view: View, scene: Scene, change: impl FnOnce(&mut Style)) -> Self {
        let mut job = job(mode, view);
        job.style.globe_surface = true;
        change(&mut job.style);
        Self::of_job(&job, scene)
    }

    #[expect(clippy::too_many_lines, reason = "the stages in order")]
    fn of_job(job: &RenderJob, scene: Scene) -> Self {
        let mode = job.mode;
        let plan = Plan::new(job, &scene, u64::MAX).unwrap();
        let mut params = plan.params_of(plan.parts()[0]);
        let value = between(&params, Some(&scene.value), params.value_weight);
        let carbon = scene.accumulated.as_ref();
        let accumulated = between(&params, carbon, params.accumulated_weight);
        let northward = between(&params, scene.northward.as_ref(), params.northward_weight);
        let doubt = doubt::between(&params, &scene.value);
        let mut particles =
            vec![Particle::default(); plan.active.len() * params.particles_per_cell as usize];
        let inputs = Inputs {
            active: &plan.active,
            rows: &plan.rows,
            value: &value,
            accumulated: &accumulated,
            palette: &plan.palette,
            doubt: &doubt,
        };
        let mut picture = vec![Vec4::ZERO; (params.width * params.height) as usize];
        let (mut splats, mut deposited, mut light) =
            (vec![Splat::default(); particles.len()], vec![], vec![]);
        let (mut list_ends, mut entries, mut velocity) = (vec![], vec![], vec![]);
        if mode == Mode::Map {
            let inputs = map::cpu::Inputs {
                value: &value,
                palette: &plan.palette,
                axes: &plan.axes,
                doubt: &doubt,
            };
            map::cpu::map(&params, &inputs, &mut picture);
        } else {
            if mode == Mode::Flow {
                velocity = flow::cpu::velocities(&value, &northward);
                drift(&params, &plan, &velocity, &mut particles);
            } else {
                particles::cpu::generate(&params, &inputs, &mut particles);
            }
            project::cpu::project(&params, &plan.rows, &plan.cols, &particles, &mut splats);
            let mut shaded = splats.clone();
            if params.light_on == 1 {
                light = vec![0; texel_count(&params)];
                light::cpu::deposit(&params, &splats, &mut light);
                deposited.clone_from(&light);
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
        if params.in_context == 1 {
            let around = Surroundings {
                domain: scene.domain.content(),
                terrain: scene.terrain.as_ref().unwrap().heights_m(),
                ground_axes: &plan.ground_axes,
                coast: &plan.coast,
            };
            compose::in_context::compose(&params, &picture, &around, &mut image);
        } else {
            compose::cpu::compose(&params, &picture, scene.domain.content(), &mut image);
        }
        Self {
            scene,
            plan,
            params,
            value,
            velocity,
            splats,
            deposited,
            light,
            list_ends,
            entries,
            picture,
            image,
        }
    }

    fn doubted_tile() -> &'static Self {
        static TWINS: OnceLock<Twins> = OnceLock::new();
        TWINS.get_or_init(|| Self::doubted(Mode::Volume, tile(2, 0, 1, 256)))
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
        let output = (output, (len * size_of::<T>()) as u64);
        let [bytes] = self.run_with(gpu, &self.params, fill, record, [output]);
        bytemuck::pod_collect_to_vec(&bytes)
    }

    /// The same with other parameters, for several slots: each with the bytes to read.
    fn run_with<const N: usize>(
        &self,
        gpu: &Gpu,
        params: &Params,
        fill: impl FnOnce(&mut FrameContext<'_>),
        record: impl FnOnce(&mut FrameContext<'_>),
        outputs: [(Slot, u64); N],
    ) -> [Vec<u8>; N] {
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
            northward: self.scene.northward.as_ref().map(pair),
            domain: gpu.storage("domain", self.scene.domain.content()).unwrap(),
            doubts: Some(
                [&self.scene.value.before, &self.scene.value.after]
                    .map(|frame| buffer(frame.doubts().content())),
            ),
            terrain: self
                .scene
                .terrain
                .as_ref()
                .map(|terrain| buffer(terrain.heights_m())),
        };
        let mut frame = FrameContext::new(gpu, &mut workspace, &self.plan, *params, scene).unwrap();
        fill(&mut frame);
        record(&mut frame);
        let buffers = outputs.map(|(slot, bytes)| (frame.room(slot, 4).unwrap(), bytes));
        let parts = std::array::from_fn(|i| (&buffers[i].0, 0, buffers[i].1));
        frame.recorder.download_parts(parts).unwrap()
    }

    /// Splats as a device stored them, in the twins' order.
    fn in_order(&self, seen: &[u8], lit: &[u8]) -> Vec<Splat> {
        let words = |half: &[u8]| bytemuck::pod_collect_to_vec::<u8, [u32; 4]>(half);
        let (seen, lit) = (words(seen), words(lit));
        let each = self.params.particles_per_cell;
        let at = |cell: &Active, k: u32| {
            let down = cell.cell / self.params.cols - self.params.first_row;
            stored_at(&self.params, down, cell.slot, k)
        };
        let active = self.plan.active.iter();
        active
            .flat_map(|cell| (0..each).map(move |k| (cell, k)))
            .map(|(cell, k)| at(cell, k))
            .map(|at| unpacked(seen[at], lit[at], self.params.entry_shift))
            .collect()
    }

    /// Both halves of the stored splats.
    fn stored(&self) -> [(Slot, u64); 2] {
        let bytes = u64::from(self.params.splat_count) * HALF_BYTES;
        [(Slot::Seen, bytes), (Slot::Lit, bytes)]
    }
}

/// The grid at an instant; nothing of nothing.
fn between(params: &Params, interval: Option<&render_worker::Interval>, weight: f32) -> Vec<f32> {
    let Some(interval) = interval else {
        return vec![];
    };
    let (before, after) = (
        interval.before.cells.content(),
        interval.after.cells.content(),
    );
    let mut between = vec![0.0; before.len()];
    interpolate::cpu::interpolate(params, weight, before, after, &mut between);
    between
}

fn drift(params: &Params, plan: &Plan, velocity: &[Velocity], particles: &mut [Particle]) {
    let field = Field {
        params,
        rows: &plan.rows,
        velocity,
    };
    let inputs = flow::cpu::Inputs {
        active: &plan.active,
        field,
        palette: &plan.palette,
    };
    flow::cpu::trails(params, &inputs, particles);
}

/// The shader agrees with its twin and one with `right` replaced by `wrong` does not.
fn prove(test: &str, source: &str, right: &str, wrong: &str, distance: impl Fn(&Gpu, &str) -> f32) {
    let Some(gpu) = gpu(test) else { return };
    let apart = distance(gpu, source);
    assert!(apart <= 1.0, "{test}: {apart} times the tolerance");
    let faulty = source.replace(right, wrong);
    assert_ne!(faulty, source, "the fault was planted");
    let Some(checked) = checked_gpu(test) else {
        return;
    };
    let apart = distance(checked, &faulty);
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
    let params = Params {
        first_cell: 40,
        end_cell: 2500,
        ..twins.params
    };
    let cells = params.first_cell as usize..params.end_cell as usize;
    let expected = &twins.value[cells.clone()];
    // A device may round a product and its sum at once, the twin rounds twice: an error of the largest operand's last
    // bits, which is all there is where two frames cancel.
    let largest = expected
        .iter()
        .filter(|v| **v > MISSING)
        .fold(0.0f32, |most, v| most.max(v.abs()));
    let right = "value_weight);\n";
    prove(
        "interpolate",
        interpolate::SOURCE,
        right,
        "value_weight * 0.5);\n",
        |gpu, source| {
            let stage = Interpolate::new(gpu, source);
            let [drawn] = twins.run_with(
                gpu,
                &params,
                |_| (),
                |f| stage.record(f).unwrap(),
                [(Slot::Value, twins.value.len() as u64 * 4)],
            );
            let drawn: Vec<f32> = bytemuck::pod_collect_to_vec(&drawn);
            worst(
                &drawn[cells.clone()],
                expected,
                4.0 * f32::EPSILON * largest,
                1e-5,
            )
        },
    );
}

/// What a device stores of splats, as far as it is looked at again: those that are in a list or may be.
fn splat_numbers(kernel: u32, splats: &[Splat], expected: &[Splat]) -> Vec<f32> {
    let numbers = |(s, expected): (&Splat, &Splat)| {
        if expected.tau < 1e-3 {
            return [0.0; 12];
        }
        // Whole numbers may round to a neighbour: a unit of each is the tolerance, 1e-2.
        let [x, y, u, v] = [s.x_sub, s.y_sub, s.light_u, s.light_v].map(|n| n as f32 * 1e-2);
        let [r, g, b, a] = s.color.to_le_bytes().map(|byte| f32::from(byte) * 1e-2);
        let radius = s.radius_px * 1e-2 * 16.0;
        // A cloud keeps its mass when its radius is rounded.
        let wider = if kernel == KERNEL_CLOUD {
            s.radius_px / expected.radius_px
        } else {
            1.0
        };
        let depth = s.tau * wider * wider * 1e-2 * 4096.0;
        [x, y, u, v, r, g, b, a, radius, depth, s.slice, s.day]
    };
    splats.iter().zip(expected).flat_map(numbers).collect()
}

#[test]
fn splats_match_their_twins_on_tiles_and_on_the_globe() {
    let faults = [
        (Twins::tile(), "place.x + shaken", "place.y + shaken"),
        (Twins::tile(), "ground_y - nearest(", "ground_y + nearest("),
        (
            Twins::globe(),
            "1.0 + particle.height_m",
            "1.0 - particle.height_m",
        ),
        (Twins::doubted_tile(), "shape >> 16u", "shape >> 17u"),
        (Twins::doubted_tile(), "shape & 0xffffu", "shape & 0x7fffu"),
        (
            Twins::doubted_tile(),
            "doubt_after[cell] - before",
            "doubt_after[cell]",
        ),
        (Twins::doubted_tile(), "PALENESS * doubt", "doubt"),
    ];
    for (twins, right, wrong) in faults {
        let expected = splat_numbers(twins.params.kernel, &twins.splats, &twins.splats);
        prove("splat", splat::SOURCE, right, wrong, |gpu, source| {
            let stage = Splats::of(gpu, source);
            let outputs = twins.stored();
            let [seen, lit] = twins.run_with(
                gpu,
                &twins.params,
                |_| (),
                |f| stage.record(f).unwrap(),
                outputs,
            );
            // Colours are bytes and may round to a neighbour; a phase of a few turns loses a few bits.
            worst(
                &splat_numbers(
                    twins.params.kernel,
                    &twins.in_order(&seen, &lit),
                    &twins.splats,
                ),
                &expected,
                0.0201,
                1e-4,
            )
        });
    }
}

#[test]
fn velocities_match_their_twin() {
    let twins = Twins::of_flow(tile(2, 0, 1, 256));
    let numbers = |velocity: &[Velocity]| -> Vec<f32> {
        let parts = velocity.iter().flat_map(|v| [v.east, v.north]);
        parts.collect()
    };
    let expected = numbers(&twins.velocity);
    assert!(expected.iter().any(|v| *v > 0.5) && expected.contains(&MISSING));
    for (right, wrong) in [
        (
            "north_after[cell], params.northward_weight",
            "north_after[cell], 0.0",
        ),
        (
            "is_missing(east) || is_missing(north)",
            "is_missing(east) && params.rows == 0u",
        ),
    ] {
        prove("velocities", flow::SOURCE, right, wrong, |gpu, source| {
            let stage = Flow::new(gpu, source);
            let drawn: Vec<Velocity> = twins.run(
                gpu,
                |_| (),
                |f| stage.record(f).unwrap(),
                Slot::Velocity,
                twins.velocity.len(),
            );
            worst(&numbers(&drawn), &expected, 1e-5, 1e-5)
        });
    }
}

#[test]
fn drifting_splats_match_their_twins_on_tiles_and_on_the_globe() {
    let faults = [
        ("-drawn.y * params", "drawn.y * params"),
        ("0.5 * share * here.rate", "share * here.rate"),
        ("params.flow_cycle + u32(turn)", "params.flow_cycle"),
        ("x = (x % cols + cols) % cols;", ""),
        ("min(trail.open, here.open)", "trail.open"),
    ];
    let views = [tile(2, 0, 1, 256), globe(-178.0, 10.0, 1.5e7, 160)];
    for view in views {
        let twins = Twins::of_flow(view);
        let expected = splat_numbers(twins.params.kernel, &twins.splats, &twins.splats);
        let drawn = twins.splats.iter().filter(|splat| splat.tau > 0.05).count();
        assert!(drawn > 1000, "{drawn} dots");
        for (right, wrong) in faults {
            prove("trails", trails::SOURCE, right, wrong, |gpu, source| {
                let stage = Trails::of(gpu, source);
                let given = |f: &mut FrameContext<'_>| {
                    drop(f.upload(Slot::Velocity, &twins.velocity).unwrap());
                };
                let [seen, lit] = twins.run_with(
                    gpu,
                    &twins.params,
                    given,
                    |f| stage.record(f).unwrap(),
                    twins.stored(),
                );
                let drawn = splat_numbers(
                    twins.params.kernel,
                    &twins.in_order(&seen, &lit),
                    &twins.splats,
                );
                // A way of some hundred cells adds up what is rounded on it: two subpixels.
                worst(&drawn, &expected, 0.0201, 1e-4)
            });
        }
    }
}

#[test]
fn every_function_of_a_particle_is_in_the_pass_that_is_tested() {
    for functions in [
        interpolate::FUNCTIONS,
        particles::FUNCTIONS,
        doubt::FUNCTIONS,
        project::FUNCTIONS,
        light::DEPOSIT_FUNCTIONS,
        bin::FUNCTIONS,
    ] {
        assert!(splat::SOURCE.contains(functions));
    }
    for functions in [flow::FUNCTIONS, project::FUNCTIONS, bin::FUNCTIONS] {
        assert!(trails::SOURCE.contains(functions));
    }
    assert!(place::SOURCE.contains(light::SHADE_FUNCTIONS));
    assert!(
        eye::SOURCE.contains(compose::FUNCTIONS) && compose::SOURCE.contains(compose::FUNCTIONS)
    );
    for source in [eye::SOURCE_IN_CONTEXT, compose::SOURCE_IN_CONTEXT] {
        assert!(source.contains(compose::FUNCTIONS_IN_CONTEXT));
    }
}

#[test]
fn light_is_given_and_lists_are_counted_as_the_twins_do() {
    for twins in [Twins::tile(), Twins::globe()] {
        let expected: Vec<f32> = twins.deposited.iter().map(|&depth| depth as f32).collect();
        let (shared, unshared) = (splat::SOURCE, passes::unshared(splat::SOURCE));
        for (source, right, wrong) in [
            (shared, "splat.light_depth - behind", "splat.light_depth"),
            (
                shared,
                "atomicAdd(&counts[key & ~LIST_KEY], ",
                "atomicAdd(&counts[key & ~LIST_KEY], 1u + ",
            ),
            (
                &unshared,
                "atomicAdd(&counts[list], 1u)",
                "atomicMax(&counts[list], 1u)",
            ),
        ] {
            prove("splat", source, right, wrong, |gpu, source| {
                let stage = Splats::of(gpu, source);
                let lists = u64::from(list_count(&twins.params)) * 4;
                let [first, second] = twins.stored();
                let [seen, lit, light, counts] = twins.run_with(
                    gpu,
                    &twins.params,
                    |_| (),
                    |f| stage.record(f).unwrap(),
                    [
                        first,
                        second,
                        (Slot::Light, expected.len() as u64 * 4),
                        (Slot::Counts, lists),
                    ],
                );
                let mut own = vec![0; list_count(&twins.params) as usize];
                bin::cpu::count(&twins.params, &twins.in_order(&seen, &lit), &mut own);
                if own != bytemuck::pod_collect_to_vec::<u8, u32>(&counts) {
                    return f32::INFINITY;
                }
                let light: Vec<u32> = bytemuck::pod_collect_to_vec(&light);
                let light: Vec<f32> = light.iter().map(|&depth| depth as f32).collect();
                // A deposit may round to a neighbour; a texel sums up some hundred of them.
                worst(&light, &expected, 40.0, 1e-3)
            });
        }
    }
}

#[test]
fn the_depth_above_each_slice_matches_its_twin_exactly() {
    for twins in [Twins::tile(), Twins::globe()] {
        let expected: Vec<f32> = twins.light.iter().map(|&depth| depth as f32).collect();
        for (entry, right, wrong) in [
            (light::SEGMENTED, "min(own[j], DARK)", "min(own[j], 1u)"),
            (
                light::STRAIGHT,
                "min(light[at], DARK)",
                "min(light[at], 1u)",
            ),
        ] {
            prove("light", light::SOURCE, right, wrong, |gpu, source| {
                let stage = Light::of(gpu, source, entry);
                let given = |f: &mut FrameContext<'_>| {
                    drop(f.upload(Slot::Light, &twins.deposited).unwrap());
                };
                let drawn: Vec<u32> = twins.run(
                    gpu,
                    given,
                    |f| stage.record(f).unwrap(),
                    Slot::Light,
                    expected.len(),
                );
                let drawn: Vec<f32> = drawn.iter().map(|&depth| depth as f32).collect();
                worst(&drawn, &expected, 0.5, 0.0)
            });
        }
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

/// Do two sets of lists hold the same entries, their colours but for the last bit?
fn same_lists(a: &[Vec<[u32; 3]>], b: &[Vec<[u32; 3]>]) -> bool {
    let same_color = |a: u32, b: u32| {
        let channels = a.to_le_bytes().into_iter().zip(b.to_le_bytes());
        channels.into_iter().all(|(a, b)| a.abs_diff(b) <= 1) && a >> 24 == b >> 24
    };
    let same = |a: &[u32; 3], b: &[u32; 3]| a[..2] == b[..2] && same_color(a[2], b[2]);
    a.len() == b.len()
        && a.iter()
            .zip(b)
            .all(|(a, b)| a.len() == b.len() && a.iter().zip(b).all(|(a, b)| same(a, b)))
}

#[test]
#[expect(clippy::too_many_lines, reason = "two passes and a scan in one chain")]
fn the_lists_hold_every_stored_splat_once_and_in_its_light() {
    for twins in [Twins::tile(), Twins::globe()] {
        let distance = |gpu: &Gpu, bin_source: &str, place_source: &str| {
            let splats = Splats::of(gpu, splat::SOURCE);
            let light = Light::new(gpu);
            let bin = Bin::new(gpu, bin_source);
            let place = Place::of(gpu, place_source);
            let mut params = twins.params;
            // Rounding may put a few more splats into a list than the twins have.
            params.entry_capacity += params.entry_capacity / 8 + 1024;
            let [first, second] = twins.stored();
            let [seen, lit, above, ends, entries] = twins.run_with(
                gpu,
                &params,
                |_| (),
                |f| {
                    splats.record(f).unwrap();
                    light.record(f).unwrap();
                    bin.record(f).unwrap();
                    place.record(f).unwrap();
                },
                [
                    first,
                    second,
                    (Slot::Light, twins.light.len() as u64 * 4),
                    (Slot::Counts, u64::from(list_count(&params)) * 4),
                    (
                        Slot::Entries,
                        u64::from(params.entry_capacity) * size_of::<Entry>() as u64,
                    ),
                ],
            );
            let mut splats = twins.in_order(&seen, &lit);
            let above: Vec<u32> = bytemuck::pod_collect_to_vec(&above);
            light::cpu::shade(&params, &above, &mut splats);
            let mut own_ends = vec![0; list_count(&params) as usize];
            bin::cpu::count(&params, &splats, &mut own_ends);
            let mut own = vec![Entry::default(); bin::cpu::scan(&mut own_ends) as usize];
            bin::cpu::scatter(&params, &splats, &mut own_ends, &mut own);
            assert!(!own.is_empty());
            let ends: Vec<u32> = bytemuck::pod_collect_to_vec(&ends);
            let entries: Vec<Entry> = bytemuck::pod_collect_to_vec(&entries);
            let same = own_ends == ends
                && same_lists(
                    &sorted_lists(&ends, &entries),
                    &sorted_lists(&own_ends, &own),
                );
            if same { 0.0 } else { f32::INFINITY }
        };
        prove(
            "bin",
            bin::SOURCE,
            "counts[at] += block_sums[block]",
            "counts[at] += block_sums[block] + 1u",
            |gpu, source| distance(gpu, source, place::SOURCE),
        );
        let (shared, unshared) = (place::SOURCE, passes::unshared(place::SOURCE));
        for (source, right, wrong) in [
            (shared, "vec2(exp(-depth), 1.0)", "vec2(exp(depth), 1.0)"),
            (
                shared,
                "atomicAdd(&counts[tag - 1u], atomicLoad",
                "atomicAdd(&counts[tag - 1u], 1u + atomicLoad",
            ),
            (
                &unshared,
                "return atomicAdd(&counts[list], 1u)",
                "return atomicAdd(&counts[list], 2u)",
            ),
        ] {
            prove("place", source, right, wrong, |gpu, source| {
                distance(gpu, bin::SOURCE, source)
            });
        }
    }
}

/// The image that the eye makes of the twins' lists on the GPU, as bytes.
fn eye_image(twins: &Twins, gpu: &Gpu, source: &str, entry: &'static str) -> Vec<f32> {
    let stage = Eye::of(gpu, source, eye::SOURCE_IN_CONTEXT, entry);
    let lists = |f: &mut FrameContext<'_>| {
        f.upload(Slot::Counts, &twins.list_ends).unwrap();
        f.upload(Slot::Entries, &twins.entries).unwrap();
    };
    let drawn: Vec<u32> = twins.run(
        gpu,
        lists,
        |f| stage.record(f).unwrap(),
        Slot::Image,
        twins.image.len(),
    );
    bytes(drawn)
}

#[test]
fn eye_matches_its_twin_in_every_kernel() {
    let modes =
        [Mode::Volume, Mode::Sprites, Mode::Points].map(|mode| Twins::of(mode, tile(1, 0, 0, 256)));
    for twins in &modes {
        let expected = bytes(twins.image.iter().copied());
        for entry in [eye::SHARED, eye::ALONE] {
            prove(
                "eye",
                eye::SOURCE,
                "let alpha = 1.0 - exp(-",
                "let alpha = 1.0 - exp(-0.9 * ",
                // Depths are whole parts of 1/4096 and may round to a neighbour, some ten a pixel; exp is good to 1e-6.
                |gpu, source| far_apart(&eye_image(twins, gpu, source, entry), &expected, 1.01),
            );
        }
    }
}

#[test]
fn pixels_that_work_alone_and_pixels_that_share_come_to_the_same_picture() {
    for mode in [Mode::Volume, Mode::Sprites, Mode::Points] {
        let twins = Twins::of(mode, tile(1, 0, 0, 256));
        prove(
            "eye",
            eye::SOURCE,
            "rgb * amount, amount)",
            "rgb * amount, amount + 1u)",
            |gpu, source| {
                let [shared, alone] =
                    [eye::SHARED, eye::ALONE].map(|entry| eye_image(&twins, gpu, source, entry));
                // A device may join a product and a sum in one of the two.
                far_apart(&shared, &alone, 1.01)
            },
        );
    }
}

#[test]
fn what_lies_behind_a_covered_tile_is_left_out_and_not_missed() {
    let twins = Twins::styled(
        Mode::Volume,
        tile(1, 0, 0, 256),
        ocean(FIVE_DEGREES),
        |style| {
            style.optical_depth = 60.0;
        },
    );
    let covered = twins.picture.iter().filter(|pixel| pixel.w > 0.9997);
    assert!(covered.count() > 1000);
    let expected = bytes(twins.image.iter().copied());
    // Lists of this coarse scene are short.
    let asking = eye::SOURCE.replace("WORTH_ASKING = 1024u", "WORTH_ASKING = 4u");
    prove(
        "eye",
        &asking,
        "{ is_open = 1u; }",
        "{ is_open = 0u; }",
        |gpu, source| {
            let shared = eye_image(&twins, gpu, source, eye::SHARED);
            far_apart(&shared, &expected, 1.01)
        },
    );
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
    let domain = twins.scene.domain.content();
    compose::cpu::compose(&twins.params, &twins.picture, domain, &mut twins.image);
    let expected = bytes(twins.image.iter().copied());
    prove(
        "eye",
        eye::SOURCE,
        "params.front_to_back == 1u",
        "params.front_to_back == 0u",
        |gpu, source| {
            let image = eye_image(&twins, gpu, source, eye::SHARED);
            far_apart(&image, &expected, 1.01)
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
    let views = [tile(2, 0, 1, 256), globe(-120.0, 10.0, 1.5e7, 160)];
    let plain = views.map(|view| {
        (
            Twins::of(Mode::Map, view),
            "mix(north, south",
            "mix(south, north",
        )
    });
    let [on_tile, on_globe] = views.map(|view| Twins::doubted(Mode::Map, view));
    let doubted = [
        (on_tile, "* doubt * line_at(pixel)", "* doubt"),
        (
            on_globe,
            "palette[256u + at] & 0xffffu",
            "palette[256u + at] & 0x7fffu",
        ),
    ];
    for (twins, right, wrong) in plain.into_iter().chain(doubted) {
        let expected = channels(&twins.picture);
        prove("map", map::SOURCE, right, wrong, |gpu, source| {
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
        });
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

#[test]
fn surroundings_match_their_twin_on_tiles_and_on_the_globe() {
    let views = [tile(1, 0, 0, 256), globe(-120.0, 10.0, 1.5e7, 160)];
    let faults = [
        // The slope of the terrain, its height, the night, the coast, the sea above the floor.
        ("2.0 * z[at + 4]", "2.0 * z[at - 4]"),
        ("if (height_m < 0.0)", "if (height_m < 1000.0)"),
        ("mix(NIGHT, 1.0,", "mix(1.0, NIGHT,"),
        ("place.x % 4u * 8u", "(3u - place.x % 4u) * 8u"),
        ("exp(params.seabed_per_m", "exp(-params.seabed_per_m"),
    ];
    for view in views {
        let twins = Twins::of_job(&everything(Mode::Map, view), with_terrain(FIVE_DEGREES));
        assert_eq!(twins.params.in_context, 1);
        let expected = bytes(twins.image.iter().copied());
        for (right, wrong) in faults {
            let distance = |gpu: &Gpu, source: &str| {
                let stage = Compose::of(gpu, compose::SOURCE, source);
                let picture = |f: &mut FrameContext<'_>| {
                    drop(f.upload(Slot::Picture, &twins.picture).unwrap());
                };
                let drawn: Vec<u32> = twins.run(
                    gpu,
                    picture,
                    |f| stage.record(f).unwrap(),
                    Slot::Image,
                    twins.image.len(),
                );
                far_apart(&bytes(drawn), &expected, 1.01)
            };
            let source = compose::SOURCE_IN_CONTEXT;
            prove("surroundings", source, right, wrong, distance);
        }
    }
}

#[test]
fn the_eye_composes_in_surroundings_as_its_twin_does() {
    for view in [tile(1, 0, 0, 256), globe(-120.0, 10.0, 1.5e7, 160)] {
        let twins = Twins::of_job(&everything(Mode::Volume, view), with_terrain(FIVE_DEGREES));
        let expected = bytes(twins.image.iter().copied());
        let distance = |gpu: &Gpu, source: &str, entry| {
            let stage = Eye::of(gpu, eye::SOURCE, source, entry);
            let lists = |f: &mut FrameContext<'_>| {
                f.upload(Slot::Counts, &twins.list_ends).unwrap();
                f.upload(Slot::Entries, &twins.entries).unwrap();
            };
            let drawn: Vec<u32> = twins.run(
                gpu,
                lists,
                |f| stage.record(f).unwrap(),
                Slot::Image,
                twins.image.len(),
            );
            far_apart(&bytes(drawn), &expected, 1.01)
        };
        let (right, wrong) = ("color += ground_color", "color -= ground_color");
        for entry in [eye::SHARED, eye::ALONE] {
            prove(
                "eye",
                eye::SOURCE_IN_CONTEXT,
                right,
                wrong,
                |gpu, source| distance(gpu, source, entry),
            );
        }
    }
}

#[test]
fn splats_in_the_sea_and_in_the_night_match_their_twins() {
    let twins = Twins::of_job(
        &everything(Mode::Volume, tile(1, 0, 0, 256)),
        with_terrain(FIVE_DEGREES),
    );
    let expected = splat_numbers(twins.params.kernel, &twins.splats, &twins.splats);
    for (right, wrong) in [
        ("exp(-params.sea_per_m", "exp(-0.5 * params.sea_per_m"),
        (
            "day_at(normal_of(particle))",
            "day_at(-normal_of(particle))",
        ),
    ] {
        prove("splat", splat::SOURCE, right, wrong, |gpu, source| {
            let stage = Splats::of(gpu, source);
            let [seen, lit] = twins.run_with(
                gpu,
                &twins.params,
                |_| (),
                |f| stage.record(f).unwrap(),
                twins.stored(),
            );
            worst(
                &splat_numbers(
                    twins.params.kernel,
                    &twins.in_order(&seen, &lit),
                    &twins.splats,
                ),
                &expected,
                0.0201,
                1e-4,
            )
        });
    }
}
