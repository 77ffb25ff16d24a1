//! One frame on the GPU: the stages in order. `frame_cpu.rs` lists the same stages in the same order.

use contract::job::Mode;

use crate::error::RenderError;
use crate::frame_context::{FrameContext, SceneBuffers};
use crate::gpu::{Gpu, Slot, Stamps, Workspace};
use crate::passes;
use crate::passes::scatter::{self, Scatter};
use crate::passes::splat::{self, Splats};
use crate::passes::trails::{self, Trails};
use crate::plan::{Part, Plan};
use crate::stages::bin::Bin;
use crate::stages::compose::Compose;
use crate::stages::eye::Eye;
use crate::stages::flow::Flow;
use crate::stages::interpolate::Interpolate;
use crate::stages::isolines::Isolines;
use crate::stages::layout::{Entry, LIGHT_ALONE, LIGHT_OWN};
use crate::stages::light::Light;
use crate::stages::map::Map;
use crate::stages::sizes::{light_bytes, list_count};
use crate::stages::{bin, compose, flow, interpolate, isolines, map};
use crate::timings::{self, Step};

/// Entries a list buffer starts with for each particle; a frame that needs more is drawn again with room for all.
const FIRST_ENTRIES_PER_PARTICLE: u64 = 2;
/// Entries it starts with at least.
const FIRST_ENTRIES: u64 = 1 << 16;

/// All compiled stages.
pub struct Stages {
    isolines: Isolines,
    interpolate: Interpolate,
    flow: Flow,
    splats: Splats,
    trails: Trails,
    light: Light,
    bin: Bin,
    scatter: Scatter,
    eye: Eye,
    map: Map,
    compose: Compose,
}

impl Stages {
    /// Compiles every stage.
    pub fn new(gpu: &Gpu) -> Self {
        let probes = passes::probes(gpu);
        Self {
            isolines: Isolines::new(isolines::SOURCE),
            interpolate: Interpolate::new(gpu, interpolate::SOURCE),
            flow: Flow::new(gpu, flow::SOURCE),
            splats: Splats::new(gpu, splat::SOURCE, probes),
            trails: Trails::new(gpu, trails::SOURCE, probes),
            light: Light::new(gpu),
            bin: Bin::new(gpu, bin::SOURCE),
            scatter: Scatter::new(gpu, scatter::SOURCE, probes),
            eye: Eye::new(gpu),
            map: Map::new(gpu, map::SOURCE),
            compose: Compose::new(gpu, compose::SOURCE),
        }
    }

    fn record(&self, frame: &mut FrameContext<'_>) -> Result<(), RenderError> {
        let is_map = frame.plan.mode == Mode::Map;
        if is_map {
            self.interpolate.record(frame)?;
        }
        if frame.params.context.lines_on == 1 {
            self.isolines.record(frame)?;
        }
        if is_map {
            self.map.record(frame)?;
            self.compose.record(frame)
        } else {
            if frame.plan.mode == Mode::Flow {
                self.flow.record(frame)?;
                self.trails.record(frame)?;
            } else {
                self.splats.record(frame)?;
            }
            if frame.params.lighting.mode == LIGHT_OWN {
                self.light.record(frame)?;
            }
            self.bin.record(frame)?;
            self.scatter.record(frame)?;
            self.eye.record(frame)
        }
    }

    /// Everything that draws one part with room for `capacity` list entries, recorded but not run.
    #[expect(
        clippy::too_many_arguments,
        reason = "what a frame is made of, passed on once"
    )]
    pub fn recorded<'a>(
        &self,
        gpu: &'a Gpu,
        workspace: &'a mut Workspace,
        plan: &'a Plan,
        part: Part,
        scene: &SceneBuffers,
        capacity: u32,
        stamps: Option<&'a Stamps>,
    ) -> Result<FrameContext<'a>, RenderError> {
        let mut params = plan.params_of(part);
        params.lists.entry_capacity = capacity;
        let mut frame = FrameContext::new(gpu, workspace, plan, params, scene.clone())?;
        if let Some(stamps) = stamps {
            frame.recorder.stamp(stamps);
        }
        self.record(&mut frame)?;
        Ok(frame)
    }

    /// Makes the light of a plan for several pictures: twice the depth above the middle of each slice. Does not wait for
    /// it; what is drawn later on this device finds it there.
    pub fn shared_light(
        &self,
        gpu: &Gpu,
        workspace: &mut Workspace,
        plan: &Plan,
        scene: &SceneBuffers,
    ) -> Result<wgpu::Buffer, RenderError> {
        let mut params = plan.params_of(Part::NONE);
        params.lighting.mode = LIGHT_ALONE;
        let light = gpu.room("shared light", light_bytes(&params))?;
        let scene = SceneBuffers {
            light: Some(light.clone()),
            ..scene.clone()
        };
        let mut frame = FrameContext::new(gpu, workspace, plan, params, scene)?;
        self.splats.record(&mut frame)?;
        self.light.record(&mut frame)?;
        frame.recorder.submit();
        gpu.check_fault("making light")?;
        Ok(light)
    }

    /// Draws one part; its pixels as RGBA8, red lowest.
    pub fn draw(
        &self,
        gpu: &Gpu,
        workspace: &mut Workspace,
        plan: &Plan,
        part: Part,
        scene: &SceneBuffers,
    ) -> Result<Vec<u8>, RenderError> {
        let params = plan.params_of(part);
        if params.cells.splat_count == 0
            && plan.mode != Mode::Map
            && params.context.surface == 0
            && !params.in_context
        {
            return Ok(vec![
                0;
                part.size_px[0] as usize * part.size_px[1] as usize * 4
            ]);
        }
        let entry_bytes = size_of::<Entry>() as u64;
        let first =
            (u64::from(params.cells.splat_count) * FIRST_ENTRIES_PER_PARTICLE).max(FIRST_ENTRIES);
        let mut capacity = (workspace.room_bytes(Slot::Entries) / entry_bytes).max(first);
        loop {
            let room = capacity.min(gpu.most_buffer_bytes() / entry_bytes) as u32;
            let mut frame = timings::timed(Step::Upload, || {
                self.recorded(gpu, &mut *workspace, plan, part, scene, room, None)
            })?;
            let image = frame.room(Slot::Image, 4)?;
            let image_bytes = frame.pixel_count() * 4;
            if plan.mode == Mode::Map {
                let [pixels] = frame.recorder.download_parts([(&image, 0, image_bytes)])?;
                return Ok(pixels);
            }
            let counts = frame.room(Slot::Counts, 4)?;
            let last_end = u64::from(list_count(&params) - 1) * 4;
            let [pixels, total] = frame
                .recorder
                .download_parts([(&image, 0, image_bytes), (&counts, last_end, 4)])?;
            let total: u32 = bytemuck::pod_read_unaligned(&total);
            if total <= room {
                return Ok(pixels);
            }
            let bytes = u64::from(total) * entry_bytes;
            if bytes > gpu.most_buffer_bytes() {
                let limit = gpu.most_buffer_bytes();
                return Err(RenderError::TooLarge {
                    what: "list entries",
                    bytes,
                    limit,
                });
            }
            capacity = u64::from(total) + u64::from(total / 4);
        }
    }
}
