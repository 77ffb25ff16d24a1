//! Interpolation in time (eq. 3 in docs/method.md): the frames before and after an instant in, the grid at the instant out.

pub mod cpu;

use crate::error::RenderError;
use crate::frame_context::FrameContext;
use crate::gpu::{Gpu, Kernel, Slot};
use crate::stages::layout::GROUP;

/// The function that other stages run where they need one cell.
pub const FUNCTIONS: &str = include_str!("between.wgsl");

/// The shader.
pub const SOURCE: &str = concat!(
    include_str!("../prelude.wgsl"),
    include_str!("between.wgsl"),
    include_str!("interpolate.wgsl")
);

/// The compiled stage.
pub struct Interpolate {
    interpolate: Kernel,
}

impl Interpolate {
    /// Compiles `source`, [`SOURCE`] but for tests.
    pub fn new(gpu: &Gpu, source: &str) -> Self {
        Self {
            interpolate: gpu.kernel("interpolate", source, "interpolate"),
        }
    }

    /// Fills the slot of values.
    pub fn record(&self, frame: &mut FrameContext<'_>) -> Result<(), RenderError> {
        let cells = frame
            .params
            .end_cell
            .saturating_sub(frame.params.first_cell);
        let held = frame.params.held_end_cell - frame.params.held_first_cell;
        let bytes = u64::from(held) * 4;
        let value = frame.room(Slot::Value, bytes)?;
        let [before, after] = frame.value_frames.clone();
        let buffers = [
            (0, &frame.params_buffer),
            (1, &before),
            (2, &after),
            (3, &value),
        ];
        frame
            .recorder
            .dispatch_list(&self.interpolate, &buffers, cells, GROUP);
        Ok(())
    }
}
