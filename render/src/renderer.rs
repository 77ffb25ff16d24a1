//! Jobs and scenes in, pictures out, on the GPU or with the CPU twins; one renderer serves many threads.

use std::sync::{Arc, Mutex, PoisonError};

use contract::grid::Grid;
use contract::job::RenderJob;

use crate::adapter::Adapter;
use crate::device::Device;
use crate::error::RenderError;
use crate::frame_cpu;
use crate::gpu::Gpu;
use crate::image::Image;
use crate::plan::{Part, Plan};
use crate::pyramid;
use crate::scene::Scene;
use crate::stages::fill::{self, Filled, Form};
use crate::stages::layout::{LIGHT_GIVEN, LIGHT_OWN};
use crate::timings::{self, Step};

/// What draws.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Backend {
    /// Compute shaders on the most able Vulkan adapter, in software where there is no graphics card.
    Gpu,
    /// The same, but never in software.
    HardwareGpu,
    /// The stages' CPU twins.
    Cpu,
}

/// Draws pictures.
pub struct Renderer {
    /// The one at the start.
    adapter: Adapter,
    /// None for the CPU twins.
    device: Option<DeviceSlot>,
}

/// The device in use; another takes its place after a fault, while pictures under way keep the old one.
struct DeviceSlot {
    open: fn() -> Result<Gpu, RenderError>,
    most_frame_bytes: Option<u64>,
    current: Mutex<Arc<Device>>,
    /// Held while a fresh device is opened, so that only one is.
    opening: Mutex<()>,
}

impl Renderer {
    /// Opens the device and compiles the stages.
    pub fn new(backend: Backend) -> Result<Self, RenderError> {
        Self::keeping(backend, None)
    }

    /// The same with a limit of frames that stay on the device between pictures, bytes: a share of what the device has
    /// if none is named.
    pub fn keeping(backend: Backend, most_frame_bytes: Option<u64>) -> Result<Self, RenderError> {
        match backend {
            Backend::Cpu => Ok(Self {
                adapter: Adapter::twins(),
                device: None,
            }),
            Backend::Gpu => Self::on(Gpu::open, most_frame_bytes),
            Backend::HardwareGpu => Self::on(Gpu::open_hardware, most_frame_bytes),
        }
    }

    /// Opens the device with shaders that check every index and loop; slow, for tests.
    pub fn checked() -> Result<Self, RenderError> {
        Self::on(Gpu::open_checked, None)
    }

    fn on(
        open: fn() -> Result<Gpu, RenderError>,
        most_frame_bytes: Option<u64>,
    ) -> Result<Self, RenderError> {
        let device = Device::new(open()?, 0, most_frame_bytes)?;
        Ok(Self {
            adapter: device.gpu().adapter().clone(),
            device: Some(DeviceSlot {
                open,
                most_frame_bytes,
                current: Mutex::new(Arc::new(device)),
                opening: Mutex::default(),
            }),
        })
    }

    /// Name of the adapter, or of the CPU twins.
    pub fn name(&self) -> &str {
        self.adapter.name()
    }

    /// What draws now: after a fault it may be another adapter than at the start.
    pub fn adapter(&self) -> Adapter {
        self.device().map_or_else(
            || self.adapter.clone(),
            |device| device.gpu().adapter().clone(),
        )
    }

    /// The device to draw on now.
    fn device(&self) -> Option<Arc<Device>> {
        self.device.as_ref().map(|slot| Arc::clone(&slot.lock()))
    }

    /// How many devices were given up so far.
    pub fn device_number(&self) -> u64 {
        self.device().map_or(0, |device| device.number)
    }

    /// Bytes of frames that stay on the device between pictures.
    pub fn resident_bytes(&self) -> u64 {
        self.device().map_or(0, |device| device.resident_bytes())
    }

    /// Opens a fresh device in place of the one of this number; does nothing if that one is gone already. Blocks while
    /// the shaders compile.
    pub fn renew(&self, failed_number: u64) -> Result<(), RenderError> {
        let Some(slot) = &self.device else {
            return Ok(());
        };
        let _one_at_a_time = slot.opening.lock().unwrap_or_else(PoisonError::into_inner);
        if slot.lock().number == failed_number {
            let adapter = self.name();
            tracing::warn!(adapter, "the graphics device failed, opening it again");
            let fresh = Device::new((slot.open)()?, failed_number + 1, slot.most_frame_bytes)?;
            *slot.lock() = Arc::new(fresh);
        }
        Ok(())
    }

