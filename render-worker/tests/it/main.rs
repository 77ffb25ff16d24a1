//! Tests of the renderer as a whole and of its stages, one binary.
#![expect(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "all of this binary is tests; clippy allows these in test functions only"
)]

mod bands;
#[cfg(feature = "service")]
mod batch;
mod coast;
mod compare;
mod context;
mod damaged;
mod device;
mod fill;
#[cfg(feature = "service")]
mod fleet;
mod flow;
#[cfg(feature = "service")]
mod frozen;
mod gallery;
mod golden;
mod hot;
mod incomplete;
mod layout;
mod limits;
mod look;
mod lost_device;
mod mass;
#[cfg(feature = "service")]
mod prefetch;
#[cfg(feature = "service")]
mod process;
mod reference;
mod scenes;
mod seams;
#[cfg(feature = "service")]
mod server;
mod service;
mod shared_light;
mod smooth;
mod stored;
mod tidy;
mod truths;
mod twins;
#[cfg(feature = "service")]
mod worker;
