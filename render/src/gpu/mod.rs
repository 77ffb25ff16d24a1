//! The graphics device behind plain verbs: make buffers and kernels, record dispatches, read results back.

mod fault;
mod found;
mod kernel;
mod memory;
mod pipelines;
mod recorder;
mod stamps;
mod uniforms;
mod workspace;

pub use found::adapters;
pub use kernel::Kernel;
pub use recorder::Recorder;
pub use stamps::{Stamped, Stamps};
pub use uniforms::{FIRST_UNIFORM, packed, uniform};
pub use workspace::{Slot, Workspace};

use bytemuck::Pod;
use wgpu::util::DeviceExt as _;

use crate::adapter::Adapter;
use crate::backend::{self, Backend};
use crate::error::RenderError;
use fault::FaultNote;
pub(crate) use found::{Found, found};
use pipelines::Pipelines;

/// Largest buffer asked for, also on devices that would give more: bounds what one job can take.
const MOST_BUFFER_BYTES: u64 = (2 << 30) - 4;

/// Features that are used where a device has them; pictures are the same without.
const WELCOME: wgpu::Features = wgpu::Features::TIMESTAMP_QUERY
    .union(wgpu::Features::FLOAT32_BLENDABLE)
    .union(wgpu::Features::PIPELINE_CACHE);

/// A device with its queue. Shared by all threads.
pub struct Gpu {
    device: wgpu::Device,
    queue: wgpu::Queue,
    adapter: Adapter,
    most_buffer_bytes: u64,
    checks: Checks,
    fault: FaultNote,
    pipelines: Option<Pipelines>,
}

/// What shaders check while they run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Checks {
    /// Nothing: indices and loops are bounded by the stages themselves.
    Trusted,
    /// Every index and every loop, many times slower: for tests.
    Full,
}

impl Gpu {
    /// Opens the most able Vulkan adapter, a software one if there is no other; the first of several.
    pub fn open() -> Result<Self, RenderError> {
        Self::first_of(&Backend::Gpu, Checks::Trusted)
    }

    /// The same with shaders that check themselves.
    pub fn open_checked() -> Result<Self, RenderError> {
        Self::first_of(&Backend::Gpu, Checks::Full)
    }

    /// The first adapter that a backend means.
    pub(crate) fn first_of(backend: &Backend, checks: Checks) -> Result<Self, RenderError> {
        let found = found::found();
        let there: Vec<Adapter> = found.iter().map(|found| found.known.clone()).collect();
        let chosen = backend::chosen(backend, &there)?;
        let &first = chosen.first().ok_or(RenderError::NoAdapter)?;
        Self::on(&found[first], checks)
    }

    /// Opens a device on an adapter.
    pub(crate) fn on(found: &Found, checks: Checks) -> Result<Self, RenderError> {
        let Found {
            adapter,
            info,
            known,
        } = found;
        let limits = adapter.limits();
        let most_buffer_bytes = limits
            .max_buffer_size
            .min(limits.max_storage_buffer_binding_size)
            .min(MOST_BUFFER_BYTES);
        let descriptor = wgpu::DeviceDescriptor {
            required_limits: limits,
            // For measuring, and for the classic renderer that is measured beside.
            required_features: adapter.features() & WELCOME,
            ..Default::default()
        };
        let asked = pollster::block_on(adapter.request_device(&descriptor));
        let (device, queue) = asked.map_err(|source| RenderError::NoDevice {
            adapter: known.name().to_owned(),
            source: Box::new(source),
        })?;
        let fault = FaultNote::default();
        fault.listen(&device);
        let pipelines =
            pipelines::folder().and_then(|folder| Pipelines::open(&device, info, &folder));
        Ok(Self {
            device,
            queue,
            adapter: known.clone(),
            most_buffer_bytes,
            checks,
            fault,
            pipelines,
        })
    }

    /// The device itself, for what has no verb here.
    pub fn device(&self) -> &wgpu::Device {
        &self.device
    }

    /// Its queue.
    pub fn queue(&self) -> &wgpu::Queue {
        &self.queue
    }

    /// Waits until everything submitted has run.
    pub fn wait(&self) -> Result<(), RenderError> {
        let waited = self.device.poll(wgpu::PollType::wait_indefinitely());
        waited.map_err(|error| self.stopped("drawing", &error))?;
        self.check_fault("drawing")
    }

