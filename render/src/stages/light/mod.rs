//! The light's side of half-angle slicing: splats give their optical depth to a layered buffer, a sum along the layers turns
//! it into twice the depth above each layer's middle, and every splat is dimmed by what lies between it and the sun. Layers lie
//! across the light on globes; those of map tiles are the eye's slices, which are the same for all tiles of a level.
//!
//! Depth is given in the pass that makes the splats and read in the pass that scatters them; here is the sum.

pub mod cpu;
pub mod params;

use crate::error::RenderError;
use crate::frame_context::FrameContext;
use crate::gpu::{Gpu, Kernel};
use crate::stages::layout::GROUP;
use crate::stages::params::Uniform::Lighting;

/// The entry point that cuts columns of texels into segments; for GPUs.
pub const SEGMENTED: &str = "prefix";
/// The one that sums a column up in one go, without waiting; for adapters that are programs.
pub const STRAIGHT: &str = "straight";

/// Places in the light buffer.
pub const TEXEL_FUNCTIONS: &str = include_str!("texel.wgsl");
/// The functions that give depth to the light; [`splat`](crate::passes::splat) runs them.
pub const DEPOSIT_FUNCTIONS: &str =
    concat!(include_str!("texel.wgsl"), include_str!("deposit.wgsl"));
/// The functions that dim a splat; [`scatter`](crate::passes::scatter) runs them.
pub const SHADE_FUNCTIONS: &str = concat!(include_str!("texel.wgsl"), include_str!("shade.wgsl"));

/// The shader.
pub const SOURCE: &str = concat!(
    include_str!("../prelude.wgsl"),
    include_str!("texel.wgsl"),
    include_str!("light.wgsl")
);

/// The compiled stage.
pub struct Light {
    prefix: Kernel,
    /// Columns of texels that one workgroup sums up.
    columns: u32,
}

impl Light {
    /// Compiles the entry point that suits the device.
    pub fn new(gpu: &Gpu) -> Self {
        let entry = if gpu.is_software() {
            STRAIGHT
        } else {
            SEGMENTED
        };
        Self::of(gpu, SOURCE, entry)
    }

    /// Compiles an entry point of `source`, [`SOURCE`] but for tests.
    pub fn of(gpu: &Gpu, source: &str, entry: &str) -> Self {
        Self {
            prefix: gpu.kernel("light", source, entry).reading(&[Lighting]),
            columns: if entry == STRAIGHT { GROUP } else { 32 },
        }
    }

    /// Turns the depth of each layer into twice the depth above its middle.
    pub fn record(&self, frame: &mut FrameContext<'_>) -> Result<(), RenderError> {
        let light = frame.light()?;
        let columns = frame.params.lighting.size.element_product();
        let buffers = [(1, &light)];
        frame
            .recorder
            .dispatch_list(&self.prefix, &buffers, columns, self.columns);
        Ok(())
    }
}
