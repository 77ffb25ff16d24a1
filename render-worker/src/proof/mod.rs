//! What proves the renderer right: a picture made another way, and measures of how far two pictures are apart.
//!
//! Nothing here draws for people, and nothing that draws uses it. `reference` shares with the stages the job and its
//! plan, not a line of how pictures come about.

pub mod currents;
pub mod difference;
pub mod flip;
pub mod ocean;
pub mod quality;
pub mod reference;

pub use difference::{Difference, differing_bytes};
pub use quality::{QualityRow, against_slices};
pub use reference::{Fineness, Picture, reference, reference_of_cells};
