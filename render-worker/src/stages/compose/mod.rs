//! Composition: blended colours in, straight-alpha bytes over the plain globe, where one is wanted, out.

pub mod cpu;

use crate::error::RenderError;
use crate::frame::FrameContext;
use crate::gpu::{Gpu, Kernel, Slot};

/// The function that the eye runs for its own pixels.
pub const FUNCTIONS: &str = concat!(
    include_str!("../sphere.wgsl"),
    include_str!("over_globe.wgsl")
);

/// The shader.
pub const SOURCE: &str = concat!(
    include_str!("../prelude.wgsl"),
    include_str!("../sphere.wgsl"),
    include_str!("over_globe.wgsl"),
    include_str!("compose.wgsl")
);

/// The compiled stage.
pub struct Compose {
    compose: Kernel,
}

impl Compose {
    /// Compiles `source`, [`SOURCE`] but for tests.
    pub fn new(gpu: &Gpu, source: &str) -> Self {
        Self {
            compose: gpu.kernel("compose", source, "compose"),
        }
    }

    /// Fills the slot of the image.
    pub fn record(&self, frame: &mut FrameContext<'_>) -> Result<(), RenderError> {
        let picture = frame.room(Slot::Picture, 16)?;
        let image = frame.room(Slot::Image, frame.pixel_count() * 4)?;
        let buffers = [
            (0, &frame.params_buffer),
            (1, &picture),
            (2, &frame.domain),
            (3, &image),
        ];
        frame.recorder.dispatch(
            &self.compose,
            &buffers,
            [frame.params.tiles_x, frame.params.tiles_y],
        );
        Ok(())
    }
}
