//! Words for animations and for measures of pictures.

use std::num::NonZeroU16;
use std::path::PathBuf;

use clap::{Args, ValueEnum, value_parser};
use contract::grid::LonLatDeg;
use contract::job::Mode;
use contract::product::ProductId;
use contract::time::TimeMs;
use render_worker::fleet::WorkerAddress;

use super::RenderGlobe;
use super::analysis::PlotFile;
use crate::bench::window_size::WindowSize;

/// `fluxglobe render animation`.
#[derive(Debug, Args)]
#[command(
    mut_arg("time", |arg| arg.hide(true)),
    mut_arg("output", |arg| arg
        .value_name("FILE|FOLDER")
        .help("File to write, its kind by its name: .mp4, .webm, .webp and .gif need ffmpeg, .png is an animated PNG; \
               a name without an ending, one that ends in /, and a folder that is there are folders of PNG files, which go on where they were \
               left")),
)]
pub(crate) struct RenderAnimation {
    #[command(flatten)]
    pub(crate) globe: RenderGlobe,
    /// First instant; the product's first if absent.
    #[arg(long)]
    pub(crate) from: Option<TimeMs>,
    /// First instant after the animation, so that a year closes to a ring; the product's end if absent.
    #[arg(long)]
    pub(crate) to: Option<TimeMs>,
    /// Pictures a second, 1 to 120.
    #[arg(long, default_value_t = 25, value_parser = value_parser!(u16).range(1..=120))]
    pub(crate) fps: u16,
    /// Length, seconds; that of the key frames if there are any, else 12; at most 36000 pictures in all.
    #[arg(long)]
    pub(crate) seconds: Option<f64>,
    /// Degrees that the camera moves east in all.
    #[arg(
        long,
        default_value_t = 0.0,
        allow_negative_numbers = true,
        value_name = "DEGREES",
        conflicts_with = "look_at"
    )]
    pub(crate) turn: f64,
    /// Degrees that the camera goes round the place of --look-at in all, clockwise.
    #[arg(
        long,
        allow_negative_numbers = true,
        value_name = "DEGREES",
        requires = "look_at"
    )]
    pub(crate) orbit: Option<f64>,
    /// Way of the camera: a JSON list of `{"seconds", "look_at": [LON, LAT], "distance_km", "heading", "tilt", "roll",
    /// "fov", "easing"}`, the first at 0 seconds; `"camera": [LON, LAT], "height_km"` in the place of `look_at` and
    /// `distance_km` say where the camera itself stands, with its own heading and tilt. The easing says how it goes on to the
    /// next: "through" (flies on without a halt; so unless another is named), "in-out" (starts and ends at rest) or
    /// "linear" (goes evenly).
    #[arg(
        long,
        value_name = "FILE.json",
        conflicts_with_all = ["lon", "lat", "height", "look_at", "distance", "heading", "tilt", "roll", "fov", "turn", "orbit"]
    )]
    pub(crate) key_frames: Option<PathBuf>,
    /// Render workers to draw on, HOST:PORT[,HOST:PORT...]; this process if none is given.
    #[arg(
        long,
        env = "FLUXGLOBE_RENDER_WORKERS",
        value_delimiter = ',',
        value_name = "ADDRESSES"
    )]
    pub(crate) render_workers: Vec<WorkerAddress>,
    /// Pictures under way at the same time, 1 to 64.
    #[arg(long, default_value_t = 4, value_parser = value_parser!(u16).range(1..=64))]
    pub(crate) at_once: u16,
    /// The encoder of films; found by itself if absent.
    #[arg(
        long,
        env = "FLUXGLOBE_FFMPEG",
        default_value = "ffmpeg",
        value_name = "PROGRAM"
    )]
    pub(crate) ffmpeg: PathBuf,
}

/// `fluxglobe bench render`.
#[derive(Debug, Args)]
pub(crate) struct BenchRender {
    #[command(flatten)]
    pub(crate) bench: render_proof::bench::command::RenderBench,
    /// A product that has landed, in place of made-up scenes: at the middle of its last step, as people see it.
    #[arg(long, value_name = "PRODUCT", conflicts_with_all = ["millions", "pole", "tiles", "fill", "samples", "compare"])]
    pub(crate) layer: Option<ProductId>,
    /// The place of that product that is looked at, from 5300 km away.
    #[arg(
        long,
        value_name = "LON,LAT",
        default_value = "-150,0",
        allow_hyphen_values = true,
        requires = "layer"
    )]
    pub(crate) look_at: LonLatDeg,
}

