//! Platforms, their ways and pages of observations, as they are asked for and answered on the command line and over HTTP.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::{Observation, PlatformKind, Quality};
use crate::product::ProductId;
use crate::region::Region;
use crate::time::TimeMs;

/// Most rows of one page.
pub const MAX_LIMIT: u32 = 10_000;
/// Rows of a page if nothing is said.
const DEFAULT_LIMIT: u32 = 1000;
/// Most places of one track.
pub const MAX_PLACES: u32 = 100_000;

/// Which observations are wanted. An empty list means all.
#[derive(Debug, Clone, PartialEq)]
pub struct Filter {
    /// Where; edges belong to it.
    pub region: Region,
    /// First instant.
    pub from: Option<TimeMs>,
    /// First instant that is too late.
    pub to: Option<TimeMs>,
    /// Properties, such as `sea_surface_temperature`.
    pub properties: Vec<String>,
    /// Datasets.
    pub datasets: Vec<ProductId>,
    /// Names of platforms.
    pub platforms: Vec<String>,
    /// Kinds of platforms.
    pub kinds: Vec<PlatformKind>,
    /// The worst quality that is still wanted.
    pub worst: Quality,
    /// Most rows of the answer, 1 to [`MAX_LIMIT`].
    pub limit: u32,
    /// Where the page before ended: its `next`.
    pub after: Option<String>,
}

impl Default for Filter {
    /// All of them, whatever their quality.
    fn default() -> Self {
        Self {
            region: Region::Global,
            from: None,
            to: None,
            properties: vec![],
            datasets: vec![],
            platforms: vec![],
            kinds: vec![],
            worst: Quality::Bad,
            limit: DEFAULT_LIMIT,
            after: None,
        }
    }
}

/// Observations in the order of time, dataset, platform, property and depth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = ObservationPage)]
pub struct Page {
    /// The rows.
    pub observations: Vec<Observation>,
    /// What to ask with (`after`) for those after them; none where these are the last.
    #[schema(required)]
    pub next: Option<String>,
}

/// One platform of a dataset, over those of its observations that were asked for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Platform {
    /// Its dataset.
    pub dataset: ProductId,
    /// Its name in the dataset.
    pub platform: String,
    /// What it is, as its last observation says.
    pub kind: PlatformKind,
    /// Time of its first observation.
    pub first: TimeMs,
    /// Time of its last observation.
    pub last: TimeMs,
    /// West, south, east, north of its places, degrees; east passes 180 where they lie on both sides of the date line.
    #[schema(value_type = (f64, f64, f64, f64))]
    pub bounds_deg: [f64; 4],
    /// Longitude of its last observation, degrees east.
    pub lon_deg: f64,
    /// Latitude of its last observation, degrees north.
    pub lat_deg: f64,
    /// What it measures, sorted.
    pub properties: Vec<String>,
    /// Number of observations.
    pub count: u64,
}

/// Platforms by dataset and name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlatformList {
    /// The first ones, no more than the limit.
    pub platforms: Vec<Platform>,
    /// Are these all that the question is about?
    pub is_complete: bool,
}

/// Whose way is wanted, and when.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackQuery {
    /// Dataset of the platform.
    pub dataset: ProductId,
    /// Name of the platform.
    pub platform: String,
    /// First instant.
    pub from: Option<TimeMs>,
    /// First instant that is too late.
    pub to: Option<TimeMs>,
    /// Most places, 1 to [`MAX_PLACES`]. Of a way with more every n-th is given, and its first and last place always; of a
    /// limit of one the last.
    pub limit: u32,
}

impl TrackQuery {
    /// The whole way of a platform.
    pub fn new(dataset: ProductId, platform: impl Into<String>) -> Self {
        Self {
            dataset,
            platform: platform.into(),
            from: None,
            to: None,
            limit: MAX_PLACES,
        }
    }
}

/// A place of a platform at one time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TrackPoint {
    /// When.
    pub time: TimeMs,
    /// Longitude, degrees east, in [-180, 180).
    pub lon_deg: f64,
    /// Latitude, degrees north.
    pub lat_deg: f64,
}
