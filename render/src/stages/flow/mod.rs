//! Flows: the fields of both parts of a vector in, the velocity of every cell out, and from it particles that drift.
//!
//! A particle's life is a cycle: born somewhere in its cell, it drifts for a while, fades and is born elsewhere. Where it
//! is at an instant follows from its number and the clock alone, so any worker draws it at the same place.

pub mod cpu;
pub mod params;

use crate::error::RenderError;
use crate::frame_context::FrameContext;
use crate::gpu::{Gpu, Kernel, Slot};
use crate::stages::layout::{GROUP, Velocity};
use crate::stages::params::Uniform::{Grid, Values};

/// The functions of a particle that drifts; [`trails`](crate::passes::trails) runs them.
pub const FUNCTIONS: &str = include_str!("flow.wgsl");

/// The shader.
pub const SOURCE: &str = concat!(
    include_str!("../prelude.wgsl"),
    include_str!("../interpolate/between.wgsl"),
    include_str!("velocity.wgsl")
);

/// The compiled stage.
pub struct Flow {
    velocities: Kernel,
}

impl Flow {
    /// Compiles `source`, [`SOURCE`] but for tests.
    pub fn new(gpu: &Gpu, source: &str) -> Self {
        Self {
            velocities: gpu
                .kernel("velocities", source, "velocities")
                .reading(&[Grid, Values]),
        }
    }

    /// Fills the slot of velocities.
    pub fn record(&self, frame: &mut FrameContext<'_>) -> Result<(), RenderError> {
        let cells = frame.params.grid.rows * frame.params.grid.cols;
        let bytes = u64::from(cells) * size_of::<Velocity>() as u64;
        let velocity = frame.room(Slot::Velocity, bytes)?;
        let [east_before, east_after] = frame.scene.value.clone();
        let northward = frame.scene.northward.clone();
        let [north_before, north_after] = northward.ok_or(RenderError::NoNorthward)?;
        let buffers = [
            (1, &east_before),
            (2, &east_after),
            (3, &north_before),
            (4, &north_after),
            (5, &velocity),
        ];
        frame
            .recorder
            .dispatch_list(&self.velocities, &buffers, cells, GROUP);
        Ok(())
    }
}
