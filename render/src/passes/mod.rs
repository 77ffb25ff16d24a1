//! The two passes over particles, each made of the functions of several stages: storing what lies between them would
//! cost more than the stages do. Particles that drift have a first pass of their own, `trails`.
//!
//! All keep sums for a workgroup's neighbours in a small table (`tally.wgsl`) and store splats in one order (`order.wgsl`); first
//! passes store alike (`store.wgsl`).

pub mod scatter;
pub mod splat;
mod store;
pub mod trails;

use crate::gpu::Gpu;

/// The source of a pass in which nobody shares sums with neighbours, which pays on GPUs alone.
pub fn unshared(source: &str) -> String {
    source.replace("const PROBES = 12u;", "const PROBES = 0u;")
}

/// The source of a pass as it suits the device.
fn suited(gpu: &Gpu, source: &str) -> String {
    if gpu.is_software() {
        unshared(source)
    } else {
        source.to_owned()
    }
}
