//! Projection: particles in their cells in, splats on the screen, in their slice and in the light out.
//!
//! Tiles use the map projection with an oblique view that leaves the ground in place; slices are horizontal there, so
//! that they are the same for every tile. Globe views use eq. 4 (docs/method.md) and slices across the half-way vector.

pub mod cpu;
pub mod params;

/// The functions of the shader; [`splat`](crate::passes::splat) runs them.
pub const FUNCTIONS: &str = include_str!("project.wgsl");
