//! Jobs and scenes in, pictures out: the whole method in compute shaders, every stage with its CPU twin.
//!
//! ```text
//! fields -> interpolate -> particles -> project -> light -> bin -> eye -> compose -> image
//!                     \-> map ------------------------------------------/
//! ```
//! Nothing is rasterised: data-centre GPUs are wired for compute. Sums whose order is not fixed are sums of integers,
//! and everything that a tile shares with its neighbours is absolute, so pictures have no seams and equal jobs give
//! equal bytes.
//!
//! Left out on purpose: where fields come from, who asks, in which order, and where pictures go (`render-worker`); what
//! proves and measures all this (`render-proof`).

#[macro_use]
mod shared_struct;

mod adapter;
mod backend;
mod by_domain;
pub mod coast;
mod device;
mod device_slot;
mod drawing;
pub mod error;
pub mod field_cache;
pub mod frame;
pub mod frame_context;
pub mod frame_cpu;
pub mod gpu;
pub mod image;
pub mod passes;
pub mod plan;
pub mod playback;
pub mod pyramid;
pub mod renderer;
mod resident;
pub mod scene;
pub mod stages;
pub mod timings;

pub use adapter::Adapter;
pub use backend::{Backend, chosen};
pub use error::RenderError;
pub use gpu::adapters;
pub use image::Image;
pub use renderer::Renderer;
pub use scene::{Field, Interval, Scene};