/// `fluxglobe bench quality`.
#[derive(Debug, Args)]
pub(crate) struct BenchQuality {
    /// Product to measure besides the generated scenes, if it has landed; all its steps' middle is the instant.
    #[arg(long, default_value = "takahashi09-flux")]
    pub(crate) product: ProductId,
    /// Numbers of slices, each 1 to 256.
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "16,32,64,128,256",
        value_parser = value_parser!(u32).range(1..=256)
    )]
    pub(crate) slices: Vec<u32>,
    /// Width and height of the globe views, pixels, 16 to 512.
    #[arg(long, default_value_t = 160, value_parser = value_parser!(u32).range(16..=512))]
    pub(crate) size: u32,
    /// Particles of a cell at most, 1 to 256, on grids of coarse cells; as the product draws them if absent.
    #[arg(long, value_parser = value_parser!(u32).range(1..=256))]
    pub(crate) particles_per_cell: Option<u32>,
    /// Which scenes.
    #[arg(long, value_enum, default_value_t = QualityScenes::Usual)]
    pub(crate) scenes: QualityScenes,
    /// Only scenes that have this in their name.
    #[arg(long, value_name = "TEXT")]
    pub(crate) only: Option<String>,
    /// Fail, naming them, if scenes have less PSNR than this over what is drawn, with any of the numbers of slices.
    #[arg(long, value_name = "DB")]
    pub(crate) least_psnr: Option<f64>,
    /// Fail, naming them, if scenes have a larger mean FLIP than this over what is drawn.
    #[arg(long, value_name = "FLIP")]
    pub(crate) most_flip: Option<f64>,
    /// Plot to write: both measures over what is drawn.
    #[arg(long, value_name = "FILE.svg|FILE.png")]
    pub(crate) plot: Option<PlotFile>,
    /// Folder for the pictures: ours and the reference over a dark sea, and by how much ours is brighter (lighter than
    /// grey, eight times) or darker.
    #[arg(long, value_name = "FOLDER")]
    pub(crate) pictures: Option<PathBuf>,
    /// JSON instead of a table.
    #[arg(long)]
    pub(crate) json: bool,
}

/// A set of scenes to measure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum QualityScenes {
    /// Those that the method's constants were fitted to.
    Usual,
    /// Those that nothing was fitted to, most of them tilted.
    HeldOut,
    /// Both.
    All,
}

/// `fluxglobe bench serve`.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Three kinds of clients:
  new pictures (the usual)  each asks for an instant that nobody asked about, so that every answer is drawn
  --warm                    each asks for pictures of a set that was drawn before; answers must be the bytes of the first one
  --playback                each watches a window of map tiles and asks for the next instant when it has the last one whole
                            and its period has passed; six requests of a viewer at once, as browsers do

A client that is told to come again (503 with Retry-After) waits for so long and asks again; that is counted, and its time is
in the time of the answer. Anything else that is no whole picture of the size makes this fail.

Shares of stages, memory and processor time are what the server's /metrics grew by while answers were counted, of those
stages that it measures. Of a cluster name the render workers too: --figures http://HOST:9104,http://HOST2:9104

  fluxglobe bench serve --clients 16 --seconds 12                            views of the globe
  fluxglobe bench serve --tiles 3 --clients 8                                volume tiles of new instants
  fluxglobe bench serve --warm --tiles 3 --clients 64                        tiles that are drawn already
  fluxglobe bench serve --playback --seconds 600 --warm-up-seconds 30        two hundred viewers for ten minutes")]
pub(crate) struct BenchServe {
    /// Address of the server.
    #[arg(long, default_value = "http://127.0.0.1:8080")]
    pub(crate) url: String,
    /// Product to ask for; the first one that is drawn in the mode if absent.
    #[arg(long, value_name = "PRODUCT")]
    pub(crate) layer: Option<ProductId>,
    /// How it is drawn.
    #[arg(long, default_value = "volume")]
    pub(crate) mode: Mode,
    /// Ask for pictures that are drawn already.
    #[arg(long, conflicts_with = "playback")]
    pub(crate) warm: bool,
    /// Pictures of that set, which must fit into the server's memory for pictures.
    #[arg(long, default_value = "64", value_name = "COUNT")]
    pub(crate) set: NonZeroU16,
    /// Watch windows of map tiles while time runs.
    #[arg(long)]
    pub(crate) playback: bool,
    /// Size of a viewer's window, tiles; every fourth viewer looks at the window of the one before him.
    #[arg(long, default_value = "4x3", value_name = "COLUMNSxROWS")]
    pub(crate) window: WindowSize,
    /// How long a viewer looks at an instant at least, seconds.
    #[arg(long, default_value_t = 1.0, value_name = "SECONDS")]
    pub(crate) period_s: f64,
    /// From one instant to the next, days of the product's time.
    #[arg(long, default_value_t = 1.0, value_name = "DAYS")]
    pub(crate) days_per_period: f64,
    /// The viewers' first instants are spread over so many days; with 0 all look at the same ones.
    #[arg(long, default_value_t = 0.0, value_name = "DAYS")]
    pub(crate) apart_days: f64,
    /// Clients that ask at the same time, each for the next picture when it has the last, 1 to 1024; 200 viewers, else 16
    /// clients, if absent.
    #[arg(long, value_name = "COUNT", value_parser = clients)]
    clients: Option<NonZeroU16>,
    /// How long answers are counted.
    #[arg(long, default_value = "20")]
    pub(crate) seconds: NonZeroU16,
    /// How long is asked before that, so that fields are read and kernels compiled.
    #[arg(long, default_value_t = 3)]
    pub(crate) warm_up_seconds: u16,
    /// Tiles of this zoom level instead of views of the globe, 0 to 8; 4 for --playback if absent.
    #[arg(long, value_name = "ZOOM", value_parser = value_parser!(u8).range(0..=8))]
    pub(crate) tiles: Option<u8>,
    /// More processes to watch, those of render workers: where their /metrics are.
    #[arg(long, value_delimiter = ',', value_name = "URLS")]
    pub(crate) figures: Vec<String>,
    /// Width of a view, pixels.
    #[arg(long, default_value_t = 1920, value_parser = value_parser!(u32).range(1..=7680))]
    pub(crate) width: u32,
    /// Height of a view, pixels.
    #[arg(long, default_value_t = 1080, value_parser = value_parser!(u32).range(1..=7680))]
    pub(crate) height: u32,
    /// Longitude below the camera, degrees.
    #[arg(long, default_value_t = 0.0, allow_hyphen_values = true)]
    pub(crate) lon: f64,
    /// Latitude below the camera, degrees.
    #[arg(long, default_value_t = 0.0, allow_hyphen_values = true)]
    pub(crate) lat: f64,
    /// Height of the camera above the ground, km.
    #[arg(long, default_value_t = 15_000.0)]
    pub(crate) height_km: f64,
    /// Tilt of the camera, degrees; 0 looks straight down.
    #[arg(long, default_value_t = 0.0)]
    pub(crate) tilt: f64,
    /// JSON instead of a table.
    #[arg(long)]
    pub(crate) json: bool,
}

