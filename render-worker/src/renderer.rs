//! Jobs and scenes in, pictures out, on the GPU or with the CPU twins; one renderer serves many threads.

use std::sync::{Mutex, PoisonError};

use contract::grid::Grid;
use contract::job::RenderJob;

use crate::error::RenderError;
use crate::frame::{SceneBuffers, Stages};
use crate::frame_cpu;
use crate::gpu::{Gpu, Workspace};
use crate::image::Image;
use crate::plan::{Part, Plan};
use crate::pyramid;
use crate::resident::Resident;
use crate::scene::{Interval, Scene};
use crate::stages::fill::{self, Fill, FillParams};

/// What draws.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Backend {
    /// Compute shaders on the most able Vulkan adapter.
    Gpu,
    /// The stages' CPU twins.
    Cpu,
}

/// Draws pictures.
pub struct Renderer {
    device: Option<Device>,
}

struct Device {
    gpu: Gpu,
    stages: Stages,
    fill: Fill,
    /// Buffers of frames that are not in flight; as many as ever were in flight at once.
    idle: Mutex<Vec<Workspace>>,
    /// Frames of products that were drawn lately.
    resident: Resident,
}

impl Renderer {
    /// Opens the device and compiles the stages.
    pub fn new(backend: Backend) -> Result<Self, RenderError> {
        let device = match backend {
            Backend::Cpu => None,
            Backend::Gpu => Some(Device::new(Gpu::open()?)),
        };
        Ok(Self { device })
    }

    /// Opens the device with shaders that check every index and loop; slow, for tests.
    pub fn checked() -> Result<Self, RenderError> {
        Ok(Self {
            device: Some(Device::new(Gpu::open_checked()?)),
        })
    }

    /// Name of the adapter, or of the CPU twins.
    pub fn name(&self) -> &str {
        self.device
            .as_ref()
            .map_or("CPU twins", |device| device.gpu.adapter_name())
    }

    /// Draws a job. Blocks until the picture is there.
    pub fn render(&self, job: &RenderJob, scene: &Scene) -> Result<Image, RenderError> {
        let most_buffer_bytes = self
            .device
            .as_ref()
            .map_or(u64::MAX, |device| device.gpu.most_buffer_bytes());
        job.validate()?;
        scene.validate()?;
        let coarser = pyramid::suited(job, scene);
        let scene = coarser.as_ref().unwrap_or(scene);
        let plan = Plan::new(job, scene, most_buffer_bytes)?;
        let [width, height] = plan.size_px();
        let mut image = Image {
            width,
            height,
            rgba8: vec![0; width as usize * height as usize * 4],
        };
        let draw = |part: Part| match &self.device {
            None => frame_cpu::draw(&plan, part, scene),
            Some(device) => device.draw(&plan, part, scene),
        };
        for part in plan.parts() {
            paste(&mut image, part, &draw(part)?);
        }
        Ok(image)
    }

    /// Fills the gaps of one frame (`[row, col]`, [`MISSING`](crate::stages::layout::MISSING) where there is no data).
    pub fn fill(
        &self,
        grid: &Grid,
        values: &[f32],
        domain: &[u32],
    ) -> Result<Vec<f32>, RenderError> {
        // A software adapter would visit every cell where the twin visits the gaps alone.
        let pays = |device: &&Device| {
            let bytes = size_of_val(values) as u64;
            !device.gpu.is_software() && bytes <= device.gpu.most_buffer_bytes()
        };
        if let Some(device) = self.device.as_ref().filter(pays) {
            return device.fill.run(&device.gpu, grid, values, domain);
        }
        let (params, cosines) = FillParams::for_grid(grid);
        Ok(fill::cpu::fill(&params, values, domain, &cosines))
    }
}

impl Device {
    fn new(gpu: Gpu) -> Self {
        let stages = Stages::new(&gpu);
        let fill = Fill::new(&gpu, fill::SOURCE);
        tracing::info!(adapter = gpu.adapter_name(), "renderer is ready");
        Self {
            gpu,
            stages,
            fill,
            idle: Mutex::default(),
            resident: Resident::default(),
        }
    }

    fn draw(&self, plan: &Plan, part: Part, scene: &Scene) -> Result<Vec<u8>, RenderError> {
        let buffers = self.scene_buffers(scene)?;
        // A poisoned pool is whole: workspaces are only pushed and popped.
        let idle = || self.idle.lock().unwrap_or_else(PoisonError::into_inner);
        let mut workspace = idle().pop().unwrap_or_default();
        let drawn = self
            .stages
            .draw(&self.gpu, &mut workspace, plan, part, &buffers);
        idle().push(workspace);
        drawn
    }

    fn scene_buffers(&self, scene: &Scene) -> Result<SceneBuffers, RenderError> {
        let pair = |interval: &Interval| -> Result<[wgpu::Buffer; 2], RenderError> {
            let before = self.resident.buffer(&self.gpu, &interval.before.cells)?;
            Ok([
                before,
                self.resident.buffer(&self.gpu, &interval.after.cells)?,
            ])
        };
        Ok(SceneBuffers {
            value: pair(&scene.value)?,
            accumulated: scene.accumulated.as_ref().map(pair).transpose()?,
            domain: self.resident.buffer(&self.gpu, &scene.domain)?,
        })
    }
}

fn paste(image: &mut Image, part: Part, pixels: &[u8]) {
    let row_bytes = part.size_px[0] as usize * 4;
    for (y, row) in pixels.chunks_exact(row_bytes).enumerate() {
        let at = ((part.origin_px[1] as usize + y) * image.width as usize
            + part.origin_px[0] as usize)
            * 4;
        image.rgba8[at..at + row_bytes].copy_from_slice(row);
    }
}
