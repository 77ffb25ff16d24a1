//! Composition: blended colours in, straight-alpha bytes over the plain globe, where one is wanted, out; or in their
//! surroundings: coast lines, terrain, sea and night.

pub mod cpu;
pub mod in_context;
pub mod terrain;

use std::sync::OnceLock;

use crate::error::RenderError;
use crate::frame_context::FrameContext;
use crate::gpu::{Gpu, Kernel, Slot};
use crate::stages::layout::GroundAxis;

/// The function that the eye runs for its own pixels.
pub const FUNCTIONS: &str = concat!(
    include_str!("../sphere.wgsl"),
    include_str!("globe.wgsl"),
    include_str!("over_globe.wgsl")
);

/// The same function for pictures in their surroundings: kernels of their own, so that others pay nothing for it.
pub const FUNCTIONS_IN_CONTEXT: &str = concat!(
    include_str!("../sphere.wgsl"),
    include_str!("globe.wgsl"),
    include_str!("terrain.wgsl"),
    include_str!("in_context.wgsl")
);

/// The shader.
pub const SOURCE: &str = concat!(
    include_str!("../prelude.wgsl"),
    include_str!("../sphere.wgsl"),
    include_str!("globe.wgsl"),
    include_str!("over_globe.wgsl"),
    include_str!("compose.wgsl")
);

/// The shader for pictures in their surroundings.
pub const SOURCE_IN_CONTEXT: &str = concat!(
    include_str!("../prelude.wgsl"),
    include_str!("../sphere.wgsl"),
    include_str!("globe.wgsl"),
    include_str!("terrain.wgsl"),
    include_str!("in_context.wgsl"),
    include_str!("compose.wgsl")
);

/// The compiled stage.
pub struct Compose {
    plain: Kernel,
    source_in_context: String,
    /// Compiled when it is first wanted.
    in_context: OnceLock<Kernel>,
}

impl Compose {
    /// Compiles `source`, [`SOURCE`] but for tests; [`SOURCE_IN_CONTEXT`] when it is wanted.
    pub fn new(gpu: &Gpu, source: &str) -> Self {
        Self::of(gpu, source, SOURCE_IN_CONTEXT)
    }

    /// The same with another shader for pictures in their surroundings.
    pub fn of(gpu: &Gpu, source: &str, source_in_context: &str) -> Self {
        Self {
            plain: gpu.kernel("compose", source, "compose"),
            source_in_context: source_in_context.to_owned(),
            in_context: OnceLock::new(),
        }
    }

    /// Fills the slot of the image.
    pub fn record(&self, frame: &mut FrameContext<'_>) -> Result<(), RenderError> {
        let picture = frame.room(Slot::Picture, 16)?;
        let image = frame.room(Slot::Image, frame.pixel_count() * 4)?;
        let groups = [frame.params.tiles_x, frame.params.tiles_y];
        if frame.params.in_context == 1 {
            let [terrain, axes, coast] = surroundings(frame)?;
            let gpu = frame.gpu;
            let kernel = self
                .in_context
                .get_or_init(|| gpu.kernel("compose", &self.source_in_context, "compose"));
            let buffers = [
                (0, &frame.params_buffer),
                (1, &picture),
                (2, &frame.domain),
                (3, &image),
                (5, &terrain),
                (6, &axes),
                (7, &coast),
            ];
            frame.recorder.dispatch(kernel, &buffers, groups);
            return Ok(());
        }
        let buffers = [
            (0, &frame.params_buffer),
            (1, &picture),
            (2, &frame.domain),
            (3, &image),
        ];
        frame.recorder.dispatch(&self.plain, &buffers, groups);
        Ok(())
    }
}

/// What the functions for surroundings read: terrain, ground axes and coast mask, in the order of their bindings from 5 on.
pub(crate) fn surroundings(frame: &mut FrameContext<'_>) -> Result<[wgpu::Buffer; 3], RenderError> {
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
        frame.upload_of_plan(Slot::Coast, &plan.coast)?
    };
    let terrain = frame
        .terrain
        .clone()
        .unwrap_or_else(|| frame.domain.clone());
    Ok([terrain, axes, coast])
}