    /// What draws.
    pub fn adapter(&self) -> &Adapter {
        &self.adapter
    }

    /// Name of the adapter.
    pub fn adapter_name(&self) -> &str {
        self.adapter.name()
    }

    /// Is it a software adapter: a program on the processor, such as lavapipe?
    pub fn is_software(&self) -> bool {
        self.adapter.is_software()
    }

    /// Does it run both sides of a condition, on vectors, so that what a picture has not is better not compiled?
    pub fn runs_both_sides(&self) -> bool {
        self.is_software() && self.checks == Checks::Trusted
    }

    /// Is what needs no kernels left to plain code? On a processor both have the same cores, and plain code need not ask at
    /// every pixel what a whole row shares; kernels on trial are run.
    pub fn spares_kernels(&self) -> bool {
        self.is_software() && self.checks == Checks::Trusted
    }

    /// Bytes of memory that are the device's own; none where that is the computer's, or where nobody says.
    pub fn own_bytes(&self) -> Option<u64> {
        self.adapter.own_bytes()
    }

    /// Largest storage buffer of this device.
    pub fn most_buffer_bytes(&self) -> u64 {
        self.most_buffer_bytes
    }

    /// An error if the device had a fault at any time; `what` was being done.
    pub fn check_fault(&self, what: &'static str) -> Result<(), RenderError> {
        self.fault.check(what)
    }

    /// Has the device had a fault?
    pub(crate) fn has_fault(&self) -> bool {
        self.fault.is_there()
    }

    /// Notes that the device does not answer any more, which is a fault of its own.
    pub(crate) fn stopped(
        &self,
        what: &'static str,
        reason: &dyn std::fmt::Display,
    ) -> RenderError {
        self.fault.note_stopped(reason.to_string());
        RenderError::DeviceStopped { what }
    }

    /// Loses the device as a driver would, for tests of what happens then.
    pub fn lose(&self) {
        self.device.destroy();
    }

    /// Compiles one entry point.
    pub fn kernel(&self, label: &'static str, source: &str, entry: &str) -> Kernel {
        self.variant(label, source, entry, &[])
    }

    /// The same with values of its override constants; one that is not named keeps the value in the source.
    pub fn variant(
        &self,
        label: &'static str,
        source: &str,
        entry: &str,
        constants: &[(&str, f64)],
    ) -> Kernel {
        Kernel::new(self, label, source, entry, constants)
    }

    /// Keeps what has been compiled for the next process.
    pub fn keep_pipelines(&self) {
        if let Some(pipelines) = &self.pipelines {
            pipelines.keep();
        }
    }

    fn encoder(&self) -> wgpu::CommandEncoder {
        let of_recorder = wgpu::CommandEncoderDescriptor::default();
        self.device.create_command_encoder(&of_recorder)
    }

    /// A list of commands to fill.
    pub fn recorder(&self) -> Recorder<'_> {
        Recorder::new(self)
    }

    /// A small buffer of constants.
    pub fn uniform<T: Pod>(&self, label: &str, content: &T) -> wgpu::Buffer {
        self.device
            .create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: Some(label),
                contents: bytemuck::bytes_of(content),
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::STORAGE,
            })
    }

    /// A storage buffer with this content.
    pub fn storage<T: Pod>(
        &self,
        label: &'static str,
        content: &[T],
    ) -> Result<wgpu::Buffer, RenderError> {
        let contents: &[u8] = bytemuck::cast_slice(content);
        self.check_size(label, contents.len() as u64)?;
        // An empty binding is not allowed; nobody reads the word.
        let contents = if contents.is_empty() {
            &[0; 4]
        } else {
            contents
        };
        Ok(self
            .device
            .create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: Some(label),
                contents,
                usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
            }))
    }

    /// A storage buffer of so many bytes, zero at first.
    pub fn room(&self, label: &'static str, bytes: u64) -> Result<wgpu::Buffer, RenderError> {
        self.check_size(label, bytes)?;
        Ok(self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: bytes.max(4),
            usage: wgpu::BufferUsages::STORAGE
                | wgpu::BufferUsages::COPY_SRC
                | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        }))
    }

    fn check_size(&self, what: &'static str, bytes: u64) -> Result<(), RenderError> {
        let limit = self.most_buffer_bytes;
        if bytes > limit {
            Err(RenderError::TooLarge { what, bytes, limit })
        } else {
            Ok(())
        }
    }
}
