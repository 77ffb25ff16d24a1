//! The eye: lists of entries in, every pixel out, blended and composed. See `eye.wgsl`.

pub mod cpu;

use std::sync::OnceLock;

use crate::error::RenderError;
use crate::frame_context::FrameContext;
use crate::gpu::{Gpu, Kernel, Slot};
use crate::stages::compose;
use crate::stages::layout::{MOST_HOT_PARTS, NEVER_LONG, Params, SCREEN_TILE_PX};
use crate::stages::sizes::list_count;

/// The shader.
pub const SOURCE: &str = concat!(
    include_str!("../prelude.wgsl"),
    include_str!("../sphere.wgsl"),
    include_str!("../compose/globe.wgsl"),
    include_str!("../compose/over_globe.wgsl"),
    include_str!("eye.wgsl"),
    include_str!("whole.wgsl"),
    include_str!("alone.wgsl")
);

/// The entry point that shares the work of a screen tile; for GPUs.
pub const SHARED: &str = "eye";
/// The one that sums up parts of long lists.
const HOT: &str = "hot";
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
    include_str!("whole.wgsl"),
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
    /// For pictures where cells crowd; likewise.
    crowded: Crowded,
    source: String,
}

/// The kernels that know of long lists.
#[derive(Default)]
struct Crowded {
    /// Sum up the parts.
    hot: [OnceLock<Kernel>; 3],
    of_kernel: [OnceLock<Kernel>; 3],
    in_context: [OnceLock<Kernel>; 3],
}

/// A shader of the eye that knows of lists in parts; [`SOURCE`] and [`SOURCE_IN_CONTEXT`] do not.
pub fn with_parts(source: &str) -> String {
    source.replace(include_str!("whole.wgsl"), include_str!("hot.wgsl"))
}

/// Workgroups that take the parts of long lists in turn: as many as a large device runs at once.
const HOT_GROUPS: u32 = 1024;

/// The buffers of long lists and of their parts.
pub fn hot_room(frame: &mut FrameContext<'_>) -> Result<[wgpu::Buffer; 2], RenderError> {
    // Bound but never written where no list is cut.
    let is_cut = u64::from(frame.params.long_list != NEVER_LONG);
    let lists = is_cut * u64::from(list_count(&frame.params));
    let parts = is_cut * u64::from(1 + MOST_HOT_PARTS);
    Ok([
        frame.room(Slot::HotLists, lists * 4)?,
        frame.room(Slot::HotParts, parts * 4)?,
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
            crowded: Crowded::default(),
            source: source.to_owned(),
        }
    }

    /// Fills the slot of the image.
    pub fn record(&self, frame: &mut FrameContext<'_>) -> Result<(), RenderError> {
        let counts = frame.room(Slot::Counts, 4)?;
        let entries = frame.room(Slot::Entries, 4)?;
        let image = frame.room(Slot::Image, frame.pixel_count() * 4)?;
        let groups = [frame.params.tiles_x, frame.params.tiles_y];
        let is_crowded = frame.params.long_list != NEVER_LONG && self.entry == SHARED;
        let mut buffers = vec![
            (0, frame.params_buffer.clone()),
            (1, counts),
            (2, entries),
            (3, frame.domain.clone()),
            (4, image),
        ];
        if frame.params.in_context == 1 {
            buffers.extend((5..).zip(compose::surroundings(frame)?));
        }
        if is_crowded {
            let kind = frame.params.kernel as usize;
            let gpu = frame.gpu;
            // Compiled as the eye is, so that it rounds as the eye does.
            let hot = self.crowded.hot[kind]
                .get_or_init(|| compiled(gpu, &with_parts(&self.source), KERNELS[kind], HOT));
            buffers.extend(sum_up(hot, frame)?);
        }
        let kernel = self.kernel(frame.gpu, &frame.params, is_crowded);
        let buffers: Vec<_> = buffers.iter().map(|(at, buffer)| (*at, buffer)).collect();
        frame.recorder.dispatch(kernel, &buffers, groups);
        Ok(())
    }

    /// The kernel of a picture, compiled if it is the first of its kind.
    fn kernel(&self, gpu: &Gpu, params: &Params, is_crowded: bool) -> &Kernel {
        let kind = params.kernel as usize;
        let compiled = |source: &str| compiled(gpu, source, KERNELS[kind], self.entry);
        let in_context = &self.source_in_context;
        match (params.in_context == 1, is_crowded) {
            (false, false) => &self.of_kernel[kind],
            (true, false) => self.in_context[kind].get_or_init(|| compiled(in_context)),
            (false, true) => {
                self.crowded.of_kernel[kind].get_or_init(|| compiled(&with_parts(&self.source)))
            }
            (true, true) => {
                self.crowded.in_context[kind].get_or_init(|| compiled(&with_parts(in_context)))
            }
        }
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

fn compiled(gpu: &Gpu, source: &str, kernel: &str, entry: &'static str) -> Kernel {
    let source = source.replace("params.kernel", kernel);
    let label = if entry == HOT { HOT } else { "eye" };
    gpu.kernel(label, &source, entry)
}