    /// Loses the device as a driver would, for tests of what happens then.
    pub fn lose_device(&self) {
        if let Some(device) = self.device() {
            device.gpu().lose();
        }
    }

    /// Brings to the device what a scene is drawn from in a job's view, so that its picture need not wait for that.
    pub fn prepare(&self, job: &RenderJob, scene: &Scene) -> Result<(), RenderError> {
        scene.validate()?;
        if let (Some(alone), Some(vector)) = (job.trails_alone(), &scene.trails) {
            self.prepare(&alone, vector)?;
        }
        let coarser = pyramid::suited(job, scene);
        match self.device() {
            Some(device) => device.prepare(coarser.as_ref().unwrap_or(scene)),
            None => Ok(()),
        }
    }

    /// Draws a job. Blocks until the picture is there.
    pub fn render(&self, job: &RenderJob, scene: &Scene) -> Result<Image, RenderError> {
        self.render_while(job, scene, &|| true)
    }

    /// Draws a job for as long as it is wanted; asks between the parts of the picture.
    pub fn render_while(
        &self,
        job: &RenderJob,
        scene: &Scene,
        is_wanted: &dyn Fn() -> bool,
    ) -> Result<Image, RenderError> {
        let device = self.device();
        let most_buffer_bytes = device
            .as_ref()
            .map_or(u64::MAX, |device| device.gpu().most_buffer_bytes());
        job.validate()?;
        scene.validate()?;
        let coarser = pyramid::suited(job, scene);
        let scene = coarser.as_ref().unwrap_or(scene);
        if !is_wanted() {
            return Err(RenderError::NotWanted);
        }
        let mut plan = timings::timed(Step::Plan, || match &device {
            None => Plan::new(job, scene, most_buffer_bytes),
            Some(_device) => Plan::for_device(job, scene, most_buffer_bytes),
        })?;
        if let (Some(alone), Some(vector)) = (job.trails_alone(), &scene.trails) {
            // A picture of its own, which the stages of this one lay on the sea.
            let drawn = self.render_while(&alone, vector, is_wanted)?;
            plan.lay_trails(&drawn);
        }
        let parts = plan.parts();
        let light = match &device {
            // Parts of one picture lie in one light.
            Some(device) if parts.len() > 1 && plan.params.lighting.mode == LIGHT_OWN => {
                let light = device.light(&plan, scene)?;
                plan.params.lighting.mode = LIGHT_GIVEN;
                Some(light)
            }
            _ => None,
        };
        let [width, height] = plan.size_px();
        let draw = |part: Part| match &device {
            _ if !is_wanted() => Err(RenderError::NotWanted),
            None => frame_cpu::draw(&plan, part, scene),
            Some(device) => device.draw(&plan, part, scene, light.as_ref()),
        };
        if let [whole] = parts[..] {
            let rgba8 = draw(whole)?;
            return Ok(Image {
                width,
                height,
                rgba8,
            });
        }
        let mut image = Image {
            width,
            height,
            rgba8: vec![0; width as usize * height as usize * 4],
        };
        for part in parts {
            paste(&mut image, part, &draw(part)?);
        }
        Ok(image)
    }

    /// Fills the gaps of one frame (`[row, col]`, [`MISSING`](crate::stages::layout::MISSING) or NaN where there is no
    /// data); the same bits on every device. Blocks until it is done.
    pub fn fill(
        &self,
        form: Form,
        grid: &Grid,
        values: &[f32],
        domain: &[u32],
    ) -> Result<Filled, RenderError> {
        let device = self.device();
        let on_device = device.and_then(|device| device.fill(form, grid, values, domain));
        on_device.unwrap_or_else(|| fill::on_cpu(form, grid, values, domain))
    }
}

impl DeviceSlot {
    fn lock(&self) -> std::sync::MutexGuard<'_, Arc<Device>> {
        // The slot is changed by one assignment, so a poisoned lock still guards a whole device.
        self.current.lock().unwrap_or_else(PoisonError::into_inner)
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
