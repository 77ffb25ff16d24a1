//! Render jobs in, stored pictures out: what the engine (`render`) draws, once for every way to ask.
//!
//! A [`desk`] draws every job once, whoever asks: a gRPC `server` and a `batch` reader, or the tile server of the same
//! process. `source` knows where fields come from and keeps those in use, `large` reads windows of those that are too large to be held, `prefetch` reads what comes next. A `fleet` of
//! such servers is what others ask.

mod adapter_info;
pub mod annotation;
pub mod batch;
pub mod desk;
mod encoding;
pub mod error;
pub mod fleet;
mod large;
pub mod pipeline;
mod prefetch;
pub mod server;
pub mod source;
mod unfilled;
pub mod wire;

pub use desk::Desk;
pub use error::DrawError;
pub use pipeline::Limits;
pub use source::Source;
