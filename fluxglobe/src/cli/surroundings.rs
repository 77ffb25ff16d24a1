//! Words for what surrounds the particles of a picture, and for its sun.

use clap::Args;
use contract::context::RELIEF_EXAGGERATION;
use contract::isolines::IsolineWish;
use contract::product::ProductId;
use contract::sun::SunChoice;
use contract::time::TimeMs;

/// The heading of these words in help texts.
pub(super) const HEADING: &str = "Surroundings";

/// What is drawn besides the product.
#[derive(Debug, Args)]
pub(crate) struct Surroundings {
    /// Land and sea floor of this elevation product below the particles, shaded by the sun, as in `--relief etopo20`.
    #[arg(long, help_heading = HEADING, value_name = "PRODUCT")]
    pub(crate) relief: Option<ProductId>,
    /// How much steeper slopes of the relief are than they are, 0 to 1000.
    #[arg(
        long,
        help_heading = HEADING,
        requires = "relief",
        default_value_t = RELIEF_EXAGGERATION,
        allow_negative_numbers = true,
        value_name = "TIMES"
    )]
    pub(crate) relief_exaggeration: f64,
    /// Share of what lies 100 km (as drawn) below the sea surface that the sea hides, 0 to 0.99, as in
    /// `--sea-opacity 0.4`; without it the sea is clear.
    #[arg(
        long,
        help_heading = HEADING,
        default_value_t = 0.0,
        hide_default_value = true,
        allow_negative_numbers = true,
        value_name = "SHARE"
    )]
    pub(crate) sea_opacity: f64,
    /// Draw coast lines and shores of lakes; on pictures of the globe true if absent, on map tiles false.
    #[arg(
        long,
        help_heading = HEADING,
        num_args = 0..=1,
        default_missing_value = "true",
        value_name = "true|false"
    )]
    pub(crate) coastlines: Option<bool>,
    /// Draw isolines of the layer on the sea surface: at multiples of STEP in the legend's unit, at most 50 over the range
    /// of colours, zero stronger; `auto` chooses a round step, and 1 and 3 of every power of ten on a logarithmic scale.
    #[arg(long, help_heading = HEADING, allow_negative_numbers = true, value_name = "STEP|auto")]
    pub(crate) isolines: Option<IsolineWish>,
    /// Draw trails along this vector on the sea surface, over the layer and below what rises from it: currents NAME, of
    /// which NAME-east and NAME-north have landed. They must cover the instant that is shown.
    #[arg(long, help_heading = HEADING, value_name = "PRODUCT")]
    pub(crate) trails: Option<ProductId>,
    /// Another instant of the vector than the one that is shown; the caption of an annotated picture says which.
    #[arg(long, help_heading = HEADING, requires = "trails", value_name = "TIME")]
    pub(crate) trails_time: Option<TimeMs>,
    /// Height of a kilogram of accumulated carbon per square metre, m: how far particles rise and sink, 0 to 1e9; 8e6 if
    /// absent.
    #[arg(long, help_heading = HEADING, allow_negative_numbers = true, value_name = "METRES")]
    pub(crate) height_exaggeration: Option<f64>,
    /// `time`: the real sun of the instant, with day and night; or its place in the sky in degrees,
    /// AZIMUTH,ELEVATION, as in `--sun 135,30`, 5 to 90 high; 315,40 if absent. Particles of map tiles are lit as by a sun no lower
    /// than 20 degrees.
    #[arg(long, help_heading = HEADING, value_name = "time|AZIMUTH,ELEVATION")]
    pub(crate) sun: Option<SunChoice>,
}
