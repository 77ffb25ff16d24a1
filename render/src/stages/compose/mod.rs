//! Composition: blended colours in, straight-alpha bytes out, alone or in their surroundings: the plain globe, coast
//! lines, terrain, sea, air and night.

pub mod base_map;
pub mod cpu;
pub mod globe;
pub mod in_context;
pub mod params;
pub mod terrain;

use std::sync::OnceLock;

use crate::error::RenderError;
use crate::frame_context::{FrameContext, SceneBuffers};
use crate::gpu::{Gpu, Kernel, Slot};
use crate::stages::layout::GroundAxis;
use crate::stages::params::Uniform;
use crate::stages::params::Uniform::{BaseMap, Context, Grid, TerrainGrid, View};

/// The function that the eye runs for its own pixels.
pub const FUNCTIONS: &str = concat!(
    include_str!("../sphere.wgsl"),
    include_str!("../water.wgsl"),
    include_str!("globe.wgsl"),
    include_str!("terrain.wgsl"),
    include_str!("in_context/ceiling.wgsl"),
    include_str!("in_context.wgsl"),
    include_str!("composed.wgsl")
);

/// The shader.
pub const SOURCE: &str = concat!(
    include_str!("../prelude.wgsl"),
    include_str!("../sphere.wgsl"),
    include_str!("../water.wgsl"),
    include_str!("globe.wgsl"),
    include_str!("terrain.wgsl"),
    include_str!("in_context/ceiling.wgsl"),
    include_str!("in_context.wgsl"),
    include_str!("composed.wgsl"),
    include_str!("compose.wgsl")
);

/// What [`FUNCTIONS`] read.
pub(crate) const READS: [Uniform; 5] = [View, Grid, Context, TerrainGrid, BaseMap];

/// The constant of pictures in their surroundings.
pub(crate) fn in_context(is_wanted: bool) -> (&'static str, f64) {
    ("IN_CONTEXT", f64::from(u8::from(is_wanted)))
}

/// The compiled stage.
pub struct Compose {
    source: String,
    plain: Kernel,
    /// Compiled when it is first wanted.
    in_context: OnceLock<Kernel>,
}

impl Compose {
    /// Compiles `source`, [`SOURCE`] but for tests.
    pub fn new(gpu: &Gpu, source: &str) -> Self {
        Self {
            source: source.to_owned(),
            plain: compiled(gpu, source, false),
            in_context: OnceLock::new(),
        }
    }

    /// Fills the slot of the image.
    pub fn record(&self, frame: &mut FrameContext<'_>) -> Result<(), RenderError> {
        let picture = frame.room(Slot::Picture, 16)?;
        let image = frame.room(Slot::Image, frame.pixel_count() * 4)?;
        let surroundings = surroundings(frame)?;
        let kernel = if frame.params.in_context {
            let compiled = || compiled(frame.gpu, &self.source, true);
            self.in_context.get_or_init(compiled)
        } else {
            &self.plain
        };
        let mut buffers = vec![(1, &picture), (2, &frame.scene.domain), (3, &image)];
        buffers.extend(surroundings.iter().map(|(at, buffer)| (*at, buffer)));
        let groups = frame.params.view.tiles.to_array();
        frame.recorder.dispatch(kernel, &buffers, groups);
        Ok(())
    }
}

fn compiled(gpu: &Gpu, source: &str, is_in_context: bool) -> Kernel {
    let constants = [in_context(is_in_context)];
    gpu.variant("compose", source, "compose", &constants)
        .reading(&READS)
}

/// What the functions for surroundings read, by their bindings: terrain, ground axes, mask, isolines and trails.
pub(crate) fn surroundings(
    frame: &mut FrameContext<'_>,
) -> Result<[(u32, wgpu::Buffer); 5], RenderError> {
    let plan = frame.plan;
    // Buffers of what is not drawn are bound but never read.
    let axes = if plan.ground_axes.is_empty() {
        frame.room(Slot::GroundAxes, size_of::<GroundAxis>() as u64)?
    } else {
        frame.upload_of_plan(Slot::GroundAxes, &plan.ground_axes)?
    };
    let coast = if plan.coast.is_empty() {
        frame.room(Slot::Coast, 4)?
    } else {
        frame.upload_of_plan(Slot::Coast, &plan.coast[..])?
    };
    let terrain = if frame.params.context.sea_floor_on == 1 {
        frame.sea_floor()?
    } else {
        let SceneBuffers {
            terrain, domain, ..
        } = &frame.scene;
        terrain.as_ref().unwrap_or(domain).clone()
    };
    let lines = frame.room(Slot::Isolines, 4)?;
    let trails = if plan.trails.is_empty() {
        frame.room(Slot::Trails, 4)?
    } else {
        frame.upload_of_plan(Slot::Trails, &plan.trails)?
    };
    Ok([
        (5, terrain),
        (6, axes),
        (7, coast),
        (11, lines),
        (12, trails),
    ])
}
