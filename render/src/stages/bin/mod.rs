//! Binning: the counting sort of splats into lists by screen tile and slice.
//!
//! Lists are counted in the pass that makes the splats and filled in the pass that scatters them; between the two, here,
//! lengths become starts. Lists that are long beyond the others are cut into parts for the eye.

pub mod cpu;
pub mod params;

use crate::error::RenderError;
use crate::frame_context::FrameContext;
use crate::gpu::{Gpu, Kernel, Slot};
use crate::stages::eye;
use crate::stages::layout::{NEVER_LONG, SCAN_BLOCK};
use crate::stages::params::Uniform::{Lists, View};
use crate::stages::sizes::list_count;

/// The functions that tell the lists of a splat.
pub const FUNCTIONS: &str = concat!(include_str!("lists.wgsl"), include_str!("reach.wgsl"));

/// The shader.
pub const SOURCE: &str = concat!(
    include_str!("../prelude.wgsl"),
    include_str!("lists.wgsl"),
    include_str!("bin.wgsl")
);

/// The compiled stage.
pub struct Bin {
    /// Scans each block of lists and sums it up.
    blocks: Kernel,
    /// Adds to each block the sums of those before it.
    add: Kernel,
}

impl Bin {
    /// Compiles `source`, [`SOURCE`] but for tests.
    pub fn new(gpu: &Gpu, source: &str) -> Self {
        let kernel = |entry| gpu.kernel(entry, source, entry);
        Self {
            blocks: kernel("scan_blocks").reading(&[View, Lists]),
            add: kernel("scan_add").reading(&[View]),
        }
    }

    /// Turns the lengths of lists into their starts.
    pub fn record(&self, frame: &mut FrameContext<'_>) -> Result<(), RenderError> {
        let lists = list_count(&frame.params);
        let counts = frame.room(Slot::Counts, u64::from(lists) * 4)?;
        let sums = frame.room(Slot::BlockSums, u64::from(lists.div_ceil(SCAN_BLOCK)) * 4)?;
        let [hot_lists, hot_parts] = eye::hot_room(frame)?;
        let recorder = &mut frame.recorder;
        if frame.params.lists.long_list != NEVER_LONG {
            recorder.clear(&hot_parts, 4);
        }
        let scan = [(1, &counts), (2, &sums)];
        let hot = [(3, &hot_lists), (4, &hot_parts)];
        let blocks = [scan.as_slice(), &hot].concat();
        recorder.dispatch_list(&self.blocks, &blocks, lists, SCAN_BLOCK);
        recorder.dispatch_list(&self.add, &scan, lists, SCAN_BLOCK);
        Ok(())
    }
}
