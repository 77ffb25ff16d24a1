//! Words of the services: each is what its crate can be told, and what every service is told.

use std::net::SocketAddr;
use std::num::NonZeroU16;
use std::path::PathBuf;

use clap::{Args, Subcommand};
use contract::digest::Digest;
use contract::index::DimensionIndex;
use contract::product::ProductId;
use contract::topic::Origin;

use super::{BenchCompare, BenchFly, BenchQuality, BenchRender, BenchServe};

/// What every service is told besides its own settings.
#[derive(Debug, Clone, Args)]
pub(crate) struct Common {
    /// Print the settings it would run with, and where each comes from, and exit.
    #[arg(long)]
    pub(crate) print_settings: bool,
}

/// `fluxglobe ingestd`.
#[derive(Debug, Args)]
pub(crate) struct Ingestd {
    #[command(flatten)]
    pub(crate) common: Common,
    /// Address of /healthz, /readyz and /metrics.
    #[arg(long, env = "FLUXGLOBE_ADMIN", default_value = "127.0.0.1:9101", value_parser = service::socket_address)]
    pub(crate) admin: SocketAddr,
    #[command(flatten, next_help_heading = "Kafka")]
    pub(crate) kafka: kafka_log::KafkaSettings,
    #[command(flatten, next_help_heading = "PostGIS")]
    pub(crate) observations: observations::ObservationSettings,
    #[command(flatten)]
    pub(crate) ingest: ingest::ServiceSettings,
}

/// `fluxglobe scheduler`.
#[derive(Debug, Args)]
pub(crate) struct Scheduler {
    #[command(flatten)]
    pub(crate) common: Common,
    /// Address of /healthz, /readyz and /metrics.
    #[arg(long, env = "FLUXGLOBE_ADMIN", default_value = "127.0.0.1:9102", value_parser = service::socket_address)]
    pub(crate) admin: SocketAddr,
    #[command(flatten, next_help_heading = "Kafka")]
    pub(crate) kafka: kafka_log::KafkaSettings,
    #[command(flatten)]
    pub(crate) ballista: compute::service::SchedulerSettings,
}

/// `fluxglobe executor`.
#[derive(Debug, Args)]
pub(crate) struct Executor {
    #[command(flatten)]
    pub(crate) common: Common,
    /// Address of /healthz, /readyz and /metrics.
    #[arg(long, env = "FLUXGLOBE_ADMIN", default_value = "127.0.0.1:9103", value_parser = service::socket_address)]
    pub(crate) admin: SocketAddr,
    #[command(flatten)]
    pub(crate) ballista: compute::service::ExecutorSettings,
}

/// `fluxglobe render-worker`.
#[derive(Debug, Args)]
pub(crate) struct RenderWorker {
    #[command(flatten)]
    pub(crate) common: Common,
    /// Address of /healthz, /readyz and /metrics.
    #[arg(long, env = "FLUXGLOBE_ADMIN", default_value = "127.0.0.1:9104", value_parser = service::socket_address)]
    pub(crate) admin: SocketAddr,
    #[command(flatten, next_help_heading = "Kafka")]
    pub(crate) kafka: kafka_log::KafkaSettings,
    #[command(flatten)]
    pub(crate) render: render_worker::server::Settings,
}

/// `fluxglobe tile-server`.
#[derive(Debug, Args)]
pub(crate) struct TileServer {
    #[command(flatten)]
    pub(crate) common: Common,
    #[command(flatten, next_help_heading = "Kafka")]
    pub(crate) kafka: kafka_log::KafkaSettings,
    #[command(flatten, next_help_heading = "PostGIS")]
    pub(crate) observations: observations::ObservationSettings,
    #[command(flatten, next_help_heading = "Render workers")]
    pub(crate) fleet: render_worker::fleet::FleetSettings,
    #[command(flatten, next_help_heading = "Server")]
    pub(crate) serve: tile_server::config::Settings,
}

/// `fluxglobe notice`.
#[derive(Debug, Args)]
pub(crate) struct Notice {
    /// Files, or addresses that the ingest service may fetch from.
    #[arg(required = true, value_name = "FILE|URL")]
    pub(crate) files: Vec<String>,
    /// Name of a shipped profile, if the file must be read with it.
    #[arg(long)]
    pub(crate) profile: Option<String>,
    /// Product to land in, if not the profile's.
    #[arg(long)]
    pub(crate) product: Option<ProductId>,
    /// Variable to land, where no profile is for the file and it holds several: any on a grid.
    #[arg(long, value_name = "NAME", conflicts_with = "profile")]
    pub(crate) variable: Option<String>,
    /// Of a dimension beside time, latitude and longitude the index that is read, from 0 on: a depth, a height, a member. May be given
    /// several times.
    #[arg(long, value_name = "DIMENSION=INDEX")]
    pub(crate) index: Vec<DimensionIndex>,
    /// SHA-256 that a fetched file must have; local files are digested here.
    #[arg(long)]
    pub(crate) sha256: Option<Digest>,
    /// Print the notices, a line each, instead of sending them: for a Kafka client of your own.
    #[arg(long)]
    pub(crate) print: bool,
    #[command(flatten, next_help_heading = "Kafka")]
    pub(crate) kafka: kafka_log::KafkaSettings,
}

