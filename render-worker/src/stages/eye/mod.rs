//! The eye: lists of entries in, every pixel out, blended and composed. See `eye.wgsl`.

pub mod cpu;

use std::sync::OnceLock;

use crate::error::RenderError;
use crate::frame::FrameContext;
use crate::gpu::{Gpu, Kernel, Slot};
use crate::stages::bin::list_count;
use crate::stages::compose;
use crate::stages::layout::{MOST_HOT_PARTS, SCREEN_TILE_PX};

/// The shader.
pub const SOURCE: &str = concat!(
    include_str!("../prelude.wgsl"),
    include_str!("../sphere.wgsl"),
    include_str!("../compose/globe.wgsl"),
    include_str!("../compose/over_globe.wgsl"),
    include_str!("eye.wgsl"),
    include_str!("hot.wgsl"),
    include_str!("alone.wgsl")
);

/// The entry point that shares the work of a screen tile; for GPUs.
pub const SHARED: &str = "eye";
/// The one whose pixels work alone; for adapters that are programs.
pub const ALONE: &str = "alone";
/// The shader for pictures in their surroundings.
pub const SOURCE_IN_CONTEXT: &str = concat!(
    include_str!("../prelude.wgsl"),
    include_str!("../sphere.wgsl"),
    include_str!("../compose/globe.wgsl"),
    include_str!("../compose/terrain.wgsl"),
    include_str!("../compose/in_context.wgsl"),
    include_str!("eye.wgsl"),
    include_str!("hot.wgsl"),
    include_str!("alone.wgsl")
);

/// What the kind of particle is called where shaders are compiled, by its number.
const KERNELS: [&str; 3] = ["KERNEL_DOT", "KERNEL_BALL", "KERNEL_CLOUD"];

/// The compiled stage: one shader for each kind of particle, which is tested for every pixel of every entry otherwise.
pub struct Eye {
    of_kernel: [Kernel; 3],
    source_in_context: String,
    entry: &'static str,
    /// For pictures in their surroundings; compiled when they are first wanted.
    in_context: [OnceLock<Kernel>; 3],
    /// Sums long lists up in parts; none where pixels work alone.
    hot: Option<Kernel>,
}

/// Workgroups that take the parts of long lists in turn: as many as a large device runs at once.
const HOT_GROUPS: u32 = 1024;

/// The buffers of long lists and of their parts.
pub fn hot_room(frame: &mut FrameContext<'_>) -> Result<[wgpu::Buffer; 2], RenderError> {
    Ok([
        frame.room(Slot::HotLists, u64::from(list_count(&frame.params)) * 4)?,
        frame.room(Slot::HotParts, u64::from(1 + MOST_HOT_PARTS) * 4)?,
    ])
}

impl Eye {
    /// Compiles the entry point that suits the device, of [`SOURCE`] now and of [`SOURCE_IN_CONTEXT`] when it is wanted.
    pub fn new(gpu: &Gpu) -> Self {
        let entry = if gpu.is_software() { ALONE } else { SHARED };
        Self::of(gpu, SOURCE, SOURCE_IN_CONTEXT, entry)
    }

    /// Compiles an entry point of other shaders, for tests.
    pub fn of(gpu: &Gpu, source: &str, source_in_context: &str, entry: &'static str) -> Self {
        Self {
            of_kernel: KERNELS.map(|kernel| compiled(gpu, source, kernel, entry)),
            source_in_context: source_in_context.to_owned(),
            entry,
            in_context: Default::default(),
            hot: (entry == SHARED).then(|| gpu.kernel("hot", source, "hot")),
        }
    }

    /// Fills the slot of the image.
    pub fn record(&self, frame: &mut FrameContext<'_>) -> Result<(), RenderError> {
        let counts = frame.room(Slot::Counts, 4)?;
        let entries = frame.room(Slot::Entries, 4)?;
        let image = frame.room(Slot::Image, frame.pixel_count() * 4)?;
        let long = self.hot.as_ref();
        let long = long.map(|kernel| sum_up(kernel, frame)).transpose()?;
        let long = long.iter().flatten();
        let long: Vec<_> = long.map(|(binding, buffer)| (*binding, buffer)).collect();
        let groups = [frame.params.tiles_x, frame.params.tiles_y];
        let kind = frame.params.kernel as usize;
        if frame.params.in_context == 1 {
            let [terrain, axes, coast] = compose::surroundings(frame)?;
            let gpu = frame.gpu;
            let kernel = self.in_context[kind]
                .get_or_init(|| compiled(gpu, &self.source_in_context, KERNELS[kind], self.entry));
            let buffers = [
                (0, &frame.params_buffer),
                (1, &counts),
                (2, &entries),
                (3, &frame.domain),
                (4, &image),
                (5, &terrain),
                (6, &axes),
                (7, &coast),
            ];
            let buffers = [&buffers, long.as_slice()].concat();
            frame.recorder.dispatch(kernel, &buffers, groups);
            return Ok(());
        }
        let buffers = [
            (0, &frame.params_buffer),
            (1, &counts),
            (2, &entries),
            (3, &frame.domain),
            (4, &image),
        ];
        let buffers = [&buffers, long.as_slice()].concat();
        frame
            .recorder
            .dispatch(&self.of_kernel[kind], &buffers, groups);
        Ok(())
    }
}

/// Sums up the parts of long lists; what the eye reads of them comes back.
fn sum_up(
    kernel: &Kernel,
    frame: &mut FrameContext<'_>,
) -> Result<[(u32, wgpu::Buffer); 2], RenderError> {
    let counts = frame.room(Slot::Counts, 4)?;
    let entries = frame.room(Slot::Entries, 4)?;
    let [lists, parts] = hot_room(frame)?;
    let pixels = u64::from(SCREEN_TILE_PX * SCREEN_TILE_PX);
    let sums = frame.room(Slot::HotSums, u64::from(MOST_HOT_PARTS) * pixels * 16)?;
    let buffers = [
        (0, &frame.params_buffer),
        (1, &counts),
        (2, &entries),
        (8, &lists),
        (9, &parts),
        (10, &sums),
    ];
    frame.recorder.dispatch(kernel, &buffers, [HOT_GROUPS, 1]);
    Ok([(8, lists), (10, sums)])
}

fn compiled(gpu: &Gpu, source: &str, kernel: &str, entry: &str) -> Kernel {
    let source = source.replace("params.kernel", kernel);
    gpu.kernel("eye", &source, entry)
}
