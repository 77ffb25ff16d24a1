//! Particles: the active cells at an instant in, place, height, mass, depth and colour of every particle out.
//!
//! A particle's place in its column turns with the carbon accumulated, so it moves as fast as the flux is large, up
//! where carbon leaves the sea and down where it enters, and without a jump at any step of the product.

pub mod cpu;

use crate::error::RenderError;
use crate::frame::FrameContext;
use crate::gpu::{Gpu, Kernel, Slot};
use crate::stages::layout::{GROUP, Particle};

/// The shader.
pub const SOURCE: &str = concat!(
    include_str!("../prelude.wgsl"),
    include_str!("particles.wgsl")
);

/// The compiled stage.
pub struct Particles {
    generate: Kernel,
}

impl Particles {
    /// Compiles `source`, [`SOURCE`] but for tests.
    pub fn new(gpu: &Gpu, source: &str) -> Self {
        Self {
            generate: gpu.kernel("particles", source, "generate"),
        }
    }

    /// Fills the slot of particles.
    pub fn record(&self, frame: &mut FrameContext<'_>) -> Result<(), RenderError> {
        let count = frame.params.particle_count;
        let plan = frame.plan;
        let active = frame.upload(Slot::Active, &plan.active)?;
        let rows = frame.upload(Slot::Rows, &plan.rows)?;
        let palette = frame.upload(Slot::Palette, &plan.palette)?;
        let value = frame.room(Slot::Value, 4)?;
        let accumulated = frame.room(Slot::Accumulated, 4)?;
        let particles = frame.room(
            Slot::Particles,
            u64::from(count) * size_of::<Particle>() as u64,
        )?;
        let buffers = [
            (0, &frame.params_buffer),
            (1, &active),
            (2, &rows),
            (3, &value),
            (4, &accumulated),
            (5, &palette),
            (6, &particles),
        ];
        frame
            .recorder
            .dispatch_list(&self.generate, &buffers, count, GROUP);
        Ok(())
    }
}
