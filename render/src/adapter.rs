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
    driver: String,
    pci_address: Option<String>,
    own_bytes: Option<u64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Device(wgpu::DeviceType),
    Twins,
}

impl Adapter {
    /// One that the driver tells of, with the bytes of memory that are its own, if the driver says.
    pub(crate) fn of(info: &wgpu::AdapterInfo, own_bytes: Option<u64>) -> Self {
        let driver = format!("{} {}", info.driver, info.driver_info);
        let kind = Kind::Device(info.device_type);
        Self {
            name: info.name.clone(),
            backend: info.backend.to_str(),
            kind,
            driver: driver.trim().to_owned(),
            pci_address: Some(info.device_pci_bus_id.clone()).filter(|id| !id.is_empty()),
            // A software adapter, a program on the processor, has the computer's memory.
            own_bytes: own_bytes.filter(|_| !kind.is_software()),
        }
    }

    /// The stages' twins on the processor.
    pub(crate) fn twins() -> Self {
        Self {
            name: "CPU twins".to_owned(),
            backend: "none",
            kind: Kind::Twins,
            driver: String::new(),
            pci_address: None,
            own_bytes: None,
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

    /// Its driver with the version; empty for the twins.
    pub fn driver(&self) -> &str {
        &self.driver
    }

    /// Where it is plugged in, `DOMAIN:BUS:DEVICE.FUNCTION`, which tells equal cards of one host apart.
    pub fn pci_address(&self) -> Option<&str> {
        self.pci_address.as_deref()
    }

    /// Bytes of memory that are its own; none where that is the computer's, or where nobody says.
    pub fn own_bytes(&self) -> Option<u64> {
        self.own_bytes
    }

    /// Place in the order of what is taken first: 0 is a card of its own.
    pub(crate) fn rank(&self) -> u8 {
        match self.kind {
            Kind::Device(wgpu::DeviceType::DiscreteGpu) => 0,
            Kind::Device(wgpu::DeviceType::IntegratedGpu) => 1,
            Kind::Device(wgpu::DeviceType::VirtualGpu) => 2,
            Kind::Device(wgpu::DeviceType::Other) => 3,
            Kind::Device(wgpu::DeviceType::Cpu) | Kind::Twins => 4,
        }
    }

    /// Is it a software adapter: a program on the processor, such as lavapipe?
    pub fn is_software(&self) -> bool {
        self.kind.is_software()
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

impl Kind {
    fn is_software(self) -> bool {
        matches!(self, Self::Device(wgpu::DeviceType::Cpu) | Self::Twins)
    }
}

#[cfg(test)]
impl Adapter {
    /// One as a driver would tell of it, for tests of what is chosen.
    pub(crate) fn told(
        name: &str,
        device_type: wgpu::DeviceType,
        pci_address: Option<&str>,
    ) -> Self {
        Self {
            name: name.to_owned(),
            backend: "vulkan",
            kind: Kind::Device(device_type),
            driver: String::new(),
            pci_address: pci_address.map(str::to_owned),
            own_bytes: None,
        }
    }
}
