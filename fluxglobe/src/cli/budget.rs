//! Options of `fluxglobe budget`.

use clap::Args;
use contract::budget::{AsOf, BudgetWords, ErrorWords};
use contract::earth::Earth;
use contract::manifest::AskedVersion;
use contract::product::ProductId;
use contract::region::Cells;
use contract::time::{TimeMs, TimeStep};

use super::steps::STEPS;

/// Heading of what makes a budget uncertain.
const UNCERTAINTY: &str = "Uncertainty";
/// Heading of what a budget consists of.
const PARTS: &str = "Parts";

/// `fluxglobe budget`.
#[derive(Debug, Args)]
pub(crate) struct Budget {
    /// Product, a carbon flux, and which of its versions: NAME, NAME@12 or NAME@12-0a1b2c3d. The newest if none is given.
    #[arg(long, value_name = "PRODUCT[@VERSION]")]
    pub(crate) product: AskedVersion,
    /// `global`, a named region, a box WEST,SOUTH,EAST,NORTH, a GeoJSON or WKT file, the text of one,
    /// or MASK:CODE, the cells where a landed mask has a code, or what it means: basins:5, basins:southern.
    #[arg(long, default_value = "global", allow_hyphen_values = true)]
    pub(crate) region: String,
    /// First instant: 2000, 2000-03, 2000-03-15 or with a time of day. The product's first if absent. A step
    /// that lies partly in the period counts by the share of its time.
    #[arg(long)]
    pub(crate) from: Option<TimeMs>,
    /// First instant after the period. The product's end if absent.
    #[arg(long)]
    pub(crate) to: Option<TimeMs>,
    /// What a row of the answer covers: one of the product's steps, a part of the calendar, or the total of the period, which is
    /// usual.
    #[arg(long, value_name = STEPS)]
    pub(crate) step: Option<TimeStep>,
    /// Figure of the earth for areas: wgs84, sphere (R = 6371 km) or local-radius (as FluxEngine sums).
    #[arg(long, default_value = "wgs84")]
    pub(crate) earth: Earth,
    /// How cells on the coast count: whole, or by their ocean-share.
    #[arg(long, default_value = "whole")]
    pub(crate) cells: Cells,
    /// Product that says how much of every cell is sea or land (`sea_area_fraction`, `land_area_fraction`), on the same grid.
    /// Natural Earth's land, 1:50 million, if absent.
    #[arg(long, value_name = "PRODUCT")]
    pub(crate) ocean: Option<ProductId>,
    /// The newest version that was published at an instant (a day is its first moment, UTC), or one by its name, PRODUCT@NUMBER, or as
    /// answers name it, PRODUCT@NUMBER-DIGEST, where --product names none. The newest of all if absent.
    #[arg(long, value_name = "DATE|VERSION")]
    pub(crate) as_of: Option<AsOf>,
    /// One line for each version of the product that changed the budget, with its date and what it changed; of the total, without
    /// --river-flux and --monte-carlo.
    #[arg(long, conflicts_with_all = ["as_of", "regions"])]
    pub(crate) history: bool,
    /// Standard error of the flux: 20% of it (with its sign: sources and sinks grow together), a number with its unit such as
    /// '0.3 mol m-2 year-1', the same in all cells, or a PRODUCT of standard errors on the same grid.
    #[arg(long, value_name = "PERCENT|NUMBER UNIT|PRODUCT", allow_hyphen_values = true, help_heading = UNCERTAINTY)]
    pub(crate) error: Option<String>,
    /// How far the errors of cells go together: as exp(-d / KM) over great circles. 0 where the error of each cell is its own.
    /// Of maps of pCO2 some hundred to some thousand km; it decides the answer more than the error does.
    #[arg(long, value_name = "KM", allow_negative_numbers = true, help_heading = UNCERTAINTY)]
    pub(crate) correlation_length_km: Option<f64>,
    /// How long the errors of steps go together: as exp(-t / DAYS). The error of each step is its own if absent.
    #[arg(long, value_name = "DAYS", allow_negative_numbers = true, help_heading = UNCERTAINTY)]
    pub(crate) correlation_days: Option<f64>,
    /// Draw so many fields of random errors too, 10 to 10000: a check of the sum over pairs, and an interval that holds 95 % of the
    /// budgets.
    #[arg(long, value_name = "DRAWS", help_heading = UNCERTAINTY)]
    pub(crate) monte_carlo: Option<u32>,
    /// The same seed draws the same errors, on any number of threads; 0 if absent.
    #[arg(long, value_name = "NUMBER", help_heading = UNCERTAINTY)]
    pub(crate) seed: Option<u64>,
    /// Outgassing of carbon that rivers bring, out of the sea, which is taken off to leave the anthropogenic part: Tg a year with
    /// its standard error if it has one, such as 650 or 650+-300, or a PRODUCT, which is summed over the same region.
    #[arg(long, value_name = "TG_PER_YEAR|PRODUCT", allow_hyphen_values = true, help_heading = PARTS)]
    pub(crate) river_flux: Option<String>,
    /// Where the number is from, for the answer: 'Regnier et al. (2022)'.
    #[arg(long, value_name = "TEXT", help_heading = PARTS)]
    pub(crate) river_source: Option<String>,
    /// Regions that are summed each by itself too and held against --region: a GeoJSON `FeatureCollection` whose features have
    /// names, as a file or as text, or a PRODUCT that is a mask, of which each code is a region.
    #[arg(long, value_name = "FILE|PRODUCT", help_heading = PARTS)]
    pub(crate) regions: Option<String>,
    /// Comma-separated values instead of a table: a row a period (of several regions those of each, the whole last), with
    /// --history a row a version.
    #[arg(long, conflicts_with = "json")]
    pub(crate) csv: bool,
    /// JSON instead of a table.
    #[arg(long)]
    pub(crate) json: bool,
}

impl Budget {
    /// What is asked besides a region and a period; `regions` is the text of a file where one was named.
    pub(crate) fn words<'a>(&'a self, regions: Option<&'a str>) -> BudgetWords<'a> {
        BudgetWords {
            errors: ErrorWords {
                error: self.error.as_deref(),
                correlation_length_km: self.correlation_length_km,
                correlation_days: self.correlation_days,
                monte_carlo: self.monte_carlo,
                seed: self.seed,
            },
            river_flux: self.river_flux.as_deref(),
            river_source: self.river_source.as_deref(),
            regions,
        }
    }
}
