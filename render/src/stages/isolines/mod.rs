//! Isolines and the graticule: the fields around an instant in; how much of every pixel lines on the sea surface cover out.
//! See `isolines.wgsl`; composition lays them into the picture.

pub mod cpu;
pub mod params;

use crate::error::RenderError;
use crate::frame_context::FrameContext;
use crate::gpu::Slot;
use crate::stages::params::Uniform::{Grid, Isolines as Own, Values, View};
use crate::stages::variants::Variants;

/// The shader.
pub const SOURCE: &str = concat!(
    include_str!("../prelude.wgsl"),
    include_str!("../sphere.wgsl"),
    include_str!("../interpolate/between.wgsl"),
    include_str!("../coverage.wgsl"),
    include_str!("../grid_cells.wgsl"),
    include_str!("isolines.wgsl")
);

/// The stage, compiled when it is first wanted.
pub struct Isolines {
    lines: Variants,
}

impl Isolines {
    /// Of `source`, [`SOURCE`] but for tests.
    pub fn new(source: &str) -> Self {
        Self {
            lines: Variants::new("isolines", source, "draw_lines", &[View, Grid, Values, Own]),
        }
    }

    /// Fills the slot of lines.
    pub fn record(&self, frame: &mut FrameContext<'_>) -> Result<(), RenderError> {
        let plan = frame.plan;
        let [before, after] = frame.scene.value.clone();
        let domain = frame.scene.domain.clone();
        // Globe views have no axes: what is bound there is never read.
        let axes = if plan.axes.is_empty() {
            frame.room(Slot::Axes, 8)?
        } else {
            frame.upload(Slot::Axes, &plan.axes)?
        };
        let ground_axes = if plan.ground_axes.is_empty() {
            frame.room(Slot::GroundAxes, 16)?
        } else {
            frame.upload_of_plan(Slot::GroundAxes, &plan.ground_axes)?
        };
        let levels = frame.upload(Slot::IsolineLevels, &plan.isolines)?;
        let lines = frame.room(Slot::Isolines, frame.pixel_count() * 4)?;
        let kernel = self.lines.of(frame.gpu, &[], frame.features);
        let buffers = [
            (1, &before),
            (2, &after),
            (3, &domain),
            (4, &axes),
            (5, &ground_axes),
            (6, &levels),
            (7, &lines),
        ];
        let groups = frame.params.view.tiles.to_array();
        frame.recorder.dispatch(&kernel, &buffers, groups);
        Ok(())
    }
}
