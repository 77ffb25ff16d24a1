//! The buffers that a pass over particles fills, and the tables of the plan that it reads: see `store.wgsl`.

use crate::error::RenderError;
use crate::frame_context::FrameContext;
use crate::gpu::Slot;
use crate::stages::layout::{LIGHT_ALONE, LIGHT_OWN};
use crate::stages::sizes::{HALF_BYTES, light_bytes, list_count};

/// What `store.wgsl` binds.
pub(super) struct Stored {
    buffers: [(u32, wgpu::Buffer); 7],
}

impl Stored {
    /// Room for the splats of a frame; light and list lengths are zero.
    pub(super) fn room(frame: &mut FrameContext<'_>) -> Result<Self, RenderError> {
        let plan = frame.plan;
        let rows = frame.upload_of_plan(Slot::Rows, &plan.rows)?;
        let cols = frame.upload_of_plan(Slot::Cols, &plan.cols)?;
        let palette = frame.upload_of_plan(Slot::Palette, &plan.palette)?;
        let light_on = frame.params.lighting.mode;
        // Light alone stores nothing else.
        let is_stored = u64::from(light_on != LIGHT_ALONE);
        let half_bytes = is_stored * u64::from(frame.params.cells.splat_count) * HALF_BYTES;
        let seen = frame.room(Slot::Seen, half_bytes)?;
        let lit = frame.room(Slot::Lit, half_bytes)?;
        let light = frame.light()?;
        let count_bytes = u64::from(list_count(&frame.params)) * 4;
        let counts = frame.room(Slot::Counts, count_bytes)?;
        if matches!(light_on, LIGHT_OWN | LIGHT_ALONE) {
            frame.recorder.clear(&light, light_bytes(&frame.params));
        }
        frame.recorder.clear(&counts, count_bytes);
        let buffers = [
            (1, rows),
            (2, cols),
            (3, palette),
            (8, seen),
            (9, light),
            (10, counts),
            (11, lit),
        ];
        Ok(Self { buffers })
    }

    /// The bindings of a pass: these and its own.
    pub(super) fn with<'a>(
        &'a self,
        own: impl IntoIterator<Item = (u32, &'a wgpu::Buffer)>,
    ) -> Vec<(u32, &'a wgpu::Buffer)> {
        let shared = self.buffers.iter();
        let shared = shared.map(|(binding, buffer)| (*binding, buffer));
        shared.chain(own).collect()
    }
}
