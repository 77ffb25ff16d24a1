//! Words of `fluxglobe stats`: where, which statistics, of which bins of time.

use clap::{Args, Subcommand};
use contract::earth::Earth;
use contract::geometry::Sampling;
use contract::manifest::AskedVersion;
use contract::product::ProductId;
use contract::region::Cells;
use contract::statistics::{MinCoverage, Statistics, StatisticsWishes};
use contract::time::{TimeMs, TimeStep};

use super::analysis::{Analysis, StatsCorrelate, StatsDifference, StatsHovmoller};
use super::degrees::degrees;
use super::steps::STEPS;

/// `fluxglobe stats`.
#[derive(Debug, Subcommand)]
pub(crate) enum Stats {
    /// The series of the cell at a place, or statistics of it by day, month, year ...
    Point(StatsPoint),
    /// The mean along a line at every step, each cell by the length of the line in it; or other statistics of it.
    Line(StatsLine),
    /// The mean over a region at every step, each cell by its area, with the area that holds data; or other statistics of it.
    Polygon(StatsPolygon),
    /// How the series of two products go together, now and some steps later.
    Correlate(StatsCorrelate),
    /// The mean over time of two periods, versions or products, one less the other.
    Difference(StatsDifference),
    /// Latitude or longitude against time (Hovmöller): means of bands, step by step.
    Hovmoller(StatsHovmoller),
}

/// What is asked besides a plain series.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Statistics")]
pub(crate) struct StatisticsOptions {
    /// Statistics, separated by commas: mean, sum, min, max, std, median, count, coverage, and percentiles such as p90 or p97.5. The standard
    /// deviation std is that of the values as they are, by their weights: √(Σ w (x - m)² / Σ w).
    #[arg(long, value_name = "mean,p90,...")]
    pub(crate) statistic: Option<Statistics>,
    /// What a row covers. Steps that lie in several rows count in each by their time there.
    #[arg(long, value_name = STEPS)]
    pub(crate) step: Option<TimeStep>,
    /// Least coverage, percent: rows with less have no values and say so; with --climatology, --trend and their like steps with less are
    /// left out, and how many is said.
    #[arg(long, value_name = "PERCENT")]
    pub(crate) min_coverage: Option<MinCoverage>,
    /// Comma-separated values instead of a table.
    #[arg(long, conflicts_with = "json")]
    pub(crate) csv: bool,
}

impl StatisticsOptions {
    /// What is asked, in whatever form it is printed.
    pub(crate) fn wishes(&self) -> StatisticsWishes {
        StatisticsWishes {
            statistics: self.statistic.clone(),
            step: self.step,
            min_coverage: self.min_coverage,
            ..StatisticsWishes::default()
        }
    }
}

/// `fluxglobe stats point`.
#[derive(Debug, Args)]
pub(crate) struct StatsPoint {
    /// Product, and which of its versions: NAME, NAME@12 or NAME@12-0a1b2c3d. The newest if none is given.
    #[arg(long, value_name = "PRODUCT[@VERSION]")]
    pub(crate) product: AskedVersion,
    /// Longitude, degrees east.
    #[arg(long, allow_negative_numbers = true, value_parser = degrees)]
    pub(crate) lon: f64,
    /// Latitude, degrees north.
    #[arg(long, allow_negative_numbers = true, value_parser = degrees)]
    pub(crate) lat: f64,
    /// First instant: 2000, 2000-03, 2000-03-15 or with a time of day. The product's first if absent. A step that lies partly in the
    /// period counts by its time inside, and its row ends with the period; whole in what is made of the series (--climatology and its like).
    #[arg(long)]
    pub(crate) from: Option<TimeMs>,
    /// First instant after the period. The product's end if absent.
    #[arg(long)]
    pub(crate) to: Option<TimeMs>,
    /// What the value at the place is: that of its cell, or bilinear of the four cells around it. Cell if absent.
    #[arg(long, value_name = "cell|bilinear")]
    pub(crate) sampling: Option<Sampling>,
    #[command(flatten)]
    pub(crate) statistics: StatisticsOptions,
    #[command(flatten)]
    pub(crate) analysis: Analysis,
    /// JSON instead of a table.
    #[arg(long)]
    pub(crate) json: bool,
}

