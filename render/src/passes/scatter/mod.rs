//! The second pass over particles: stored splats, light and starts of lists in, lists of shaded entries out.

use crate::error::RenderError;
use crate::frame_context::FrameContext;
use crate::gpu::{Gpu, Slot};
use crate::passes::Pass;
use crate::stages::layout::Entry;
use crate::stages::params::Uniform::{Cells, Lighting, Lists, View};

/// The shader.
pub const SOURCE: &str = concat!(
    include_str!("../../stages/prelude.wgsl"),
    include_str!("../../stages/light/texel.wgsl"),
    include_str!("../../stages/light/shade.wgsl"),
    include_str!("../../stages/bin/lists.wgsl"),
    include_str!("../../stages/bin/reach.wgsl"),
    include_str!("../tally.wgsl"),
    include_str!("../order.wgsl"),
    include_str!("scatter.wgsl"),
);

/// The compiled stage.
pub struct Scatter {
    scatter: Pass,
}

impl Scatter {
    /// Compiles `source`, [`SOURCE`] but for tests, with a table of sums of so many probes.
    pub fn new(gpu: &Gpu, source: &str, probes: u32) -> Self {
        Self {
            scatter: Pass::new(
                gpu,
                "scatter",
                source,
                probes,
                &[View, Cells, Lighting, Lists],
            ),
        }
    }

    /// Fills the slot of entries and moves each list's start to its end.
    pub fn record(&self, frame: &mut FrameContext<'_>) -> Result<(), RenderError> {
        let seen = frame.room(Slot::Seen, 4)?;
        let lit = frame.room(Slot::Lit, 4)?;
        let light = frame.light()?;
        let counts = frame.room(Slot::Counts, 4)?;
        let entry_bytes = u64::from(frame.params.lists.entry_capacity) * size_of::<Entry>() as u64;
        let entries = frame.room(Slot::Entries, entry_bytes)?;
        let buffers = [
            (1, &seen),
            (2, &light),
            (3, &counts),
            (4, &entries),
            (5, &lit),
        ];
        self.scatter.record(frame, &buffers);
        Ok(())
    }
}
