//! What draws: an adapter's name, how it is reached, what kind of thing it is, and how much it should have to do at once.

use std::num::NonZeroUsize;
use std::thread;

/// Pictures at once on a graphics card: one is drawn while others are planned, sent and read back, which takes ten times as
/// long; more than these gain a few in a hundred and want memory of the card.
const ON_A_CARD: NonZeroUsize = NonZeroUsize::new(8).expect("8 is not 0");
/// Pictures at once on a software adapter, which draws each with all cores: one is planned while another is drawn.
const IN_SOFTWARE: NonZeroUsize = NonZeroUsize::new(2).expect("2 is not 0");

/// An adapter, or the CPU twins in place of one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Adapter {
    name: String,
    backend: &'static str,
    kind: Kind,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Device(wgpu::DeviceType),
    Twins,
}

impl Adapter {
    /// One that the driver tells of.
    pub(crate) fn of(info: &wgpu::AdapterInfo) -> Self {
        Self {
            name: info.name.clone(),
            backend: info.backend.to_str(),
            kind: Kind::Device(info.device_type),
        }
    }

    /// The stages' twins on the processor.
    pub(crate) fn twins() -> Self {
        Self {
            name: "CPU twins".to_owned(),
            backend: "none",
            kind: Kind::Twins,
        }
    }

    /// Its name, as the driver gives it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// How it is reached: `vulkan`; `none` for the twins.
    pub fn backend(&self) -> &'static str {
        self.backend
    }

    /// What it is, in one word for metrics.
    pub fn kind(&self) -> &'static str {
        match self.kind {
            Kind::Device(wgpu::DeviceType::DiscreteGpu) => "discrete_gpu",
            Kind::Device(wgpu::DeviceType::IntegratedGpu) => "integrated_gpu",
            Kind::Device(wgpu::DeviceType::VirtualGpu) => "virtual_gpu",
            Kind::Device(wgpu::DeviceType::Other) => "other",
            Kind::Device(wgpu::DeviceType::Cpu) | Kind::Twins => "cpu",
        }
    }

    /// Is it a program on the processor, such as lavapipe?
    pub fn is_software(&self) -> bool {
        matches!(self.kind, Kind::Device(wgpu::DeviceType::Cpu) | Kind::Twins)
    }

    /// How many pictures should be drawn on it at the same time.
    pub fn draws_at_once(&self) -> NonZeroUsize {
        match self.kind {
            // A twin draws on one core.
            Kind::Twins => thread::available_parallelism().unwrap_or(NonZeroUsize::MIN),
            Kind::Device(wgpu::DeviceType::Cpu) => IN_SOFTWARE,
            Kind::Device(
                wgpu::DeviceType::DiscreteGpu
                | wgpu::DeviceType::IntegratedGpu
                | wgpu::DeviceType::VirtualGpu
                | wgpu::DeviceType::Other,
            ) => ON_A_CARD,
        }
    }
}
