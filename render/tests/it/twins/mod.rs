//! Every stage on the GPU against its CPU twin, and against a shader with a planted fault that must be seen.

mod drifting;
mod interpolation;
mod isolines_drawn;
mod lighting;
mod lists;
mod picture;
mod seeing;
mod splats;

use std::sync::OnceLock;

use bytemuck::Pod;
use contract::base_map::Background;
use contract::job::{Mode, RenderJob, Style, View};
use glam::Vec4;
use render::frame_context::FrameContext;
use render::gpu::{Gpu, Slot, Workspace};
use render::passes::splat::unpacked;
use render::plan::Plan;
use render::playback::Playback;
use render::stages::bin;
use render::stages::compose::in_context::Surroundings;
use render::stages::eye::cpu::Hiding;
use render::stages::flow::cpu::VectorField;
use render::stages::flow::{self};
use render::stages::layout::{
    Active, COVERED, Entry, KERNEL_CLOUD, LIGHT_OWN, Particle, Splat, Velocity,
};
use render::stages::light;
use render::stages::map::{self};
use render::stages::params::Params;
use render::stages::particles::cpu::Inputs;
use render::stages::sizes::{HALF_BYTES, list_count, stored_at, texel_count};
use render::stages::{compose, eye, interpolate, isolines, particles, project, uncertainty};
use render::{Backend, Renderer, Scene};
use render_proof::currents::{self, gyres};

use crate::compare::worst;
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
    lines: Vec<u32>,
    picture: Vec<Vec4>,
    image: Vec<u32>,
}

impl Twins {
    fn of(mode: Mode, view: View) -> Self {
        Self::styled(mode, view, ocean(FIVE_DEGREES), |_style| ())
    }

    /// Of an ocean under clouds, in stops of opacity and size and with uncertainty.
    fn uncertain(mode: Mode, view: View) -> Self {
        Self::styled(mode, view, clouded(FIVE_DEGREES), |style| {
            style.transfer.opacity = "-1e-9:0.9,0:0.1,1e-9:0.7".parse().unwrap();
            style.transfer.size = "-1e-9:0.4,0:1,1e-9:0.6".parse().unwrap();
            style.uncertainty = true;
        })
    }

    /// Of blocks of four cells, those at coasts covered in part.
    fn joined(mode: Mode, view: View) -> Self {
        let blocks = render::pyramid::coarser(&ocean(FIVE_DEGREES)).unwrap();
        let twins = Self::of_job(&job(mode, view), blocks);
        let domain = twins.scene.domain.content();
        assert!(domain.iter().any(|covered| (1..COVERED).contains(covered)));
        twins
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
        let mut plan = Plan::new(job, &scene, u64::MAX).unwrap();
        if let (Some(alone), Some(vector)) = (job.trails_alone(), &scene.trails) {
            let renderer = Renderer::new(Backend::Cpu).unwrap();
            plan.lay_trails(&renderer.render(&alone, vector).unwrap());
        }
        let mut params = plan.params_of(plan.parts()[0]);
        let value = between(&params, Some(&scene.value), params.values.weight);
        let carbon = scene.accumulated.as_ref();
        let accumulated = between(&params, carbon, params.values.accumulated_weight);
        let northward = between(
            &params,
            scene.northward.as_ref(),
            params.values.northward_weight,
        );
        let uncertainty = uncertainty::between(&params, &scene.value);
        let mut particles =
            vec![Particle::default(); plan.active.len() * params.cells.particles_per_cell as usize];
        let inputs = Inputs {
            active: &plan.active,
            rows: &plan.rows,
            value: &value,
            accumulated: &accumulated,
            palette: &plan.palette,
            uncertainty: &uncertainty,
            domain: scene.domain.content(),
        };
        let mut picture = vec![Vec4::ZERO; params.view.size_px.element_product() as usize];
        let (mut splats, mut deposited, mut light) =
            (vec![Splat::default(); particles.len()], vec![], vec![]);
        let (mut list_ends, mut entries, mut velocity) = (vec![], vec![], vec![]);
        if mode == Mode::Map {
            let inputs = map::cpu::Inputs {
                value: &value,
                palette: &plan.palette,
                axes: &plan.axes,
                uncertainty: &uncertainty,
                domain: scene.domain.content(),
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
            if params.lighting.mode == LIGHT_OWN {
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
            params.lists.entry_capacity = entries.len() as u32;
            let hiding = Hiding::of(&plan);
            eye::cpu::eye(&params, &list_ends, &entries, hiding, &mut picture);
        }
        let mut lines = vec![];
        if params.context.lines_on == 1 {
            lines.resize(picture.len(), 0);
            let inputs = isolines::cpu::Inputs::of(&plan, &scene, &value);
            isolines::cpu::draw_lines(&params, &inputs, &mut lines);
        }
        let mut image = vec![0; picture.len()];
        if params.in_context {
            let around = Surroundings::of(&plan, &scene, &lines);
            compose::in_context::compose(&params, &picture, &around, &mut image);
        } else {
            compose::cpu::compose(&params, &picture, &mut image);
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
            lines,
            picture,
            image,
        }
    }

    fn uncertain_tile() -> &'static Self {
        static TWINS: OnceLock<Twins> = OnceLock::new();
        TWINS.get_or_init(|| Self::uncertain(Mode::Volume, tile(2, 0, 1, 256)))
    }

    fn tile() -> &'static Self {
        static TWINS: OnceLock<Twins> = OnceLock::new();
        TWINS.get_or_init(|| Self::of(Mode::Volume, tile(2, 0, 1, 256)))
    }

