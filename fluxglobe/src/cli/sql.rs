//! Words of `fluxglobe sql`.

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::{Args, ValueEnum};
use compute::sql::SqlLimits;

/// `fluxglobe sql`.
#[derive(Debug, Args)]
#[command(after_long_help = "\
A table a product: takahashi09_flux, or \"takahashi09-flux\"; a version of it: \"takahashi09-flux@3\". Its columns:
  time_start, time_end     the step, UTC
  latitude, longitude      centre of the cell, degrees, -180 to 180
  value                    in the stored unit (table products says which); null without data
  area_km2                 of the cell, on WGS84
Tables products and functions say what there is. Filters on time, latitude and longitude are read alone: EXPLAIN shows it.

Examples:
  fluxglobe sql \"SELECT name, quantity, unit, steps FROM products\"
  fluxglobe sql \"SELECT time_start, mean_weighted(value, area_km2) AS mean FROM takahashi09_flux
                 WHERE latitude BETWEEN -10 AND 10 GROUP BY time_start ORDER BY time_start\"
  fluxglobe sql \"SELECT * FROM stats('takahashi09-flux', 'global', 'year', 'mean,p90')\" --format json
  fluxglobe sql \"SELECT * FROM budget('takahashi09-flux', '14s-14n', 'season')\"
  fluxglobe sql \"SELECT * FROM analysis('takahashi09-flux', 'global', 'climatology')\"
  fluxglobe sql \"SELECT * FROM takahashi09_flux WHERE time_start = '2000-07-01'\" --output july.parquet
  fluxglobe sql - < question.sql
  fluxglobe sql \"EXPLAIN SELECT value FROM takahashi09_flux WHERE longitude > 170\"

docs/sql.md shows more.")]
pub(crate) struct SqlQuestion {
    /// One statement that reads: SELECT, WITH, VALUES, EXPLAIN, SHOW or DESCRIBE. `-` reads it from standard input.
    #[arg(value_name = "SQL|-", required_unless_present = "file")]
    pub(crate) text: Option<String>,
    /// File that holds it.
    #[arg(short, long, value_name = "FILE.sql", conflicts_with = "text")]
    pub(crate) file: Option<PathBuf>,
    /// Form of the answer; what the ending of --output says, else a table.
    #[arg(long, value_enum)]
    pub(crate) format: Option<SqlFormat>,
    /// File to write, which is not there yet: .csv, .json, .arrow, .parquet or .nc. It is whole or not there.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
    /// Most rows of a table; files, CSV and JSON have all.
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub(crate) max_rows: u32,
    #[command(flatten)]
    pub(crate) limits: QuestionLimits,
}

/// What one question may take.
#[derive(Debug, Clone, Args)]
pub(crate) struct QuestionLimits {
    /// Memory for what a question must hold (groups, sorted rows, a side of a join), MiB. Nothing is put on disk.
    #[arg(long, default_value_t = 1024, value_name = "MIB", value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    pub(crate) memory_mib: u32,
    /// Time after which a question is ended, seconds.
    #[arg(long, default_value_t = 3600, value_name = "SECONDS", value_parser = clap::value_parser!(u32).range(1..=7 * 86_400))]
    pub(crate) limit_s: u32,
}

impl QuestionLimits {
    pub(crate) fn limits(&self) -> SqlLimits {
        SqlLimits {
            memory_bytes: (self.memory_mib as usize) << 20,
            time: Duration::from_secs(self.limit_s.into()),
        }
    }
}

/// Form of an answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum SqlFormat {
    /// For people.
    Table,
    /// Commas, names first.
    Csv,
    /// One array of objects.
    Json,
    /// Arrow's file format (Feather).
    Arrow,
    /// Parquet.
    Parquet,
    /// NetCDF-4: one dimension, a variable a column, instants as whole numbers.
    Netcdf,
}

impl SqlFormat {
    /// The one that the ending of a file's name says.
    pub(crate) fn of_file(path: &Path) -> Option<Self> {
        Some(match path.extension()?.to_str()? {
            "csv" => Self::Csv,
            "json" => Self::Json,
            "arrow" | "feather" => Self::Arrow,
            "parquet" => Self::Parquet,
            "nc" => Self::Netcdf,
            _ => return None,
        })
    }
}
