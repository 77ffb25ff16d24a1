//! Latitude or longitude against time.

use std::fmt::{Display, Formatter};
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::ContractError;
use crate::cited::Cited;
use crate::earth::Earth;
use crate::product::ProductId;
use crate::region::AskedRegion;
use crate::statistics::MinCoverage;
use crate::time::{TimeMs, TimeStep};

/// What bands lie along.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum Along {
    /// Bands of latitude: means over longitude.
    Lat,
    /// Bands of longitude: means over latitude.
    Lon,
}

impl Along {
    /// Name on the command line and in addresses.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Lat => "lat",
            Self::Lon => "lon",
        }
    }
}

impl Display for Along {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.as_str())
    }
}

impl FromStr for Along {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        match s {
            "lat" => Ok(Self::Lat),
            "lon" => Ok(Self::Lon),
            _ => Err(ContractError::invalid("along", s, "lat or lon")),
        }
    }
}

/// What is asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct HovmollerQuery {
    /// Product.
    pub product: ProductId,
    /// What bands lie along.
    pub along: Along,
    /// Height or width of a band, degrees; if absent the least of 1, 2, 5, 10 that is no less than a cell.
    pub band_deg: Option<f64>,
    /// Of a box the cells whose middles lie in it; of polygons their exact share of every cell. All cells if absent.
    pub region: Option<AskedRegion>,
    /// What a row covers.
    pub step: TimeStep,
    /// First instant; the product's first if absent.
    pub from: Option<TimeMs>,
    /// First instant after the asked period; the product's end if absent.
    pub to: Option<TimeMs>,
    /// Figure of the earth for areas.
    pub earth: Earth,
    /// Means of bands whose coverage is below this are left out, percent.
    pub min_coverage: MinCoverage,
}

/// Means of bands against time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Hovmoller {
    /// What it is to be cited with.
    #[serde(flatten)]
    pub cited: Cited,
    /// What bands lie along.
    pub along: Along,
    /// Height or width of a band, degrees.
    pub band_deg: f64,
    /// West, south, east, north of the cells whose middles count; of polygons of the cells that they touch.
    pub bounds_deg: [f64; 4],
    /// The region of polygons whose share of every cell counts; none of a box, of which cells count whole.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub region: Option<String>,
    /// What a row covers (one row of all: the profile of bands); of months and years each step counts by the time that lies in it.
    pub step: TimeStep,
    /// Figure of the earth for areas.
    pub earth: Earth,
    /// What coverage is a share of.
    pub coverage_basis: String,
    /// Means of bands whose coverage is below this are left out, percent.
    #[serde(default)]
    pub min_coverage_percent: f64,
    /// Means that were left out for that: there are data, and less than the least coverage.
    #[serde(default)]
    pub left_out_count: u64,
    /// What may surprise: how the region was taken, bands that it does not touch, means that were left out.
    pub notes: Vec<String>,
    /// Bands from the south or the west.
    pub bands: Vec<HovmollerBand>,
    /// One for each step in the order of time.
    pub rows: Vec<HovmollerRow>,
}

/// A band: cells whose middles lie in it, its lower edge included; of polygons their shares of these cells.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct HovmollerBand {
    /// Its southern or western edge, degrees.
    pub low_deg: f64,
    /// Its northern or eastern edge, degrees.
    pub high_deg: f64,
    /// Area of its cells that hold data in some step, or of the region's shares of these, m².
    pub area_m2: f64,
    /// Area of the region in it on the grid, m²: 0 of a band that polygons do not touch; none of a box.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub region_area_m2: Option<f64>,
    /// Area of the region's sea in it on the grid, m²; none of a box.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub ocean_area_m2: Option<f64>,
}

/// A step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct HovmollerRow {
    /// First instant that it covers.
    pub start: TimeMs,
    /// First instant after it.
    pub end: TimeMs,
    /// Mean of each band over its cells with data, by area; none without any, or where too little is covered.
    pub means: Vec<Option<f64>>,
    /// Standard deviation of each band's values about its mean, by area and time, in the unit of the values: √(Σ w (x - m)² / Σ w), of
    /// the values as they are, as the statistic `std`. Of the whole period (`total`) alone.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub stds: Vec<Option<f64>>,
    /// Share of each band, and of the row's time, that holds data, percent: of what `coverage_basis` says.
    pub coverage_percent: Vec<f64>,
}