impl BenchServe {
    /// How many clients there are.
    pub(crate) fn clients(&self) -> NonZeroU16 {
        let usual = if self.playback { 200 } else { 16 };
        self.clients
            .or(NonZeroU16::new(usual))
            .unwrap_or(NonZeroU16::MIN)
    }

    /// Zoom level of viewers' tiles.
    pub(crate) fn zoom(&self) -> u8 {
        self.tiles.unwrap_or(4)
    }
}

/// `fluxglobe bench fly`.
#[derive(Debug, Args)]
pub(crate) struct BenchFly {
    /// Address of the server.
    #[arg(long, default_value = "http://127.0.0.1:8080")]
    pub(crate) url: String,
    /// Product to fly over; the first one that is drawn in the mode if absent.
    #[arg(long, value_name = "PRODUCT")]
    pub(crate) layer: Option<ProductId>,
    /// How it is drawn.
    #[arg(long, default_value = "volume")]
    pub(crate) mode: Mode,
    /// Viewers at the same time, 1 to 1024, each over a place of its own.
    #[arg(long, default_value = "1", value_parser = clients)]
    pub(crate) clients: NonZeroU16,
    /// How often a viewer says what its camera sees, each second.
    #[arg(long, default_value = "240", value_name = "RATE")]
    pub(crate) states_per_second: NonZeroU16,
    /// How long pictures are counted.
    #[arg(long, default_value = "20")]
    pub(crate) seconds: NonZeroU16,
    /// How long is flown before that, so that fields are read, kernels compiled and sizes chosen.
    #[arg(long, default_value_t = 5)]
    pub(crate) warm_up_seconds: u16,
    /// Width of the full picture, pixels.
    #[arg(long, default_value_t = 1920, value_parser = value_parser!(u32).range(1..=7680))]
    pub(crate) width: u32,
    /// Height of the full picture, pixels.
    #[arg(long, default_value_t = 1080, value_parser = value_parser!(u32).range(1..=7680))]
    pub(crate) height: u32,
    /// Longitude of the first viewer at the start, degrees.
    #[arg(long, default_value_t = -150.0, allow_hyphen_values = true)]
    pub(crate) lon: f64,
    /// Latitude below the cameras, degrees.
    #[arg(long, default_value_t = 0.0, allow_hyphen_values = true)]
    pub(crate) lat: f64,
    /// Height of the cameras above the ground, km.
    #[arg(long, default_value_t = 1500.0)]
    pub(crate) height_km: f64,
    /// Tilt of the cameras, degrees; 0 looks straight down.
    #[arg(long, default_value_t = 60.0)]
    pub(crate) tilt: f64,
    /// JSON instead of a table.
    #[arg(long)]
    pub(crate) json: bool,
}

/// A number of clients.
fn clients(text: &str) -> Result<NonZeroU16, String> {
    let count: Option<NonZeroU16> = text.parse().ok();
    let count = count.filter(|count| count.get() <= 1024);
    count.ok_or_else(|| "a whole number, 1 to 1024".to_owned())
}

/// `fluxglobe bench compare`.
#[derive(Debug, Args)]
pub(crate) struct BenchCompare {
    /// A picture.
    #[arg(value_name = "A.png")]
    pub(crate) a: PathBuf,
    /// Another of the same size.
    #[arg(value_name = "B.png")]
    pub(crate) b: PathBuf,
    /// Fail if fewer pixels than this lie within one level, percent.
    #[arg(long, value_name = "PERCENT")]
    pub(crate) least_within: Option<f64>,
    /// JSON instead of lines.
    #[arg(long)]
    pub(crate) json: bool,
}
