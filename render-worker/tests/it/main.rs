//! Tests of a render worker as a whole, one binary.
#![expect(
    clippy::unwrap_used,
    reason = "all of this binary is tests; clippy allows these in test functions only"
)]

mod annotated;
mod batch;
mod damaged;
mod desk;
mod device;
mod fleet;
mod frozen;
mod gallery;
mod here;
mod incomplete;
mod large;
mod large_scenes;
mod loading;
mod lost_device;
mod parts;
mod prefetch;
mod process;
mod scenes;
mod server;
mod service;
mod stored;
mod worker;
