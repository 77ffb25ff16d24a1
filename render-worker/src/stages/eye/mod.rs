//! The eye: lists of entries in, every pixel out, blended and composed. See `eye.wgsl`.

pub mod cpu;

use crate::error::RenderError;
use crate::frame::FrameContext;
use crate::gpu::{Gpu, Kernel, Slot};

/// The shader.
pub const SOURCE: &str = concat!(
    include_str!("../prelude.wgsl"),
    include_str!("../sphere.wgsl"),
    include_str!("../compose/over_globe.wgsl"),
    include_str!("eye.wgsl"),
    include_str!("alone.wgsl")
);

/// The entry point that shares the work of a screen tile; for GPUs.
pub const SHARED: &str = "eye";
/// The one whose pixels work alone; for adapters that are programs.
pub const ALONE: &str = "alone";

/// The compiled stage: one shader for each kind of particle, which is tested for every pixel of every entry otherwise.
pub struct Eye {
    of_kernel: [Kernel; 3],
}

impl Eye {
    /// Compiles the entry point that suits the device.
    pub fn new(gpu: &Gpu) -> Self {
        let entry = if gpu.is_software() { ALONE } else { SHARED };
        Self::of(gpu, SOURCE, entry)
    }

    /// Compiles an entry point of `source`, [`SOURCE`] but for tests.
    pub fn of(gpu: &Gpu, source: &str, entry: &str) -> Self {
        let compiled = |kernel| {
            let source = source.replace("params.kernel", kernel);
            gpu.kernel("eye", &source, entry)
        };
        Self {
            of_kernel: ["KERNEL_DOT", "KERNEL_BALL", "KERNEL_CLOUD"].map(compiled),
        }
    }

    /// Fills the slot of the image.
    pub fn record(&self, frame: &mut FrameContext<'_>) -> Result<(), RenderError> {
        let counts = frame.room(Slot::Counts, 4)?;
        let entries = frame.room(Slot::Entries, 4)?;
        let image = frame.room(Slot::Image, frame.pixel_count() * 4)?;
        let buffers = [
            (0, &frame.params_buffer),
            (1, &counts),
            (2, &entries),
            (3, &frame.domain),
            (4, &image),
        ];
        frame.recorder.dispatch(
            &self.of_kernel[frame.params.kernel as usize],
            &buffers,
            [frame.params.tiles_x, frame.params.tiles_y],
        );
        Ok(())
    }
}
