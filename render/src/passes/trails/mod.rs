//! The first pass over particles that drift: the velocities of cells in; stored splats and the lengths of the lists out,
//! as [`splat`](crate::passes::splat) makes them of particles that stand in their cells.
//!
//! It runs the functions of [`flow`](crate::stages::flow) and of the stages behind it.

use crate::error::RenderError;
use crate::frame_context::FrameContext;
use crate::gpu::{Gpu, Slot};
use crate::passes::Pass;
use crate::passes::store::Stored;
use crate::stages::params::Uniform::{
    Cells, Flow, Grid, Lighting, Lists, Particles, Projection, View,
};

/// The shader.
pub const SOURCE: &str = concat!(
    include_str!("../../stages/prelude.wgsl"),
    include_str!("../../stages/particles/particles.wgsl"),
    include_str!("../../stages/water.wgsl"),
    include_str!("../../stages/project/project.wgsl"),
    include_str!("../../stages/light/texel.wgsl"),
    include_str!("../../stages/light/deposit.wgsl"),
    include_str!("../../stages/bin/lists.wgsl"),
    include_str!("../../stages/bin/reach.wgsl"),
    include_str!("../tally.wgsl"),
    include_str!("../order.wgsl"),
    include_str!("../store.wgsl"),
    include_str!("../../stages/flow/flow.wgsl"),
    include_str!("trails.wgsl"),
);

/// The compiled pass.
pub struct Trails {
    trails: Pass,
}

impl Trails {
    /// Compiles `source`, [`SOURCE`] but for tests, with a table of sums of so many probes.
    pub fn new(gpu: &Gpu, source: &str, probes: u32) -> Self {
        Self {
            trails: Pass::new(
                gpu,
                "trails",
                source,
                probes,
                &[
                    View, Grid, Cells, Particles, Flow, Projection, Lighting, Lists,
                ],
            ),
        }
    }

    /// Fills the slots of splats, of light and of list lengths from that of velocities.
    pub fn record(&self, frame: &mut FrameContext<'_>) -> Result<(), RenderError> {
        let velocity = frame.room(Slot::Velocity, 8)?;
        let stored = Stored::room(frame)?;
        let buffers = stored.with([(4, &velocity)]);
        self.trails.record(frame, &buffers);
        Ok(())
    }
}
