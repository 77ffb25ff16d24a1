//! Projection: particles in their cells in, splats on the screen, in their slice and in the light out.
//!
//! Tiles use the map projection with an oblique view that leaves the ground in place; slices are horizontal there, so
//! that they are the same for every tile. Globe views use eq. 4 and slices across the half-way vector.

pub mod cpu;

use crate::error::RenderError;
use crate::frame::FrameContext;
use crate::gpu::{Gpu, Kernel, Slot};
use crate::stages::layout::{GROUP, Splat};

/// The shader.
pub const SOURCE: &str = concat!(
    include_str!("../prelude.wgsl"),
    include_str!("project.wgsl")
);

/// The compiled stage.
pub struct Project {
    project: Kernel,
}

impl Project {
    /// Compiles `source`, [`SOURCE`] but for tests.
    pub fn new(gpu: &Gpu, source: &str) -> Self {
        Self {
            project: gpu.kernel("project", source, "project"),
        }
    }

    /// Fills the slot of splats.
    pub fn record(&self, frame: &mut FrameContext<'_>) -> Result<(), RenderError> {
        let count = frame.params.particle_count;
        let plan = frame.plan;
        let rows = frame.upload(Slot::Rows, &plan.rows)?;
        let cols = frame.upload(Slot::Cols, &plan.cols)?;
        let particles = frame.room(Slot::Particles, 4)?;
        let splats = frame.room(Slot::Splats, u64::from(count) * size_of::<Splat>() as u64)?;
        let buffers = [
            (0, &frame.params_buffer),
            (1, &rows),
            (2, &cols),
            (3, &particles),
            (4, &splats),
        ];
        frame
            .recorder
            .dispatch_list(&self.project, &buffers, count, GROUP);
        Ok(())
    }
}
