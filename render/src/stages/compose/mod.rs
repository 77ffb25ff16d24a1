//! Composition: blended colours in, straight-alpha bytes out, alone or in their surroundings: the plain globe, coast
//! lines, terrain, sea, air and night.

pub mod base_map;
pub mod cpu;
pub mod globe;
pub mod in_context;
pub mod params;
pub mod terrain;

use crate::error::RenderError;
use crate::frame_context::{FrameContext, SceneBuffers};
use crate::gpu::{Gpu, Slot};
use crate::stages::layout::GroundAxis;
use crate::stages::params::Uniform;
use crate::stages::params::Uniform::{BaseMap, Context, Grid, TerrainGrid, View};
use crate::stages::variants::Variants;
use crate::timings::{self, Step};

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
pub(crate) fn in_context(is_wanted: bool) -> (&'static str, u32) {
    ("IN_CONTEXT", u32::from(is_wanted))
}

/// The compiled stage.
pub struct Compose {
    compose: Variants,
}

impl Compose {
    /// Compiles `source`, [`SOURCE`] but for tests.
    pub fn new(gpu: &Gpu, source: &str) -> Self {
        Self {
            compose: Variants::new("compose", source, "compose", &READS)
                .compiled(gpu, &[in_context(false)]),
        }
    }

    /// Fills the slot of the image.
    pub fn record(&self, frame: &mut FrameContext<'_>) -> Result<(), RenderError> {
        let picture = frame.room(Slot::Picture, 16)?;
        let image = frame.room(Slot::Image, frame.pixel_count() * 4)?;
        let surroundings = surroundings(frame)?;
        let constants = [in_context(frame.params.in_context)];
        let kernel = self.compose.of(frame.gpu, &constants, frame.features);
        let mut buffers = vec![(1, &picture), (2, &frame.scene.domain), (3, &image)];
        buffers.extend(surroundings.iter().map(|(at, buffer)| (*at, buffer)));
        let groups = frame.params.view.tiles.to_array();
        frame.recorder.dispatch(&kernel, &buffers, groups);
        Ok(())
    }
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
    let coast = if frame.params.context.coast_row_words == 0 {
        frame.room(Slot::Coast, 4)?
    } else {
        if !plan.coast.is_ready() {
            // The device makes and sorts the particles meanwhile.
            frame.recorder.flush();
        }
        let mask = timings::timed(Step::Mask, || &plan.coast[..]);
        frame.upload_of_plan(Slot::Coast, mask)?
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