    fn globe() -> &'static Self {
        static TWINS: OnceLock<Twins> = OnceLock::new();
        TWINS.get_or_init(|| Self::of(Mode::Volume, globe(-120.0, 10.0, 1.5e7, 160)))
    }

    /// A globe with all that lies below and beside its particles.
    fn on_base_map() -> Self {
        let mut job = job(Mode::Volume, globe(-95.0, 35.0, 1.5e7, 160));
        job.style.globe_surface = true;
        let context = &mut job.style.context;
        (context.coastlines, context.borders, context.sea_floor) = (true, true, true);
        context.background = Background::Sky;
        Self::of_job(&job, ocean(FIVE_DEGREES))
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
        let scene = Playback::upload(gpu, &self.scene).unwrap();
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
        let each = self.params.cells.particles_per_cell;
        let at = |cell: &Active, k: u32| {
            let down = cell.cell / self.params.grid.cols - self.params.cells.first_row;
            stored_at(&self.params, down, cell.slot, k)
        };
        let active = self.plan.active.iter();
        active
            .flat_map(|cell| (0..each).map(move |k| (cell, k)))
            .map(|(cell, k)| at(cell, k))
            .map(|at| unpacked(seen[at], lit[at], &self.params.lists))
            .collect()
    }

    /// Both halves of the stored splats.
    fn stored(&self) -> [(Slot, u64); 2] {
        let bytes = u64::from(self.params.cells.splat_count) * HALF_BYTES;
        [(Slot::Seen, bytes), (Slot::Lit, bytes)]
    }
}

/// The grid at an instant; nothing of nothing.
fn between(params: &Params, interval: Option<&render::Interval>, weight: f32) -> Vec<f32> {
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
    let field = VectorField {
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
    assert!(
        apart > 1.0,
        "{test}: '{wrong}' stays unseen, {apart} times the tolerance"
    );
}

fn channels(colours: &[Vec4]) -> Vec<f32> {
    colours.iter().flat_map(Vec4::to_array).collect()
}

fn bytes(words: impl IntoIterator<Item = u32>) -> Vec<f32> {
    words
        .into_iter()
        .flat_map(u32::to_le_bytes)
        .map(f32::from)
        .collect()
}

/// What a device stores of splats, as far as it is looked at again: those that are in a list or may be.
fn splat_numbers(kernel: u32, splats: &[Splat], expected: &[Splat]) -> Vec<f32> {
    let numbers = |(s, expected): (&Splat, &Splat)| {
        if expected.tau < 1e-3 {
            return [0.0; 12];
        }
        // Whole numbers may round to a neighbour: a unit of each is the tolerance, 1e-2.
        let [x, y, u, v] = [s.x_sub, s.y_sub, s.light_u, s.light_v].map(|n| n as f32 * 1e-2);
        let [r, g, b, a] = s.colour.to_le_bytes().map(|byte| f32::from(byte) * 1e-2);
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
