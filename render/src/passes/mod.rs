//! The two passes over particles, each made of the functions of several stages: storing what lies between them would
//! cost more than the stages do. Particles that drift have a first pass of their own, `trails`.
//!
//! All keep sums for a workgroup's neighbours in a small table (`tally.wgsl`) and store splats in one order (`order.wgsl`); first
//! passes store alike (`store.wgsl`).

pub mod cells;
pub mod scatter;
pub mod splat;
mod store;
pub mod trails;

use crate::gpu::{Gpu, Kernel};

/// Which cells the passes draw, and where they store their splats.
pub const CELLS: &str = include_str!("order.wgsl");

/// Probes of the table of sums that are shared with neighbours: after so many a key has no slot.
pub const SHARED_PROBES: u32 = 12;
/// Nobody shares sums: that pays on GPUs alone.
pub const NO_PROBES: u32 = 0;

/// What suits the device.
pub fn probes(gpu: &Gpu) -> u32 {
    if gpu.is_software() {
        NO_PROBES
    } else {
        SHARED_PROBES
    }
}

/// Compiles a pass whose table is looked through so often.
fn compiled(gpu: &Gpu, label: &'static str, source: &str, probes: u32) -> Kernel {
    gpu.variant(label, source, label, &[("PROBES", f64::from(probes))])
}
