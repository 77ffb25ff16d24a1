//! Made-up seas: a place, a time and a seed in, coast, flux and clouds out, the same numbers each time.
//!
//! Shared by the generators of synthetic products and by benches, which must draw what data look like. Nothing here is
//! a measurement or taken from a data set.

pub mod china_sea;
pub mod globe;
pub mod noise;

pub use noise::Noise;
