//! The first pass over particles: cells of four fields in; stored splats, the depth given to the light and the lengths of
//! the lists out. See `splat.wgsl`.
//!
//! It runs the functions of [`interpolate`](crate::stages::interpolate), [`particles`](crate::stages::particles),
//! [`project`](crate::stages::project), [`light`](crate::stages::light) and [`bin`](crate::stages::bin), each with its own twin: between them
//! nothing is worth storing.

use crate::error::RenderError;
use crate::frame_context::FrameContext;
use crate::gpu::Gpu;
use crate::passes::Pass;
use crate::passes::store::Stored;
use crate::stages::bin::params::ListParams;
use crate::stages::layout::{BEYOND_BIT, RADIUS_BITS, SUBPIXELS, Splat};
use crate::stages::params::Uniform::{
    Cells, Grid, Lighting, Lists, Particles, Projection, Values, View,
};

/// The shader.
pub const SOURCE: &str = concat!(
    include_str!("../../stages/prelude.wgsl"),
    include_str!("../../stages/interpolate/between.wgsl"),
    include_str!("../../stages/particles/particles.wgsl"),
    include_str!("../../stages/uncertainty.wgsl"),
    include_str!("../../stages/coverage.wgsl"),
    include_str!("../../stages/water.wgsl"),
    include_str!("../../stages/project/project.wgsl"),
    include_str!("../../stages/light/texel.wgsl"),
    include_str!("../../stages/light/deposit.wgsl"),
    include_str!("../../stages/bin/lists.wgsl"),
    include_str!("../../stages/bin/reach.wgsl"),
    include_str!("../tally.wgsl"),
    include_str!("../order.wgsl"),
    include_str!("../store.wgsl"),
    include_str!("splat.wgsl"),
);

/// The compiled stage.
pub struct Splats {
    splat: Pass,
}

/// A splat as a device stores it: the words of both halves, as `splat.wgsl` writes them.
pub fn unpacked(seen: [u32; 4], lit: [u32; 4], lists: &ListParams) -> Splat {
    Splat {
        x_sub: seen[0] as i32,
        y_sub: seen[1] as i32,
        radius_px: ((seen[2] & RADIUS_BITS) << lists.entry_shift) as f32 / SUBPIXELS as f32,
        tau: (seen[2] >> 16) as f32 / lists.depth_one,
        slice: f32::from_bits(lit[2]),
        light_u: lit[0] as i32,
        light_v: lit[1] as i32,
        light_depth: 0.0,
        day: f32::from_bits(lit[3]),
        colour: seen[3],
        is_beyond: u32::from(seen[2] & BEYOND_BIT != 0),
        slope: 0,
    }
}

impl Splats {
    /// Compiles `source`, [`SOURCE`] but for tests, with a table of sums of so many probes.
    pub fn new(gpu: &Gpu, source: &str, probes: u32) -> Self {
        Self {
            splat: Pass::new(
                gpu,
                "splat",
                source,
                probes,
                &[
                    View, Grid, Values, Cells, Particles, Projection, Lighting, Lists,
                ],
            ),
        }
    }

    /// Fills the slots of splats, of light and of list lengths.
    pub fn record(&self, frame: &mut FrameContext<'_>) -> Result<(), RenderError> {
        let stored = Stored::room(frame)?;
        let scene = frame.scene.clone();
        let [before, after] = &scene.value;
        // Bound but never read where nothing is accumulated.
        let [carbon_before, carbon_after] = scene.accumulated.as_ref().unwrap_or(&scene.value);
        // Bound but never read where uncertainty is not drawn.
        let [uncertainty_before, uncertainty_after] =
            scene.uncertainties.as_ref().unwrap_or(&scene.value);
        let buffers = stored.with([
            (4, before),
            (5, after),
            (6, carbon_before),
            (7, carbon_after),
            (12, uncertainty_before),
            (13, uncertainty_after),
            (14, &scene.domain),
        ]);
        self.splat.record(frame, &buffers);
        Ok(())
    }
}
