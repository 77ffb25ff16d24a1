//! Words of `fluxglobe bench landing`.

use std::num::NonZeroU16;
use std::path::PathBuf;

use clap::Args;

use super::degrees;

/// `fluxglobe bench landing`.
#[derive(Debug, Args)]
#[command(after_long_help = "\
For each number of steps a product is made that has so many (a folder in --work, removed at the end), a generated frame is landed into
it as `fluxglobe ingest` does, and then others in its place. Written and read bytes are those of the store; the frame's are those of its
field as it is stored. What is made time-major behind a landing is told apart, for nobody waits for it.

Examples:
  fluxglobe bench landing --work /var/tmp/landing
  fluxglobe bench landing --work /var/tmp/landing --degrees 1/50 --steps 0")]
pub(crate) struct BenchLanding {
    /// Folder for the generated files, which are used again, and the stores.
    #[arg(long, value_name = "FOLDER")]
    pub(crate) work: PathBuf,
    /// Steps that products have before, separated by commas, at most 10,000.
    #[arg(long, value_delimiter = ',', default_value = "10,1000", value_parser = clap::value_parser!(u32).range(0..=10_000))]
    pub(crate) steps: Vec<u32>,
    /// Side of a cell, degrees, 0.01 to 5, as a number or a fraction.
    #[arg(long, default_value = "0.25", value_parser = degrees, value_name = "DEGREES")]
    pub(crate) degrees: f64,
    /// Frames that are landed: the first is one more step, the others come in its place.
    #[arg(long, default_value = "3")]
    pub(crate) runs: NonZeroU16,
    /// JSON instead of a table.
    #[arg(long)]
    pub(crate) json: bool,
}
