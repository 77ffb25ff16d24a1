//! What proves the engine (`render`) right and measures it: pictures made another way, measures of how far two pictures
//! are apart, all pairs for gap filling, and benches.
//!
//! Nothing here draws for people, and nothing that draws uses it. `reference` shares with the stages the job and its
//! plan, not a line of how pictures come about. The program `render-bench` is [`bench`] alone: small enough to be
//! carried to where the GPU is.

pub mod bench;
pub mod currents;
pub mod difference;
pub mod error;
pub mod fill;
pub mod flip;
pub mod ocean;
pub mod quality;
pub mod reference;
pub mod shown;
pub mod views;

pub use difference::{Covered, Difference, differing_bytes};
pub use error::ProofError;
pub use quality::{Quality, QualityRow, against_slices};
pub use reference::{Fineness, Picture, reference, reference_of_cells};
