//! Words of `fluxglobe observations`.

use clap::{Args, Subcommand, ValueEnum};
use compute::matchup;
use contract::observation::{PlatformKind, Quality};
use contract::product::ProductId;
use contract::time::TimeMs;

use super::analysis::PlotFile;

/// `fluxglobe observations`. Files of observations are landed with `fluxglobe ingest`, as grids are.
#[derive(Debug, Subcommand)]
pub(crate) enum Observations {
    /// Buoys, ships, stations and profiles that there are observations of.
    List(ObservationsAsked),
    /// The observations themselves, in the order of time.
    Query(ObservationsAsked),
    /// Hold observations against a product: nearest cell, bias, RMSE, scatter plot. Those of the time that the product covers are
    /// taken; those that failed a test or are deeper than 10 m are left out unless told otherwise.
    Matchup(Matchup),
}

/// Which observations.
#[derive(Debug, Args)]
pub(crate) struct ObservationsAsked {
    /// `global`, a named region, a box WEST,SOUTH,EAST,NORTH, a GeoJSON or WKT file, or the text of one.
    #[arg(long, default_value = "global", allow_hyphen_values = true)]
    pub(crate) region: String,
    /// First instant.
    #[arg(long)]
    pub(crate) from: Option<TimeMs>,
    /// First instant after them.
    #[arg(long)]
    pub(crate) to: Option<TimeMs>,
    /// What was measured, a CF standard name such as `sea_surface_temperature`.
    #[arg(long)]
    pub(crate) property: Option<String>,
    /// Data set.
    #[arg(long)]
    pub(crate) dataset: Option<ProductId>,
    /// Name of the platform.
    #[arg(long)]
    pub(crate) platform: Option<String>,
    /// buoy, ship, station or profile.
    #[arg(long)]
    pub(crate) kind: Option<PlatformKind>,
    /// Worst quality that counts: `good`, `not_evaluated`, `questionable` or `bad`. All count in lists unless one is given, in a
    /// match-up those that are `not_evaluated` or better.
    #[arg(long, value_name = "QUALITY")]
    pub(crate) worst: Option<Quality>,
    /// Most observations, 1 to 1,000,000; of platforms (`list`) the first 10,000 at most.
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub(crate) limit: u32,
    /// JSON instead of a table, a line each.
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten, next_help_heading = "PostGIS")]
    pub(crate) store: observations::ObservationSettings,
}

/// How a step of the product is chosen for an observation's time.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum MatchTime {
    /// The step that the time lies in.
    Nearest,
    /// Interpolated between the two steps around it.
    Linear,
}

/// `fluxglobe observations matchup`.
#[derive(Debug, Args)]
pub(crate) struct Matchup {
    /// The product to hold them against.
    #[arg(long)]
    pub(crate) product: ProductId,
    /// How time is matched.
    #[arg(long, value_enum, default_value = "nearest")]
    pub(crate) time: MatchTime,
    /// Deepest observation that counts, m below the surface; more for a product of a deeper level.
    #[arg(long, value_name = "METRES", default_value_t = matchup::Fit::default().deepest_m, value_parser = depth_m)]
    pub(crate) deepest: f64,
    /// Draw it too: what the product says over what was observed.
    #[arg(long, value_name = "FILE.svg|FILE.png")]
    pub(crate) plot: Option<PlotFile>,
    #[command(flatten)]
    pub(crate) asked: ObservationsAsked,
}

/// A depth in metres.
fn depth_m(text: &str) -> Result<f64, String> {
    let depth_m = text.parse().ok().filter(|depth: &f64| depth.is_finite());
    depth_m.ok_or_else(|| "give metres below the surface, such as 10".to_owned())
}
