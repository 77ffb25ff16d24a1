//! Made-up seas: a place, a time and a seed in, coast, flux and clouds out, the same numbers each time.
//!
//! Shared by the generators of synthetic products and by benches, which must draw what data look like. Nothing here is
//! a measurement or taken from a data set.

/// The China Seas, 0 to 41 N and 100 to 130 E.
pub mod china_sea {
    pub mod coast;
    pub mod flux;
}
pub mod globe;
pub mod noise;

pub use noise::Noise;
