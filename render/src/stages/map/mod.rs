//! Thematic maps: the grid at an instant in, the colour of every pixel out. See `map.wgsl`.

pub mod cpu;
pub mod params;
pub mod plain;

use crate::error::RenderError;
use crate::frame_context::FrameContext;
use crate::gpu::{Gpu, Slot};
use crate::stages::layout::Axis;
use crate::stages::params::Uniform::{Grid, Thematic, Values, View};
use crate::stages::variants::Variants;

/// The shader.
pub const SOURCE: &str = concat!(
    include_str!("../prelude.wgsl"),
    include_str!("../sphere.wgsl"),
    include_str!("../uncertainty.wgsl"),
    include_str!("../coverage.wgsl"),
    include_str!("../grid_cells.wgsl"),
    include_str!("map.wgsl")
);

/// The compiled stage.
pub struct Map {
    map: Variants,
}

impl Map {
    /// Compiles `source`, [`SOURCE`] but for tests.
    pub fn new(gpu: &Gpu, source: &str) -> Self {
        Self {
            map: Variants::new("map", source, "map", &[View, Grid, Values, Thematic])
                .compiled(gpu, &[]),
        }
    }

    /// Fills the slot of the picture.
    pub fn record(&self, frame: &mut FrameContext<'_>) -> Result<(), RenderError> {
        let plan = frame.plan;
        let value = frame.room(Slot::Value, 4)?;
        let palette = frame.upload_of_plan(Slot::Palette, &plan.palette)?;
        let axes = frame.room(
            Slot::Axes,
            (plan.axes.len().max(1) * size_of::<Axis>()) as u64,
        )?;
        if !plan.axes.is_empty() {
            frame.upload(Slot::Axes, &plan.axes)?;
        }
        let picture = frame.room(Slot::Picture, frame.pixel_count() * 16)?;
        // Bound but never read where uncertainty is not drawn.
        let scene = &frame.scene;
        let [uncertainty_before, uncertainty_after] =
            scene.uncertainties.as_ref().unwrap_or(&scene.value);
        let buffers = [
            (1, &value),
            (2, &palette),
            (3, &axes),
            (4, &picture),
            (5, uncertainty_before),
            (6, uncertainty_after),
            (7, &scene.domain),
        ];
        let groups = frame.params.view.tiles.to_array();
        let map = self.map.of(frame.gpu, &[], frame.features);
        frame.recorder.dispatch(&map, &buffers, groups);
        Ok(())
    }
}
