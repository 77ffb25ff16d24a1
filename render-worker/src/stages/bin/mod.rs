//! Binning: splats in, lists of entries by screen tile and slice out; a counting sort.

pub mod cpu;

use crate::error::RenderError;
use crate::frame::FrameContext;
use crate::gpu::{Gpu, Kernel, Slot};
use crate::stages::layout::{Entry, GROUP, Params, SCAN_BLOCK};

/// The shader.
pub const SOURCE: &str = concat!(include_str!("../prelude.wgsl"), include_str!("bin.wgsl"));

/// The compiled stage.
pub struct Bin {
    count: Kernel,
    scan_blocks: Kernel,
    scan_sums: Kernel,
    scan_add: Kernel,
    scatter: Kernel,
}

/// Lists of a picture: screen tiles times slices.
pub fn list_count(params: &Params) -> u32 {
    params.tiles_x * params.tiles_y * params.slices
}

impl Bin {
    /// Compiles `source`, [`SOURCE`] but for tests.
    pub fn new(gpu: &Gpu, source: &str) -> Self {
        let kernel = |entry| gpu.kernel("bin", source, entry);
        Self {
            count: kernel("count"),
            scan_blocks: kernel("scan_blocks"),
            scan_sums: kernel("scan_sums"),
            scan_add: kernel("scan_add"),
            scatter: kernel("scatter"),
        }
    }

    /// Fills the slots of entries and of the ends of their lists.
    pub fn record(&self, frame: &mut FrameContext<'_>) -> Result<(), RenderError> {
        let particles = frame.params.particle_count;
        let lists = list_count(&frame.params);
        let splats = frame.room(Slot::Splats, 4)?;
        let counts = frame.room(Slot::Counts, u64::from(lists) * 4)?;
        let sums = frame.room(Slot::BlockSums, u64::from(lists.div_ceil(SCAN_BLOCK)) * 4)?;
        let entries = frame.room(
            Slot::Entries,
            u64::from(frame.params.entry_capacity) * size_of::<Entry>() as u64,
        )?;
        let params = &frame.params_buffer;
        let recorder = &mut frame.recorder;
        recorder.clear(&counts, u64::from(lists) * 4);
        recorder.dispatch_list(
            &self.count,
            &[(0, params), (1, &splats), (2, &counts)],
            particles,
            GROUP,
        );
        let scan = [(0, params), (2, &counts), (3, &sums)];
        recorder.dispatch_list(&self.scan_blocks, &scan, lists, SCAN_BLOCK);
        recorder.dispatch(&self.scan_sums, &[(0, params), (3, &sums)], [1, 1]);
        recorder.dispatch_list(&self.scan_add, &scan, lists, SCAN_BLOCK);
        let all = [(0, params), (1, &splats), (2, &counts), (4, &entries)];
        recorder.dispatch_list(&self.scatter, &all, particles, GROUP);
        Ok(())
    }
}
