//! A device with its compiled stages, the buffers that frames are drawn in and the fields that stay on it.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use contract::grid::Grid;

use crate::error::RenderError;
use crate::frame::Stages;
use crate::frame_context::SceneBuffers;
use crate::gpu::{Gpu, Workspace};
use crate::plan::{Part, Plan};
use crate::resident::Resident;
use crate::scene::{Cells, Scene};
use crate::stages::fill::{self, Fill, Filled, Form};

/// Everything that lives and dies with one device.
pub(crate) struct Device {
    gpu: Gpu,
    stages: Stages,
    fill: Fill,
    /// Buffers of frames that are not in flight; as many as ever were in flight at once.
    idle: Mutex<Vec<Workspace>>,
    /// Fields of products that were drawn lately.
    resident: Resident,
    /// How many devices this process had before.
    pub(crate) number: u64,
}

impl Device {
    /// Compiles the stages. Fields of `most_field_bytes` stay between pictures, of a share of the device if none are named.
    pub(crate) fn new(
        gpu: Gpu,
        number: u64,
        most_field_bytes: Option<u64>,
    ) -> Result<Self, RenderError> {
        let stages = Stages::new(&gpu);
        let fill = Fill::new(&gpu, fill::Sources::default());
        gpu.check_fault("compiling shaders")?;
        gpu.keep_pipelines();
        tracing::info!(adapter = gpu.adapter_name(), number, "renderer is ready");
        let resident = Resident::new(&gpu, most_field_bytes);
        Ok(Self {
            gpu,
            stages,
            fill,
            idle: Mutex::default(),
            resident,
            number,
        })
    }

    pub(crate) fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Bytes of fields that stay on the device.
    pub(crate) fn resident_bytes(&self) -> u64 {
        self.resident.bytes()
    }

    /// Draws one part of a picture, in the light that all parts lie in if there is any.
    pub(crate) fn draw(
        &self,
        plan: &Plan,
        part: Part,
        scene: &Scene,
        light: Option<&wgpu::Buffer>,
    ) -> Result<Vec<u8>, RenderError> {
        let mut buffers = self.scene_buffers(
            scene,
            &plan.held_cells(),
            plan.params.values.has_uncertainty == 1,
        )?;
        buffers.light = light.cloned();
        self.in_workspace(|workspace| self.stages.draw(&self.gpu, workspace, plan, part, &buffers))
    }

    /// Makes the light that all parts of a picture lie in.
    pub(crate) fn light(&self, plan: &Plan, scene: &Scene) -> Result<wgpu::Buffer, RenderError> {
        let buffers = self.scene_buffers(
            scene,
            &plan.held_cells(),
            plan.params.values.has_uncertainty == 1,
        )?;
        self.in_workspace(|workspace| {
            self.stages
                .shared_light(&self.gpu, workspace, plan, &buffers)
        })
    }

    fn in_workspace<T>(
        &self,
        work: impl FnOnce(&mut Workspace) -> Result<T, RenderError>,
    ) -> Result<T, RenderError> {
        // A poisoned pool is whole: workspaces are only pushed and popped.
        let idle = || self.idle.lock().unwrap_or_else(PoisonError::into_inner);
        let mut workspace = idle().pop().unwrap_or_default();
        let done = work(&mut workspace);
        idle().push(workspace);
        done
    }

    /// Fills the gaps of one field, if the device does that faster than the twin.
    pub(crate) fn fill(
        &self,
        form: Form,
        grid: &Grid,
        values: &[f32],
        domain: &[u32],
    ) -> Option<Result<Filled, RenderError>> {
        // A software adapter is slower than the twin, which uses the same processor without a detour.
        let pays = !self.gpu.is_software() && Fill::fits(&self.gpu, grid);
        pays.then(|| self.fill.run(&self.gpu, form, grid, values, domain))
    }

    /// Brings the fields of a scene to the device before anybody wants them, if they are held whole.
    pub(crate) fn prepare(&self, scene: &Scene) -> Result<(), RenderError> {
        if !Plan::holds_whole(&scene.grid) {
            return Ok(());
        }
        let held = 0..scene.grid.cell_count();
        self.scene_buffers(scene, &held, false).map(|_buffers| ())
    }

    fn scene_buffers(
        &self,
        scene: &Scene,
        held: &Range<usize>,
        has_uncertainty: bool,
    ) -> Result<SceneBuffers, RenderError> {
        let send = |cells: &Cells<f32>, part| self.resident.buffer(&self.gpu, cells, part);
        let domain = self
            .resident
            .buffer(&self.gpu, &scene.domain, held.clone())?;
        SceneBuffers::of(scene, held, has_uncertainty, domain, send)
    }
}
