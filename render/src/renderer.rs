//! Jobs and scenes in, pictures out, on the adapters of a host or with the CPU twins; one renderer serves many threads.

use std::num::NonZeroUsize;

use contract::ContractError;
use contract::grid::Grid;
use contract::job::{RenderJob, View};

use crate::adapter::Adapter;
use crate::backend::Backend;
use crate::device_slot::{self, DeviceSlot};
use crate::drawing::Drawing;
use crate::error::RenderError;
use crate::gpu::Checks;
use crate::image::Image;
use crate::plan::{Part, Plan};
use crate::pyramid;
use crate::scene::Scene;
use crate::stages::fill::{self, Filled, Form};
use crate::stages::map::plain;
use crate::timings::{self, Step};

/// Draws pictures.
pub struct Renderer {
    /// Names of the adapters at the start.
    name: String,
    /// None for the CPU twins.
    devices: Vec<DeviceSlot>,
}

impl Renderer {
    /// Opens the devices and compiles the stages.
    pub fn new(backend: Backend) -> Result<Self, RenderError> {
        Self::keeping(backend, None)
    }

    /// The same with a limit of fields that stay on each device between pictures, bytes: a share of what the device has
    /// if none is named.
    pub fn keeping(backend: Backend, most_field_bytes: Option<u64>) -> Result<Self, RenderError> {
        let devices = DeviceSlot::all_of(backend, Checks::Trusted, most_field_bytes)?;
        Ok(Self::over(devices))
    }

    /// Opens the device with shaders that check every index and loop; slow, for tests.
    pub fn checked() -> Result<Self, RenderError> {
        Ok(Self::over(DeviceSlot::all_of(
            Backend::Gpu,
            Checks::Full,
            None,
        )?))
    }

    /// Opens two devices on the first adapter, for tests of how several are used on hosts that have one.
    pub fn doubled() -> Result<Self, RenderError> {
        Ok(Self::over(DeviceSlot::two_on_one(Checks::Trusted)?))
    }

    fn over(devices: Vec<DeviceSlot>) -> Self {
        let name = together(&adapters_of(&devices));
        Self { name, devices }
    }

    /// Names of the adapters at the start (`2 x` and the name for two equal ones), or of the CPU twins.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What draws now, one or more: after a fault it may be another adapter than at the start.
    pub fn adapters(&self) -> Vec<Adapter> {
        adapters_of(&self.devices)
    }

    /// How many pictures should be drawn at the same time.
    pub fn draws_at_once(&self) -> NonZeroUsize {
        let of_each = self.adapters().into_iter().map(|a| a.draws_at_once().get());
        NonZeroUsize::new(of_each.sum()).unwrap_or(NonZeroUsize::MIN)
    }

    /// How many devices were given up so far.
    pub fn device_restarts(&self) -> u64 {
        self.devices.iter().map(|slot| slot.device().number).sum()
    }

    /// Bytes of fields that stay on the devices between pictures.
    pub fn resident_bytes(&self) -> u64 {
        let bytes = |slot: &DeviceSlot| slot.device().resident_bytes();
        self.devices.iter().map(bytes).sum()
    }

    /// Pictures that are drawn on each device, in the order of [`Renderer::adapters`].
    pub fn in_flight(&self) -> Vec<usize> {
        self.devices.iter().map(DeviceSlot::in_flight).collect()
    }

    /// Opens a fresh device in place of every one that had a fault. Blocks while the shaders compile.
    ///
    /// # Errors
    /// Why the last of them could not be opened, if there is none to draw on; as long as there is one, the others are
    /// tried again the next time.
    pub fn renew(&self) -> Result<(), RenderError> {
        let mut failed = None;
        for slot in &self.devices {
            if let Err(error) = slot.renew() {
                tracing::warn!(%error, "a graphics device cannot be opened again");
                failed = Some(error);
            }
        }
        match failed {
            Some(error) if !self.has_sound_device() => Err(error),
            _ => Ok(()),
        }
    }

    /// Has any device had a fault, and is not opened again yet?
    pub fn has_fault(&self) -> bool {
        let mut slots = self.devices.iter();
        slots.any(|slot| slot.device().gpu().has_fault())
    }

    fn has_sound_device(&self) -> bool {
        let mut slots = self.devices.iter();
        slots.any(|slot| !slot.device().gpu().has_fault())
    }

    /// Loses the first device as a driver would, for tests of what happens then.
    pub fn lose_device(&self) {
        if let Some(slot) = self.devices.first() {
            slot.device().gpu().lose();
        }
    }

