//! The two passes over particles, each made of the functions of several stages: storing what lies between them would
//! cost more than the stages do. Particles that drift have a first pass of their own, `trails`.
//!
//! All keep sums for a workgroup's neighbours in a small table (`tally.wgsl`) and store splats in one order (`order.wgsl`); first
//! passes store alike (`store.wgsl`).

pub mod cells;
pub mod scatter;
pub mod splat;
mod store;
pub mod trails;

use crate::frame_context::FrameContext;
use crate::gpu::Gpu;
use crate::stages::params::Uniform;
use crate::stages::sizes::workgroups;
use crate::stages::variants::Variants;

/// Which cells the passes draw, and where they store their splats.
pub const CELLS: &str = include_str!("order.wgsl");

/// Probes of the table of sums that are shared with neighbours: after so many a key has no slot.
pub const SHARED_PROBES: u32 = 12;
/// Nobody shares sums: that pays on GPUs alone.
pub const NO_PROBES: u32 = 0;

/// What suits the device.
pub fn probes(gpu: &Gpu) -> u32 {
    if gpu.is_software() {
        NO_PROBES
    } else {
        SHARED_PROBES
    }
}

/// A pass whose table of sums is looked through so often.
struct Pass {
    kernels: Variants,
    probes: u32,
}

impl Pass {
    fn new(
        gpu: &Gpu,
        label: &'static str,
        source: &str,
        probes: u32,
        uniforms: &[Uniform],
    ) -> Self {
        let kernels = Variants::new(label, source, label, uniforms);
        Self {
            kernels: kernels.compiled(gpu, &[("PROBES", probes)]),
            probes,
        }
    }

    /// Records it for every cell that is drawn.
    fn record(&self, frame: &mut FrameContext<'_>, buffers: &[(u32, &wgpu::Buffer)]) {
        let constants = [("PROBES", self.probes)];
        let kernel = self.kernels.of(frame.gpu, &constants, frame.features);
        let groups = workgroups(&frame.params);
        frame.recorder.dispatch_deep(&kernel, buffers, groups);
    }
}
