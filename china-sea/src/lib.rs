//! The made-up China Seas: a place, a month and a seed in, coast, flux and clouds out, the same numbers each time.
//!
//! Shared by the generator of the synthetic product and by benches, which must draw what data look like. Nothing here is
//! a measurement or taken from a data set.

pub mod coast;
pub mod flux;
pub mod noise;

pub use noise::Noise;
