//! Light: splats in, the same splats dimmed by what lies between them and the sun out. See `light.wgsl`.

pub mod cpu;

use crate::error::RenderError;
use crate::frame::FrameContext;
use crate::gpu::{Gpu, Kernel, Slot};
use crate::stages::layout::{GROUP, Params};

/// The shader.
pub const SOURCE: &str = concat!(include_str!("../prelude.wgsl"), include_str!("light.wgsl"));

/// The compiled stage.
pub struct Light {
    deposit: Kernel,
    prefix: Kernel,
    shade: Kernel,
}

/// Numbers in the light buffer: one layer for every slice and one for the whole.
pub fn texel_count(params: &Params) -> usize {
    params.light_width as usize * params.light_height as usize * (params.slices as usize + 1)
}

impl Light {
    /// Compiles `source`, [`SOURCE`] but for tests.
    pub fn new(gpu: &Gpu, source: &str) -> Self {
        Self {
            deposit: gpu.kernel("light", source, "deposit"),
            prefix: gpu.kernel("light", source, "prefix"),
            shade: gpu.kernel("light", source, "shade"),
        }
    }

    /// Dims the colours of the splats.
    pub fn record(&self, frame: &mut FrameContext<'_>) -> Result<(), RenderError> {
        let count = frame.params.particle_count;
        let bytes = texel_count(&frame.params) as u64 * 4;
        let splats = frame.room(Slot::Splats, 4)?;
        let light = frame.room(Slot::Light, bytes)?;
        frame.recorder.clear(&light, bytes);
        let all = [(0, &frame.params_buffer), (1, &splats), (2, &light)];
        let columns = frame.params.light_width * frame.params.light_height;
        frame
            .recorder
            .dispatch_list(&self.deposit, &all, count, GROUP);
        frame.recorder.dispatch_list(
            &self.prefix,
            &[(0, &frame.params_buffer), (2, &light)],
            columns,
            GROUP,
        );
        frame
            .recorder
            .dispatch_list(&self.shade, &all, count, GROUP);
        Ok(())
    }
}