    /// Brings to the device what a scene is drawn from in a job's view, so that its picture need not wait for that.
    pub fn prepare(&self, job: &RenderJob, scene: &Scene) -> Result<(), RenderError> {
        scene.validate()?;
        if let (Some(alone), Some(vector)) = (job.trails_alone(), &scene.trails) {
            self.prepare(&alone, vector)?;
        }
        let coarser = pyramid::suited(job, scene);
        match device_slot::home(&self.devices, fields_of(scene)) {
            Some(device) if device.gpu().spares_kernels() && plain::may_suit(job) => Ok(()),
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
        is_wanted: &(dyn Fn() -> bool + Sync),
    ) -> Result<Image, RenderError> {
        self.render_part(job, scene, None, is_wanted)
    }

    /// Draws a part of a globe view, or all of a picture. A pixel is the same in whichever part it is drawn, so that several
    /// renderers can share a large picture.
    pub fn render_part(
        &self,
        job: &RenderJob,
        scene: &Scene,
        part: Option<Part>,
        is_wanted: &(dyn Fn() -> bool + Sync),
    ) -> Result<Image, RenderError> {
        job.validate()?;
        scene.validate()?;
        if let Some(part) = part {
            check_part(part, job)?;
        }
        let taken = device_slot::least_busy(&self.devices, fields_of(scene));
        let device = taken.as_ref().map(|taken| &taken.device);
        let most_buffer_bytes = device.map_or(u64::MAX, |device| device.gpu().most_buffer_bytes());
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
            let drawn = self.render_part(&alone, vector, None, is_wanted)?;
            plan.lay_trails(&drawn);
        }
        let is_on_processor = device.is_none_or(|device| device.gpu().spares_kernels());
        if is_on_processor && part.is_none() && plain::suits(&plan) {
            let [width, height] = plan.size_px();
            let rgba8 = timings::timed(Step::Device, || plain::draw(&plan, scene));
            return Ok(Image {
                width,
                height,
                rgba8,
            });
        }
        let drawing = Drawing {
            plan: &plan,
            scene,
            is_wanted,
        };
        drawing.draw(part.unwrap_or_else(|| plan.whole()), taken, &self.devices)
    }

    /// Fills the gaps of one field (`[row, col]`, [`MISSING`](crate::stages::layout::MISSING) or NaN where there is no
    /// data); the same bits on every device. Blocks until it is done.
    pub fn fill(
        &self,
        form: Form,
        grid: &Grid,
        values: &[f32],
        domain: &[u32],
    ) -> Result<Filled, RenderError> {
        let taken = device_slot::least_busy(&self.devices, 0);
        let on_device = taken.and_then(|taken| taken.device.fill(form, grid, values, domain));
        on_device.unwrap_or_else(|| fill::on_cpu(form, grid, values, domain))
    }
}

fn adapters_of(devices: &[DeviceSlot]) -> Vec<Adapter> {
    if devices.is_empty() {
        return vec![Adapter::twins()];
    }
    let adapter = |slot: &DeviceSlot| slot.device().gpu().adapter().clone();
    devices.iter().map(adapter).collect()
}

/// Names of adapters for people, equal ones once with their number.
fn together(adapters: &[Adapter]) -> String {
    let mut counts: Vec<(&str, usize)> = Vec::new();
    for adapter in adapters {
        match counts.iter_mut().find(|(name, _)| *name == adapter.name()) {
            Some((_, count)) => *count += 1,
            None => counts.push((adapter.name(), 1)),
        }
    }
    let shown = counts.into_iter().map(|(name, count)| match count {
        1 => name.to_owned(),
        _ => format!("{count} x {name}"),
    });
    shown.collect::<Vec<_>>().join(", ")
}

/// The field that a scene begins with, which says where pictures of it are drawn when nothing else does.
fn fields_of(scene: &Scene) -> u64 {
    scene.value.before.cells.id()
}

fn check_part(part: Part, job: &RenderJob) -> Result<(), RenderError> {
    let [width, height] = job.view.size_px();
    let is_tile = matches!(job.view, View::Tile { .. });
    if !is_tile && part.is_within([width, height]) {
        return Ok(());
    }
    let valid = if is_tile {
        "map tiles are drawn whole".to_owned()
    } else {
        format!("a part of a picture of {width} x {height} pixels lies in it")
    };
    Err(ContractError::invalid("part", &format!("{part:?}"), valid).into())
}
