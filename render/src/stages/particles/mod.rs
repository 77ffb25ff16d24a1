//! Particles: cells at an instant in, place, height, mass, depth and colour of every particle out.
//!
//! A particle's place in its column turns with the carbon accumulated, so it moves as fast as the flux is large, up
//! where carbon leaves the sea and down where it enters, and without a jump at any step of the product.

pub mod cpu;
pub mod params;

/// The functions of the shader; [`splat`](crate::passes::splat) runs them.
pub const FUNCTIONS: &str = include_str!("particles.wgsl");
