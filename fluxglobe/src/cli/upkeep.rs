//! Words of what maintainers do: recompute, verify, remove, keep, survey.

use std::num::NonZeroU16;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use compute::recompute::What;
use contract::index::DimensionIndex;
use contract::manifest::AskedVersion;
use contract::product::ProductId;
use contract::time::TimeMs;
use storage::pins;

/// What is recomputed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum RecomputeWhat {
    /// Sums that means over named regions are made of.
    Statistics,
    /// Sums that budgets of named regions are made of.
    Budget,
    /// Fields of the files themselves, read anew from the store where decoder or profile have changed since;
    /// and the accumulated ones that follow from them.
    #[value(name = "frames", alias = "fields")]
    Fields,
    /// Volume tiles.
    Tiles,
}

impl RecomputeWhat {
    /// The same for the compute cluster, which draws nothing.
    pub(crate) fn computed(self) -> Option<What> {
        match self {
            Self::Statistics => Some(What::Statistics),
            Self::Budget => Some(What::Budget),
            Self::Fields => Some(What::Fields),
            Self::Tiles => None,
        }
    }
}

/// `fluxglobe recompute`.
#[derive(Debug, Args)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "each is a switch of the command line"
)]
pub(crate) struct Recompute {
    /// Product that others are derived from.
    #[arg(long)]
    pub(crate) product: ProductId,
    /// First instant; the product's first if absent.
    #[arg(long)]
    pub(crate) from: Option<TimeMs>,
    /// First instant after the period; the product's end if absent.
    #[arg(long)]
    pub(crate) to: Option<TimeMs>,
    /// What, separated by commas. Killed at any point, the same command goes on where it was; readers see the old
    /// version until a new one is whole.
    #[arg(
        long,
        value_enum,
        value_delimiter = ',',
        default_value = "statistics,budget,frames,tiles"
    )]
    pub(crate) what: Vec<RecomputeWhat>,
    /// Name of a profile or a profile file (TOML) to read the files by, if not the one of the name that they were read by
    /// before.
    #[arg(long, value_name = "NAME|FILE")]
    pub(crate) profile: Option<String>,
    /// Folder of profiles of your own (*.toml), beside those of the program.
    #[arg(long, env = "FLUXGLOBE_PROFILES", value_name = "FOLDER")]
    pub(crate) profiles: Option<PathBuf>,
    /// Folder for files while they are read anew; made if absent, emptied of what a killed process left.
    #[arg(
        long,
        env = "FLUXGLOBE_SPOOL",
        default_value = "/var/tmp/fluxglobe-spool",
        value_name = "FOLDER"
    )]
    pub(crate) spool: PathBuf,
    /// Files that are read anew at the same time, 1 to 64.
    #[arg(long, env = "FLUXGLOBE_PARALLEL_FILES", default_value_t = 2,
          value_parser = clap::value_parser!(u16).range(1..=64))]
    pub(crate) parallel_files: u16,
    /// Deepest zoom level of tiles, 0 to 6.
    #[arg(long, default_value = "2", value_parser = clap::value_parser!(u8).range(0..=6))]
    pub(crate) zoom: u8,
    /// Also what is there and right by its name: made again and compared.
    #[arg(long)]
    pub(crate) force: bool,
    /// Read what is there first, and make again what is damaged: fields and domain from raw/, or from what they are
    /// computed from, sums and tiles from those.
    #[arg(long)]
    pub(crate) verify: bool,
    /// Show the plan and do nothing; with --verify also name each object that is damaged or gone and would be made again, and each cube.
    #[arg(long)]
    pub(crate) dry_run: bool,
    /// The plan as JSON.
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten, next_help_heading = "Kafka")]
    pub(crate) kafka: kafka_log::KafkaSettings,
}

