//! The light's side of half-angle slicing: splats give their optical depth to a slice-layered buffer, a sum along the
//! slices turns it into twice the depth above each slice's middle, and every splat is dimmed by what lies between it and the sun.
//!
//! Depth is given in the pass that makes the splats and read in the pass that places them; here is the sum.

pub mod cpu;

use crate::error::RenderError;
use crate::frame::FrameContext;
use crate::gpu::{Gpu, Kernel, Slot};
use crate::stages::layout::Params;

/// Columns of texels that one workgroup sums up.
const COLUMNS: u32 = 32;

/// Radii before and behind its centre, along the sight line, at which a cloud looks its light up: near the root of the mean
/// square distance of its mass there, 1 over the root of 6. Nearer to the reference than a look at the centre by 7 dB.
pub const LOOK: f32 = 0.38;

/// The functions that give depth to the light; [`splat`](crate::passes::splat) runs them.
pub const DEPOSIT_FUNCTIONS: &str =
    concat!(include_str!("texel.wgsl"), include_str!("deposit.wgsl"));
/// The functions that dim a splat; [`place`](crate::passes::place) runs them.
pub const SHADE_FUNCTIONS: &str = concat!(include_str!("texel.wgsl"), include_str!("shade.wgsl"));

/// The shader.
pub const SOURCE: &str = concat!(include_str!("../prelude.wgsl"), include_str!("light.wgsl"));

/// The compiled stage.
pub struct Light {
    prefix: Kernel,
}

/// Numbers in the light buffer: one layer for every slice and one for the whole.
pub fn texel_count(params: &Params) -> usize {
    params.light_width as usize * params.light_height as usize * (params.slices as usize + 1)
}

impl Light {
    /// Compiles `source`, [`SOURCE`] but for tests.
    pub fn new(gpu: &Gpu, source: &str) -> Self {
        Self {
            prefix: gpu.kernel("light", source, "prefix"),
        }
    }

    /// Turns the depth of each slice into twice the depth above its middle.
    pub fn record(&self, frame: &mut FrameContext<'_>) -> Result<(), RenderError> {
        let light = frame.room(Slot::Light, 4)?;
        let columns = frame.params.light_width * frame.params.light_height;
        let buffers = [(0, &frame.params_buffer), (1, &light)];
        frame
            .recorder
            .dispatch_list(&self.prefix, &buffers, columns, COLUMNS);
        Ok(())
    }
}
