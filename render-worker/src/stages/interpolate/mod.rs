//! Interpolation in time (eq. 3): the frames before and after an instant in, the grid at the instant out.

pub mod cpu;

use crate::error::RenderError;
use crate::frame::FrameContext;
use crate::gpu::{Gpu, Kernel, Slot};
use crate::stages::layout::GROUP;

/// The shader.
pub const SOURCE: &str = concat!(
    include_str!("../prelude.wgsl"),
    include_str!("interpolate.wgsl")
);

/// The compiled stage.
pub struct Interpolate {
    value: Kernel,
    accumulated: Kernel,
}

impl Interpolate {
    /// Compiles `source`, [`SOURCE`] but for tests.
    pub fn new(gpu: &Gpu, source: &str) -> Self {
        Self {
            value: gpu.kernel("interpolate", source, "interpolate_value"),
            accumulated: gpu.kernel("interpolate", source, "interpolate_accumulated"),
        }
    }

    /// Fills the slots of values and accumulated carbon.
    pub fn record(&self, frame: &mut FrameContext<'_>) -> Result<(), RenderError> {
        let cells = frame
            .params
            .end_cell
            .saturating_sub(frame.params.first_cell);
        let bytes = u64::from(frame.params.rows) * u64::from(frame.params.cols) * 4;
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
            .dispatch_list(&self.value, &buffers, cells, GROUP);
        // The next stage binds the slot also where nothing is accumulated.
        let accumulated_bytes = if frame.accumulated_frames.is_some() {
            bytes
        } else {
            4
        };
        let accumulated = frame.room(Slot::Accumulated, accumulated_bytes)?;
        if let Some([before, after]) = frame.accumulated_frames.clone() {
            let buffers = [
                (0, &frame.params_buffer),
                (1, &before),
                (2, &after),
                (3, &accumulated),
            ];
            frame
                .recorder
                .dispatch_list(&self.accumulated, &buffers, cells, GROUP);
        }
        Ok(())
    }
}
