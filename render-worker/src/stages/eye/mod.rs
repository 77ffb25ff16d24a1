//! The eye: lists of entries in, the blended colour of every pixel out. See `eye.wgsl`.

pub mod cpu;

use crate::error::RenderError;
use crate::frame::FrameContext;
use crate::gpu::{Gpu, Kernel, Slot};

/// The shader.
pub const SOURCE: &str = concat!(include_str!("../prelude.wgsl"), include_str!("eye.wgsl"));

/// The compiled stage.
pub struct Eye {
    eye: Kernel,
}

impl Eye {
    /// Compiles `source`, [`SOURCE`] but for tests.
    pub fn new(gpu: &Gpu, source: &str) -> Self {
        Self {
            eye: gpu.kernel("eye", source, "eye"),
        }
    }

    /// Fills the slot of the picture.
    pub fn record(&self, frame: &mut FrameContext<'_>) -> Result<(), RenderError> {
        let counts = frame.room(Slot::Counts, 4)?;
        let entries = frame.room(Slot::Entries, 4)?;
        let picture = frame.room(Slot::Picture, frame.pixel_count() * 16)?;
        let buffers = [
            (0, &frame.params_buffer),
            (1, &counts),
            (2, &entries),
            (3, &picture),
        ];
        frame.recorder.dispatch(
            &self.eye,
            &buffers,
            [frame.params.tiles_x, frame.params.tiles_y],
        );
        Ok(())
    }
}