/// `fluxglobe verify`.
#[derive(Debug, Args)]
pub(crate) struct Verify {
    /// Objects of this product or dataset only; of all, and pictures and weights too, if absent.
    #[arg(long)]
    pub(crate) product: Option<ProductId>,
    /// What was found as JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

/// `fluxglobe migrate`.
#[derive(Debug, Args)]
#[command(after_long_help = "\
A store of before holds values in fields (frames/) under manifests. Programs of now keep each product as a cube beside them
(cubes/), which xarray and others open, and which series, means and windows are read from; what has none is answered from
whole fields, rightly and slowly.

For every product and every version that is kept, oldest first, this
  1. puts the steps that the cube does not have, commits them, and names the state by the number of the version;
  2. compares each step with its field, bit by bit;
  3. makes runs of 128 steps time-major, and compares all objects of the cube with their checksums.
Manifests and fields stay as they are, and so do budgets, series, pictures and what people cite. It may run beside services
and be killed at any point: the same command goes on where it was, and once all is over it only compares. A cube that holds
anything else than the fields is an error that names array, step and cell, and the exit code is 1.

Room: about as much as frames/ takes. What nobody reads any more (series/) is removed by `fluxglobe gc`.

Examples:
  fluxglobe --data OLD-DATA migrate
  fluxglobe --store s3://BUCKET/PREFIX migrate --product takahashi09-flux --json")]
pub(crate) struct Migrate {
    /// This product only; all if absent.
    #[arg(long)]
    pub(crate) product: Option<ProductId>,
    /// What became of each version as JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

/// `fluxglobe gc`.
#[derive(Debug, Args)]
pub(crate) struct Gc {
    /// Newest versions of each product that stay readable. Those that `fluxglobe keep` pins stay besides.
    #[arg(long, default_value = "10", value_parser = kept_versions)]
    pub(crate) keep_versions: NonZeroU16,
    /// Whatever was written in the last days stays, and of the last hour in any case.
    #[arg(long, default_value = "30", value_name = "DAYS")]
    pub(crate) keep_days: u16,
    /// List and remove nothing.
    #[arg(long)]
    pub(crate) dry_run: bool,
}

/// `fluxglobe keep`.
#[derive(Debug, Args)]
#[command(after_long_help = "\
What is published from a version, and cites it as NAME@12-0a1b2c3d, is answered as then for as long as that version is there: `fluxglobe gc`
leaves those that are pinned, with all that they name, and what they were made from, until they are released. A pin lies in the store
(pins/), for whoever cleans up. Of an attached product what lies elsewhere is kept by those who keep that store.

Examples:
  fluxglobe keep takahashi09-flux@12-0a1b2c3d --because 'Table 2 of the report'
  fluxglobe keep --list
  fluxglobe keep --release takahashi09-flux@12")]
pub(crate) struct Keep {
    /// Version to pin: NAME@12, or NAME@12-0a1b2c3d as it is cited, which it must be.
    #[arg(value_name = "PRODUCT@NUMBER", required_unless_present_any = ["list", "release"])]
    pub(crate) asked: Option<AskedVersion>,
    /// Why, for those who find the pin: a line of at most 500 characters.
    #[arg(long, value_name = "TEXT", requires = "asked", value_parser = pins::reason)]
    pub(crate) because: Option<String>,
    /// List what is pinned, since when and why, and which of it is not there all the same.
    #[arg(long, conflicts_with_all = ["asked", "release"])]
    pub(crate) list: bool,
    /// The list as JSON.
    #[arg(long, requires = "list")]
    pub(crate) json: bool,
    /// Release a version: it goes as others do.
    #[arg(long, value_name = "PRODUCT@NUMBER", conflicts_with = "asked")]
    pub(crate) release: Option<AskedVersion>,
}

/// How many versions stay.
fn kept_versions(text: &str) -> Result<NonZeroU16, String> {
    text.parse()
        .map_err(|_none| "give 1 to 65535: the newest version always stays".to_owned())
}

/// `fluxglobe survey`.
#[derive(Debug, Args)]
pub(crate) struct Survey {
    /// Folders of files; each is a set.
    #[arg(required = true, value_name = "FOLDER")]
    pub(crate) folders: Vec<PathBuf>,
    /// Of a dimension of all the files beside time, latitude and longitude the index that is read, as for `fluxglobe ingest`. May be
    /// given several times.
    #[arg(long, value_name = "DIMENSION=INDEX")]
    pub(crate) index: Vec<DimensionIndex>,
}
