//! The eye: lists of entries in, every pixel out, blended and composed. See `eye.wgsl`.

pub mod cpu;

use crate::error::RenderError;
use crate::frame_context::FrameContext;
use crate::gpu::{Gpu, Slot};
use crate::stages::compose;
use crate::stages::layout::{
    KERNEL_BALL, KERNEL_CLOUD, KERNEL_DOT, KERNEL_RIMMED, MOST_HOT_PARTS, NEVER_LONG,
    SCREEN_TILE_PX,
};
use crate::stages::params::Uniform::{Context, Lists, View};
use crate::stages::sizes::list_count;
use crate::stages::variants::{Variant, Variants};

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
/// Composes what that has seen.
const FINISH: &str = "finish";

/// The compiled stage.
pub struct Eye {
    entry: &'static str,
    /// Kernels of plain pictures are compiled at once, the others when they are first wanted.
    kernels: Variants,
    /// Sums up the parts of long lists.
    hot: Variants,
    /// Composes what [`ALONE`] has seen.
    finish: Variants,
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
        let composed: Vec<_> = compose::READS.into_iter().chain([Lists]).collect();
        let hiding = [View, Context, Lists];
        let reads: &[_] = if entry == ALONE { &hiding } else { &composed };
        let kinds = [KERNEL_DOT, KERNEL_BALL, KERNEL_CLOUD, KERNEL_RIMMED];
        let eye = Variants::new("eye", source, entry, reads);
        Self {
            entry,
            kernels: kinds.into_iter().fold(eye, |eye, kind| {
                eye.compiled(gpu, &constants(kind, false, false))
            }),
            hot: Variants::new(HOT, source, HOT, &hiding),
            finish: Variants::new(FINISH, source, FINISH, &compose::READS),
        }
    }

    /// Fills the slot of the image.
    pub fn record(&self, frame: &mut FrameContext<'_>) -> Result<(), RenderError> {
        if self.entry == ALONE {
            self.see(frame)?;
            return self.finish(frame);
        }
        let counts = frame.room(Slot::Counts, 4)?;
        let entries = frame.room(Slot::Entries, 4)?;
        let image = frame.room(Slot::Image, frame.pixel_count() * 4)?;
        let has_parts = frame.params.lists.long_list != NEVER_LONG;
        if has_parts {
            self.sum_up(frame)?;
        }
        // Bound but never read where no list is cut.
        let [hot_lists, _parts] = hot_room(frame)?;
        let hot_sums = frame.room(Slot::HotSums, 4)?;
        let surroundings = compose::surroundings(frame)?;
        let mut buffers = vec![
            (1, &counts),
            (2, &entries),
            (3, &frame.scene.domain),
            (4, &image),
            (8, &hot_lists),
            (10, &hot_sums),
        ];
        buffers.extend(surroundings.iter().map(|(at, buffer)| (*at, buffer)));
        let kernel = self.kernel(frame, has_parts);
        let groups = frame.params.view.tiles.to_array();
        frame.recorder.dispatch(&kernel, &buffers, groups);
        Ok(())
    }

    /// Fills the slot of the picture.
    fn see(&self, frame: &mut FrameContext<'_>) -> Result<(), RenderError> {
        let counts = frame.room(Slot::Counts, 4)?;
        let entries = frame.room(Slot::Entries, 4)?;
        let picture = frame.room(Slot::Picture, frame.pixel_count() * 16)?;
        let [_, _, (coast_at, coast), _, (trails_at, trails)] = compose::surroundings(frame)?;
        let buffers = [
            (1, &counts),
            (2, &entries),
            (coast_at, &coast),
            (trails_at, &trails),
            (13, &picture),
        ];
        let kernel = self.kernel(frame, false);
        let groups = frame.params.view.tiles.to_array();
        frame.recorder.dispatch(&kernel, &buffers, groups);
        Ok(())
    }

    /// Fills the slot of the image from that of the picture.
    fn finish(&self, frame: &mut FrameContext<'_>) -> Result<(), RenderError> {
        let picture = frame.room(Slot::Picture, 16)?;
        let image = frame.room(Slot::Image, frame.pixel_count() * 4)?;
        let surroundings = compose::surroundings(frame)?;
        let mut buffers = vec![(3, &frame.scene.domain), (4, &image), (13, &picture)];
        buffers.extend(surroundings.iter().map(|(at, buffer)| (*at, buffer)));
        let constants = [compose::in_context(frame.params.in_context)];
        let kernel = self.finish.of(frame.gpu, &constants, frame.features);
        let groups = frame.params.view.tiles.to_array();
        frame.recorder.dispatch(&kernel, &buffers, groups);
        Ok(())
    }

    fn kernel(&self, frame: &FrameContext<'_>, has_parts: bool) -> Variant {
        let params = &frame.params;
        let constants = constants(params.lists.kernel, params.in_context, has_parts);
        self.kernels.of(frame.gpu, &constants, frame.features)
    }

    /// Sums up the parts of long lists.
    fn sum_up(&self, frame: &mut FrameContext<'_>) -> Result<(), RenderError> {
        let params = &frame.params;
        let constants = [
            ("KERNEL", params.lists.kernel),
            compose::in_context(params.in_context),
        ];
        let kernel = self.hot.of(frame.gpu, &constants, frame.features);
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
        frame.recorder.dispatch(&kernel, &buffers, [HOT_GROUPS, 1]);
        Ok(())
    }
}

/// Values of the override constants: the kind of particle, surroundings, long lists.
fn constants(kind: u32, in_context: bool, has_parts: bool) -> [(&'static str, u32); 3] {
    [
        ("KERNEL", kind),
        compose::in_context(in_context),
        ("HAS_PARTS", u32::from(has_parts)),
    ]
}
