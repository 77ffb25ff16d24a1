//! What the stages of one frame share while they are recorded: the device, the plan and the frame's buffers.

use std::ops::Range;

use bytemuck::Pod;

use crate::coast::sea_floor;
use crate::error::RenderError;
use crate::gpu::{Gpu, Recorder, Slot, Workspace};
use crate::plan::Plan;
use crate::scene::{Cells, Interval, Scene};
use crate::stages::features::Features;
use crate::stages::params::Params;
use crate::stages::sizes::light_bytes;

/// The fields of a scene on the device.
#[derive(Clone)]
pub struct SceneBuffers {
    pub value: [wgpu::Buffer; 2],
    pub accumulated: Option<[wgpu::Buffer; 2]>,
    pub northward: Option<[wgpu::Buffer; 2]>,
    pub domain: wgpu::Buffer,
    /// Uncertainties of both fields of values; none where they are not drawn.
    pub uncertainties: Option<[wgpu::Buffer; 2]>,
    pub terrain: Option<wgpu::Buffer>,
    /// Light that is shared between pictures; none where a picture makes its own.
    pub light: Option<wgpu::Buffer>,
}

impl SceneBuffers {
    /// Those of a scene without shared light: `send` brings cells to the device, `held` of them those of fields.
    pub fn of(
        scene: &Scene,
        held: &Range<usize>,
        has_uncertainty: bool,
        domain: wgpu::Buffer,
        send: impl Fn(&Cells<f32>, Range<usize>) -> Result<wgpu::Buffer, RenderError>,
    ) -> Result<Self, RenderError> {
        let pair = |[before, after]: [&Cells<f32>; 2]| -> Result<[wgpu::Buffer; 2], RenderError> {
            Ok([send(before, held.clone())?, send(after, held.clone())?])
        };
        let fields = |interval: &Interval| pair([&interval.before.cells, &interval.after.cells]);
        let steps = [&scene.value.before, &scene.value.after];
        let uncertainties = || pair(steps.map(|field| field.uncertainties()));
        let terrain = scene.terrain.as_ref();
        let terrain = terrain.map(|terrain| &terrain.elevation.cells);
        Ok(Self {
            value: fields(&scene.value)?,
            accumulated: scene.accumulated.as_ref().map(fields).transpose()?,
            northward: scene.northward.as_ref().map(fields).transpose()?,
            domain,
            uncertainties: has_uncertainty.then(uncertainties).transpose()?,
            terrain: terrain
                .map(|cells| send(cells, 0..cells.content().len()))
                .transpose()?,
            light: None,
        })
    }
}

/// What the stages of one frame share while they are recorded.
pub struct FrameContext<'a> {
    pub gpu: &'a Gpu,
    pub recorder: Recorder<'a>,
    pub plan: &'a Plan,
    pub params: Params,
    /// What kernels may be compiled for.
    pub features: Features,
    pub params_buffer: wgpu::Buffer,
    pub scene: SceneBuffers,
    workspace: &'a mut Workspace,
}

impl<'a> FrameContext<'a> {
    /// A frame of one part of the plan's picture in the buffers of `workspace`.
    pub fn new(
        gpu: &'a Gpu,
        workspace: &'a mut Workspace,
        plan: &'a Plan,
        mut params: Params,
        scene: SceneBuffers,
    ) -> Result<Self, RenderError> {
        // Steps without a filled gap have no uncertainties to read.
        params.values.has_uncertainty &= u32::from(scene.uncertainties.is_some());
        let params_buffer = workspace.upload(gpu, Slot::Params, &params.packed())?;
        let mut recorder = gpu.recorder();
        recorder.read_uniforms(params_buffer.clone());
        Ok(Self {
            gpu,
            recorder,
            plan,
            params,
            features: Features::of(&params),
            params_buffer,
            scene,
            workspace,
        })
    }

    /// The buffer of a slot with room for `bytes`.
    pub fn room(&mut self, slot: Slot, bytes: u64) -> Result<wgpu::Buffer, RenderError> {
        self.workspace.room(self.gpu, slot, bytes)
    }

    /// The light: the shared one, or room for the frame's own.
    pub fn light(&mut self) -> Result<wgpu::Buffer, RenderError> {
        match &self.scene.light {
            Some(light) => Ok(light.clone()),
            None => self.room(Slot::Light, light_bytes(&self.params)),
        }
    }

    /// The buffer of a slot with this content.
    pub fn upload<T: Pod>(
        &mut self,
        slot: Slot,
        content: &[T],
    ) -> Result<wgpu::Buffer, RenderError> {
        self.workspace.upload(self.gpu, slot, content)
    }

    /// The buffer of a slot with this content of the plan; sent once for all frames of a plan in one workspace.
    pub fn upload_of_plan<T: Pod>(
        &mut self,
        slot: Slot,
        content: &[T],
    ) -> Result<wgpu::Buffer, RenderError> {
        let plan = self.plan.id;
        self.workspace.upload_once(self.gpu, slot, plan, content)
    }

    /// The coarse relief of the program, sent once for all frames of a workspace.
    pub fn sea_floor(&mut self) -> Result<wgpu::Buffer, RenderError> {
        // Plans count from 1.
        let owner = u64::MAX;
        self.workspace
            .upload_once(self.gpu, Slot::SeaFloor, owner, &sea_floor::HEIGHTS_M)
    }

    /// Pixels of the part.
    pub fn pixel_count(&self) -> u64 {
        u64::from(self.params.view.size_px.element_product())
    }
}
