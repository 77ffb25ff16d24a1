//! Interpolation in time (eq. 3 in docs/method.md): the fields before and after an instant in, the grid at the instant out.

pub mod cpu;
pub mod params;

use crate::error::RenderError;
use crate::frame_context::FrameContext;
use crate::gpu::{Gpu, Kernel, Slot};
use crate::stages::interpolate::params::InterpolateParams;
use crate::stages::layout::GROUP;
use crate::stages::params::Uniform::{Grid, Interpolation, Values};

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
            interpolate: gpu.kernel("interpolate", source, "interpolate").reading(&[
                Grid,
                Values,
                Interpolation,
            ]),
        }
    }

    /// Fills the slot of values.
    pub fn record(&self, frame: &mut FrameContext<'_>) -> Result<(), RenderError> {
        let InterpolateParams {
            first_cell,
            end_cell,
        } = frame.params.interpolation;
        let cells = end_cell.saturating_sub(first_cell);
        let grid = &frame.params.grid;
        let held = grid.held_end_cell - grid.held_first_cell;
        let bytes = u64::from(held) * 4;
        let value = frame.room(Slot::Value, bytes)?;
        let [before, after] = frame.scene.value.clone();
        let buffers = [(1, &before), (2, &after), (3, &value)];
        frame
            .recorder
            .dispatch_list(&self.interpolate, &buffers, cells, GROUP);
        Ok(())
    }
}