/// `fluxglobe topics`.
#[derive(Debug, Subcommand)]
pub(crate) enum Topics {
    /// Make the topics that are missing; those that are there are left as they are.
    Create {
        /// Copies of each partition, no more than there are brokers.
        #[arg(long, default_value = "1")]
        replication: NonZeroU16,
        #[command(flatten, next_help_heading = "Kafka")]
        kafka: kafka_log::KafkaSettings,
    },
}

/// `fluxglobe rejected`.
#[derive(Debug, Subcommand)]
pub(crate) enum Rejected {
    /// List refused files and messages: reason, origin, attempt and what to do.
    List {
        /// JSON instead of a table.
        #[arg(long)]
        json: bool,
        #[command(flatten, next_help_heading = "Kafka")]
        kafka: kafka_log::KafkaSettings,
    },
    /// Send refused messages again, with the next attempt's number.
    Replay {
        /// Origins as `list` shows them, TOPIC/PARTITION/OFFSET; all of them if none is given.
        #[arg(value_name = "ORIGIN")]
        origins: Vec<Origin>,
        #[command(flatten, next_help_heading = "Kafka")]
        kafka: kafka_log::KafkaSettings,
    },
}

/// `fluxglobe bench`.
#[derive(Debug, Subcommand)]
pub(crate) enum Bench {
    /// How fresh a running cluster is: from a notice to a volume tile, and the share of each stage.
    Stream(BenchStream),
    /// How many new pictures a running server gives to so many clients, and how long each waits.
    Serve(BenchServe),
    /// How a running server is to fly through: pictures a second, camera to picture, rest to full picture
    Fly(BenchFly),
    /// Budgets of a year of days, each a process of its own, beside a script on xarray if a Python is given.
    Budget(BenchBudget),
    /// How fast the renderer is on this machine, beside the classic raster renderer and the processor.
    Render(BenchRender),
    /// How far volumes are from a reference in double precision, against the number of slices.
    Quality(BenchQuality),
    /// How far two pictures are apart: decibels, levels, bytes, FLIP.
    Compare(BenchCompare),
    /// Gap filling on this machine's Vulkan device, or with --cpu on the processor: every form, small grids first.
    Fill(super::BenchFill),
    /// What a landing costs: one frame into products of 10 and 1,000 steps, time and bytes; and windows of it, read.
    Landing(super::BenchLanding),
}

/// `fluxglobe bench budget`.
#[derive(Debug, Args)]
pub(crate) struct BenchBudget {
    /// Folder for the generated file, the store it lands in and what the script keeps. What is there is used again.
    #[arg(long, value_name = "FOLDER")]
    pub(crate) work: PathBuf,
    /// Days of the generated product, 1 to 365.
    #[arg(long, default_value_t = 365, value_parser = clap::value_parser!(u16).range(1..=365))]
    pub(crate) days: u16,
    /// Share of 1800 x 2460 cells along each side, 0.01 to 1.
    #[arg(long, default_value_t = 0.25)]
    pub(crate) scale: f64,
    /// Times that each budget is asked for, after a first time.
    #[arg(long, default_value = "5")]
    pub(crate) runs: NonZeroU16,
    /// A Python with xarray, dask, netCDF4, zarr and shapely: the same budgets of the same file by a script.
    #[arg(long, value_name = "PROGRAM")]
    pub(crate) python: Option<PathBuf>,
    /// JSON instead of a table.
    #[arg(long)]
    pub(crate) json: bool,
}

/// `fluxglobe bench stream`.
#[derive(Debug, Args)]
pub(crate) struct BenchStream {
    /// Notices to measure; one more goes before them to warm up.
    #[arg(long, default_value = "20")]
    pub(crate) notices: NonZeroU16,
    /// Folder to write the granules in, one that the ingest service may read.
    #[arg(long, value_name = "FOLDER")]
    pub(crate) inbox: PathBuf,
    /// Address of the tile server.
    #[arg(long, default_value = "http://127.0.0.1:8080")]
    pub(crate) tiles: String,
    /// JSON instead of a table.
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten, next_help_heading = "Kafka")]
    pub(crate) kafka: kafka_log::KafkaSettings,
}
