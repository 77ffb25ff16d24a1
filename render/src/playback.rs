//! One view of a product played through time: what does not change stays on the device, a frame costs its drawing alone.

use contract::job::RenderJob;

use crate::error::RenderError;
use crate::frame::Stages;
use crate::frame_context::SceneBuffers;
use crate::gpu::{Gpu, Stamps, Workspace};
use crate::plan::{Part, Plan};
use crate::scene::{Cells, Scene};

/// A view with its tables and buffers on the device.
pub struct Playback<'a> {
    gpu: &'a Gpu,
    stages: &'a Stages,
    plan: Plan,
    part: Part,
    workspace: Workspace,
    /// List entries there is room for.
    capacity: u32,
}

/// The two stored steps that an instant lies between, on the device.
pub type Steps = SceneBuffers;

impl<'a> Playback<'a> {
    /// A playback of a job's view. The scene tells the range of all instants to be drawn: its fields must reach as high
    /// and as low as any of them. The picture must fit one part.
    pub fn new(
        gpu: &'a Gpu,
        stages: &'a Stages,
        job: &RenderJob,
        scene: &Scene,
    ) -> Result<Self, RenderError> {
        // Fields are held whole: what is played is looked at for long.
        let plan = Plan::holding(job, scene, gpu.most_buffer_bytes(), u64::MAX)?;
        let part = plan.whole();
        let mut playback = Self {
            gpu,
            stages,
            plan,
            part,
            workspace: Workspace::default(),
            capacity: 0,
        };
        let steps = Self::upload(gpu, scene)?;
        playback.image(&steps)?;
        // Lists grow and shrink as particles move.
        playback.capacity = playback.workspace.entry_room();
        Ok(playback)
    }

    /// The fields of a scene on the device.
    pub fn upload(gpu: &Gpu, scene: &Scene) -> Result<Steps, RenderError> {
        let send = |cells: &Cells<f32>, part| gpu.storage("field", &cells.content()[part]);
        let domain = gpu.storage("domain", scene.domain.content())?;
        let held = 0..scene.grid.cell_count();
        SceneBuffers::of(scene, &held, scene.value.has_uncertainty(), domain, send)
    }

    /// The plan that is played.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The buffers that frames are drawn in.
    pub fn workspace(&mut self) -> &mut Workspace {
        &mut self.workspace
    }

    /// Weights of the later step in values and in accumulated carbon, from the next frame on.
    pub fn seek(&mut self, value_weight: f32, accumulated_weight: f32) {
        self.plan.params.values.weight = value_weight;
        self.plan.params.values.accumulated_weight = accumulated_weight;
    }

    /// Draws an instant; the picture stays on the device. Does not wait, and so does not learn whether its lists outgrew
    /// their room: particles that find none are left out. [`Playback::image`] makes room and draws them all.
    pub fn draw(
        &mut self,
        steps: &Steps,
        stamps: Option<&Stamps>,
    ) -> Result<wgpu::SubmissionIndex, RenderError> {
        let frame = self.stages.recorded(
            self.gpu,
            &mut self.workspace,
            &self.plan,
            self.part,
            steps,
            self.capacity,
            stamps,
        )?;
        Ok(frame.recorder.submit())
    }

    /// Draws an instant and reads it back: RGBA8, red lowest.
    pub fn image(&mut self, steps: &Steps) -> Result<Vec<u8>, RenderError> {
        let (workspace, plan) = (&mut self.workspace, &self.plan);
        self.stages
            .draw(self.gpu, workspace, plan, self.part, steps)
    }
}
