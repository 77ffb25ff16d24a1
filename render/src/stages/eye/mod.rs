//! The eye: lists of entries in, every pixel out, blended and composed. See `eye.wgsl`.

pub mod cpu;

use std::sync::OnceLock;

use crate::error::RenderError;
use crate::frame_context::FrameContext;
use crate::gpu::{Gpu, Kernel, Slot};
use crate::stages::compose;
use crate::stages::layout::{
    KERNEL_BALL, KERNEL_CLOUD, KERNEL_DOT, KERNEL_RIMMED, MOST_HOT_PARTS, NEVER_LONG,
    SCREEN_TILE_PX,
};
use crate::stages::params::Uniform::{Context, Lists, View};
use crate::stages::sizes::list_count;

/// The shader.
pub const SOURCE: &str = concat!(
    include_str!("../prelude.wgsl"),
    include_str!("../sphere.wgsl"),
    include_str!("../water.wgsl"),
    include_str!("../compose/globe.wgsl"),
    include_str!("../compose/terrain.wgsl"),
    include_str!("../compose/in_context/ceiling.wgsl"),
    include_str!("../compose/in_context.wgsl"),
    include_str!("../compose/composed.wgsl"),
    include_str!("../bin/lists.wgsl"),
    include_str!("eye.wgsl"),
    include_str!("hot.wgsl"),
    include_str!("alone.wgsl")
);

/// The entry point that shares the work of a screen tile; for GPUs.
pub const SHARED: &str = "eye";
/// The one that sums up parts of long lists.
const HOT: &str = "hot";
/// The one whose pixels work alone; for adapters that are programs.
pub const ALONE: &str = "alone";

/// The compiled stage.
pub struct Eye {
    source: String,
    entry: &'static str,
    /// By kind of particle, surroundings and long lists. Those of plain pictures are compiled at once, the others when
    /// they are first wanted.
    kernels: [[[OnceLock<Kernel>; 2]; 2]; 4],
    /// Sum up the parts of long lists: by kind of particle and surroundings.
    hot: [[OnceLock<Kernel>; 2]; 4],
}

/// Workgroups that take the parts of long lists in turn: as many as a large device runs at once.
const HOT_GROUPS: u32 = 1024;

/// The buffers of long lists and of their parts.
pub fn hot_room(frame: &mut FrameContext<'_>) -> Result<[wgpu::Buffer; 2], RenderError> {
    // Bound but never written where no list is cut.
    let is_cut = u64::from(frame.params.lists.long_list != NEVER_LONG);
    let lists = is_cut * u64::from(list_count(&frame.params));
    let parts = is_cut * u64::from(1 + MOST_HOT_PARTS);
    Ok([
        frame.room(Slot::HotLists, lists * 4)?,
        frame.room(Slot::HotParts, parts * 4)?,
    ])
}

impl Eye {
    /// Compiles the entry point that suits the device.
    pub fn new(gpu: &Gpu) -> Self {
        let entry = if gpu.is_software() { ALONE } else { SHARED };
        Self::of(gpu, SOURCE, entry)
    }

    /// Compiles an entry point of `source`, [`SOURCE`] but for tests.
    pub fn of(gpu: &Gpu, source: &str, entry: &'static str) -> Self {
        let eye = Self {
            source: source.to_owned(),
            entry,
            kernels: Default::default(),
            hot: Default::default(),
        };
        for kind in [KERNEL_DOT, KERNEL_BALL, KERNEL_CLOUD, KERNEL_RIMMED] {
            eye.kernel(gpu, kind, false, false);
        }
        eye
    }

    /// Fills the slot of the image.
    pub fn record(&self, frame: &mut FrameContext<'_>) -> Result<(), RenderError> {
        let counts = frame.room(Slot::Counts, 4)?;
        let entries = frame.room(Slot::Entries, 4)?;
        let image = frame.room(Slot::Image, frame.pixel_count() * 4)?;
        let groups = frame.params.view.tiles.to_array();
        let has_parts = frame.params.lists.long_list != NEVER_LONG && self.entry == SHARED;
        let mut buffers = vec![
            (1, counts),
            (2, entries),
            (3, frame.scene.domain.clone()),
            (4, image),
        ];
        buffers.extend(compose::surroundings(frame)?);
        if has_parts {
            self.sum_up(frame)?;
        }
        if self.entry == SHARED {
            // Bound but never read where no list is cut.
            let [lists, _parts] = hot_room(frame)?;
            buffers.extend([(8, lists), (10, frame.room(Slot::HotSums, 4)?)]);
        }
        let (kind, in_context) = (frame.params.lists.kernel, frame.params.in_context);
        let kernel = self.kernel(frame.gpu, kind, in_context, has_parts);
        let buffers: Vec<_> = buffers.iter().map(|(at, buffer)| (*at, buffer)).collect();
        frame.recorder.dispatch(kernel, &buffers, groups);
        Ok(())
    }

    /// The kernel of a picture, compiled if it is the first of its kind.
    fn kernel(&self, gpu: &Gpu, kind: u32, in_context: bool, has_parts: bool) -> &Kernel {
        let of_kind = &self.kernels[kind as usize];
        of_kind[usize::from(in_context)][usize::from(has_parts)].get_or_init(|| {
            let constants = [
                ("KERNEL", f64::from(kind)),
                compose::in_context(in_context),
                ("HAS_PARTS", f64::from(u8::from(has_parts))),
            ];
            let reads: Vec<_> = compose::READS.into_iter().chain([Lists]).collect();
            gpu.variant("eye", &self.source, self.entry, &constants)
                .reading(&reads)
        })
    }

    /// Sums up the parts of long lists.
    fn sum_up(&self, frame: &mut FrameContext<'_>) -> Result<(), RenderError> {
        let gpu = frame.gpu;
        let (kind, in_context) = (frame.params.lists.kernel, frame.params.in_context);
        let constants = [("KERNEL", f64::from(kind)), compose::in_context(in_context)];
        let kernel = self.hot[kind as usize][usize::from(in_context)].get_or_init(|| {
            gpu.variant(HOT, &self.source, HOT, &constants)
                .reading(&[View, Context, Lists])
        });
        let [
            _terrain,
            _axes,
            (coast_at, coast),
            _lines,
            (trails_at, trails),
        ] = compose::surroundings(frame)?;
        let counts = frame.room(Slot::Counts, 4)?;
        let entries = frame.room(Slot::Entries, 4)?;
        let [lists, parts] = hot_room(frame)?;
        let pixels = u64::from(SCREEN_TILE_PX * SCREEN_TILE_PX);
        let sums = frame.room(Slot::HotSums, u64::from(MOST_HOT_PARTS) * pixels * 16)?;
        let buffers = [
            (1, &counts),
            (2, &entries),
            (coast_at, &coast),
            (trails_at, &trails),
            (8, &lists),
            (9, &parts),
            (10, &sums),
        ];
        frame.recorder.dispatch(kernel, &buffers, [HOT_GROUPS, 1]);
        Ok(())
    }
}
