//! Render jobs in, pictures out: the whole method in compute shaders, every stage with its CPU twin.
//!
//! ```text
//! frames -> interpolate -> particles -> project -> light -> bin -> eye -> compose -> image
//!                     \-> map ------------------------------------------/
//! ```
//! Nothing is rasterised: data-centre GPUs are wired for compute. Sums whose order is not fixed are sums of integers,
//! and everything that a tile shares with its neighbours is absolute, so pictures have no seams and equal jobs give
//! equal bytes. `source` knows where frames come from. Who asks is the business of the feature `service`: a `desk` that
//! draws every job once, a gRPC `server` and a `batch` reader before it, and a `fleet` of such servers for who asks.

#[macro_use]
mod shared_struct;

mod adapter;
pub mod coast;
mod device;
mod encoding;
pub mod error;
pub mod frame;
pub mod frame_cpu;
pub mod gpu;
pub mod image;
mod lights;
pub mod passes;
pub mod plan;
pub mod playback;
mod prefetch;
pub mod proof;
pub mod pyramid;
mod recent;
pub mod renderer;
mod resident;
pub mod scene;
pub mod service;
pub mod source;
pub mod stages;

#[cfg(feature = "service")]
pub mod batch;
#[cfg(feature = "service")]
pub mod desk;
#[cfg(feature = "service")]
pub mod fleet;
#[cfg(feature = "service")]
mod gauges;
#[cfg(feature = "service")]
pub mod server;
#[cfg(feature = "service")]
pub mod wire;

pub use crate::service::{Limits, RenderService};
pub use adapter::Adapter;
pub use error::RenderError;
pub use image::Image;
pub use lights::LightCounts;
pub use renderer::{Backend, Renderer};
pub use scene::{Frame, Interval, Scene};
pub use source::Source;
