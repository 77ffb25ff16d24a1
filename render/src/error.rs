//! What can go wrong between a job with its scene and their picture.

use contract::ContractError;

/// A job that could not be drawn.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// No Vulkan adapter on this machine.
    #[error(
        "no Vulkan adapter found; install the package mesa-vulkan-drivers for a software one, or draw with the CPU backend"
    )]
    NoAdapter,
    /// There is a software adapter alone, where a graphics card is required.
    #[error(
        "a graphics card is required and there is none: the only Vulkan adapter is {adapter}, a software adapter; \
         give this machine or container a card and its driver, or start without --require-gpu"
    )]
    SoftwareAdapter { adapter: String },
    /// No adapter of this number, address or name.
    #[error("no adapter {wanted:?} here; there are: {there} (`fluxglobe adapters` lists them)")]
    UnknownAdapter { wanted: String, there: String },
    /// An adapter that was drawn on is not there any more.
    #[error("the adapter {adapter} is not there any more")]
    AdapterGone { adapter: String },
    /// The adapter refused a device.
    #[error("adapter {adapter:?} gave no device")]
    NoDevice {
        adapter: String,
        source: Box<wgpu::RequestDeviceError>,
    },
    /// The device stopped answering.
    #[error("the graphics device stopped while {what}")]
    DeviceStopped { what: &'static str },
    /// The device has no memory left.
    #[error("the graphics device was out of memory while {what}")]
    OutOfMemory { what: &'static str },
    /// The job breaks a limit of the contract.
    #[error("job refused")]
    Job(#[from] ContractError),
    /// More particles than one picture may have.
    #[error(
        "the picture needs {count} particles, at most {limit} are drawn; use fewer particles a cell or a smaller view"
    )]
    TooManyParticles { count: u64, limit: u64 },
    /// A buffer larger than the device or the limit allows.
    #[error(
        "{what} need {bytes} bytes, the device holds at most {limit}; use a smaller picture or fewer slices"
    )]
    TooLarge {
        what: &'static str,
        bytes: u64,
        limit: u64,
    },
    /// Multilevel summation over a pole.
    #[error(
        "the grid comes too near a pole, or cannot be halved often enough, for the exact form; use the form window"
    )]
    NoExactFill,
    /// Two products drawn together lie on different grids.
    #[error("{accumulated} does not lie on the grid of {product}")]
    GridMismatch {
        product: String,
        accumulated: String,
    },
    /// Trails were to be drawn, of which the scene has no vector.
    #[error("the picture has trails, the scene has no vector that they are drawn from")]
    NoTrails,
    /// A flow was to be drawn from one part of its vector.
    #[error("a flow needs both parts of a vector, the scene has the eastward one only")]
    NoNorthward,
    /// The picture could not be encoded.
    #[error("cannot encode a picture of {width} x {height} pixels")]
    Encode {
        width: u32,
        height: u32,
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// Whoever wanted the picture has gone.
    #[error("nobody waits for the picture any more")]
    NotWanted,
}

impl RenderError {
    /// May the same job succeed later?
    pub fn is_retryable(&self) -> bool {
        match self {
            Self::DeviceStopped { .. } | Self::OutOfMemory { .. } | Self::NotWanted => true,
            Self::NoAdapter
            | Self::UnknownAdapter { .. }
            | Self::AdapterGone { .. }
            | Self::SoftwareAdapter { .. }
            | Self::NoDevice { .. }
            | Self::Job(_)
            | Self::TooManyParticles { .. }
            | Self::TooLarge { .. }
            | Self::NoExactFill
            | Self::GridMismatch { .. }
            | Self::NoTrails
            | Self::NoNorthward
            | Self::Encode { .. } => false,
        }
    }

    /// Is the job, not the renderer, to blame?
    pub fn is_bad_request(&self) -> bool {
        matches!(
            self,
            Self::Job(_)
                | Self::TooManyParticles { .. }
                | Self::TooLarge { .. }
                | Self::NoExactFill
                | Self::GridMismatch { .. }
                | Self::NoTrails
                | Self::NoNorthward
        )
    }

    /// Is the device to blame, so that a fresh one may draw the job?
    pub fn is_device_fault(&self) -> bool {
        matches!(self, Self::DeviceStopped { .. } | Self::OutOfMemory { .. })
    }

    /// Would every renderer fail at this job, now and later? What a job that was tried on a fresh device fails with is
    /// its own; a machine that cannot be used is not.
    pub fn is_final(&self) -> bool {
        match self {
            Self::DeviceStopped { .. }
            | Self::OutOfMemory { .. }
            | Self::Job(_)
            | Self::TooManyParticles { .. }
            | Self::TooLarge { .. }
            | Self::NoExactFill
            | Self::GridMismatch { .. }
            | Self::NoTrails
            | Self::NoNorthward
            | Self::Encode { .. } => true,
            Self::NoAdapter
            | Self::UnknownAdapter { .. }
            | Self::AdapterGone { .. }
            | Self::SoftwareAdapter { .. }
            | Self::NoDevice { .. }
            | Self::NotWanted => false,
        }
    }
}
