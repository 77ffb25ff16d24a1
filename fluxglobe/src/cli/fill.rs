//! Words about gap filling: how wrong it is, and how long it takes.

use std::num::NonZeroU32;
use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};
use contract::product::ProductId;
use render::stages::fill::Form;

/// `fluxglobe products ...`: more about one product.
#[derive(Debug, Subcommand)]
pub(crate) enum ProductsOf {
    /// How wrong filled gaps are: hides part of the data, fills, compares. Nothing is stored.
    FillError(FillError),
}

/// How gaps are filled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum FillForm {
    /// Windows on coarser and coarser levels: what pictures are drawn with.
    Window,
    /// Every gap from all cells, by multilevel summation.
    Exact,
}

impl FillForm {
    /// The form by the renderer's name for it.
    pub(crate) fn form(self) -> Form {
        match self {
            Self::Window => Form::Window,
            Self::Exact => Form::Exact,
        }
    }
}

/// `fluxglobe products fill-error`.
#[derive(Debug, Args)]
pub(crate) struct FillError {
    /// Product.
    #[arg(long)]
    pub(crate) product: ProductId,
    /// Share of the cells with data that is hidden, above 0 and below 1.
    #[arg(long, default_value = "0.1", value_parser = share)]
    pub(crate) share: f64,
    /// Sides of the square blocks that are hidden, cells, separated by commas: single cells, small and wide clouds.
    #[arg(long, value_delimiter = ',', default_value = "1,8,32")]
    pub(crate) gap_cells: Vec<NonZeroU32>,
    /// Most steps, spread evenly over the product.
    #[arg(long, default_value = "12")]
    pub(crate) steps: NonZeroU32,
    /// How gaps are filled.
    #[arg(long, value_enum, default_value = "window")]
    pub(crate) form: FillForm,
    /// Another number hides other cells.
    #[arg(long, default_value = "1")]
    pub(crate) seed: u32,
    /// File for a picture (PNG) of the last step with the last gap size: filled minus true, blue too low, red too high,
    /// full colour at twice the root of the mean square; data kept grey, land dark.
    #[arg(long, value_name = "FILE")]
    pub(crate) picture: Option<PathBuf>,
    /// JSON instead of a table.
    #[arg(long)]
    pub(crate) json: bool,
}

/// `fluxglobe bench fill`.
#[derive(Debug, Args)]
pub(crate) struct BenchFill {
    /// Rows and columns of the largest grid.
    #[arg(long, num_args = 2, value_names = ["ROWS", "COLS"], default_values = ["2460", "1800"], value_parser = clap::value_parser!(u32).range(16..=16384))]
    pub(crate) size: Vec<u32>,
    /// Share of the cells that is missing, above 0 and below 1.
    #[arg(long, default_value = "0.2", value_parser = share)]
    pub(crate) share: f64,
    /// Forms to measure, separated by commas.
    #[arg(
        long,
        value_enum,
        value_delimiter = ',',
        default_value = "window,exact"
    )]
    pub(crate) forms: Vec<FillForm>,
    /// Runs of each form.
    #[arg(long, default_value = "50")]
    pub(crate) runs: NonZeroU32,
    /// Longest time for one line of the table, seconds.
    #[arg(long, default_value = "10", value_parser = clap::value_parser!(u64).range(1..=3600))]
    pub(crate) limit_s: u64,
    /// One JSON object a line.
    #[arg(long)]
    pub(crate) json: bool,
}

fn share(text: &str) -> Result<f64, String> {
    let share: f64 = text.parse().map_err(|_error| "not a number".to_owned())?;
    if share > 0.0 && share < 1.0 {
        Ok(share)
    } else {
        Err("a share lies above 0 and below 1".to_owned())
    }
}