/// `fluxglobe stats line`.
#[derive(Debug, Args)]
pub(crate) struct StatsLine {
    /// Product, of any quantity, and which of its versions: NAME, NAME@12 or NAME@12-0a1b2c3d. The newest if none is given.
    #[arg(long, value_name = "PRODUCT[@VERSION]")]
    pub(crate) product: AskedVersion,
    /// `LON,LAT;LON,LAT;...`, a GeoJSON or WKT file with lines, or the text of one. Between two vertices it is a great circle.
    #[arg(long, allow_hyphen_values = true)]
    pub(crate) line: String,
    /// First instant: 2000, 2000-03, 2000-03-15 or with a time of day. The product's first if absent. A step that lies partly in the
    /// period counts by its time inside, and its row ends with the period; whole in what is made of the series (--climatology and its like).
    #[arg(long)]
    pub(crate) from: Option<TimeMs>,
    /// First instant after the period. The product's end if absent.
    #[arg(long)]
    pub(crate) to: Option<TimeMs>,
    /// Figure of the earth for lengths: wgs84, sphere (R = 6371 km) or local-radius.
    #[arg(long, default_value = "wgs84")]
    pub(crate) earth: Earth,
    #[command(flatten)]
    pub(crate) statistics: StatisticsOptions,
    #[command(flatten)]
    pub(crate) analysis: Analysis,
    /// JSON instead of a table.
    #[arg(long)]
    pub(crate) json: bool,
}

/// `fluxglobe stats polygon`.
#[derive(Debug, Args)]
pub(crate) struct StatsPolygon {
    /// Product, of any quantity, and which of its versions: NAME, NAME@12 or NAME@12-0a1b2c3d. The newest if none is given.
    #[arg(long, value_name = "PRODUCT[@VERSION]")]
    pub(crate) product: AskedVersion,
    /// `global`, a named region, a box WEST,SOUTH,EAST,NORTH, a GeoJSON or WKT file, the text of one,
    /// or MASK:CODE, the cells where a landed mask has a code, or what it means: basins:5, basins:southern.
    #[arg(long, allow_hyphen_values = true)]
    pub(crate) region: String,
    /// First instant: 2000, 2000-03, 2000-03-15 or with a time of day. The product's first if absent. A step that lies partly in the
    /// period has a whole row, and counts whole in what is made of the series (--climatology and its like); with --statistic, --step, --cells
    /// or --min-coverage it counts by its time inside, and its row ends with the period.
    #[arg(long)]
    pub(crate) from: Option<TimeMs>,
    /// First instant after the period. The product's end if absent.
    #[arg(long)]
    pub(crate) to: Option<TimeMs>,
    /// Figure of the earth for areas: wgs84, sphere (R = 6371 km) or local-radius (as FluxEngine sums).
    #[arg(long, default_value = "wgs84")]
    pub(crate) earth: Earth,
    /// How cells on the coast count in statistics: whole, or by their ocean-share. Whole if absent.
    #[arg(long, value_name = "whole|ocean-share")]
    pub(crate) cells: Option<Cells>,
    /// Product that says how much of every cell is sea or land (`sea_area_fraction`, `land_area_fraction`), on the same grid.
    /// Natural Earth's land, 1:50 million, if absent.
    #[arg(long, value_name = "PRODUCT")]
    pub(crate) ocean: Option<ProductId>,
    #[command(flatten)]
    pub(crate) statistics: StatisticsOptions,
    #[command(flatten)]
    pub(crate) analysis: Analysis,
    /// JSON instead of a table.
    #[arg(long)]
    pub(crate) json: bool,
}
