//! The engine measured: whole frames and their stages, beside the classic raster renderer and the CPU twins, on scenes of
//! any size.

pub mod classic;
pub mod command;
pub mod encode;
pub mod frames;
mod report;
mod samples;
pub mod scenery;
pub mod served;
pub mod stats;
pub mod tiles;
pub mod twins;
