//! Series of a product at a place and over a region, as they are asked for and answered on the command line and over HTTP.

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::cited::Cited;
use crate::earth::Earth;
use crate::manifest::Manifest;
use crate::product::ProductId;
use crate::region::{AskedRegion, Region};
use crate::time::TimeMs;

/// The series of a cell, with all that is needed to cite it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct PointSeries {
    /// What it is to be cited with.
    #[serde(flatten)]
    pub cited: Cited,
    /// Asked longitude, degrees, in [-180, 180).
    pub lon_deg: f64,
    /// Asked latitude, degrees.
    pub lat_deg: f64,
    /// The cell that holds the place: the values are its mean, not those of the very place.
    pub cell: Cell,
    /// One value for each step, in the order of time.
    pub series: Vec<PointValue>,
}

/// A cell of a product's grid.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Cell {
    /// Row, 0 is the northernmost.
    pub row: u32,
    /// Column, eastwards.
    pub col: u32,
    /// Longitude of its centre, degrees.
    pub lon_deg: f64,
    /// Latitude of its centre, degrees.
    pub lat_deg: f64,
}

/// The value of a step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct PointValue {
    /// First instant that it covers.
    pub start: TimeMs,
    /// First instant after it.
    pub end: TimeMs,
    /// The middle.
    pub mid: TimeMs,
    /// In the answer's unit; none where the cell holds no data.
    #[schema(required)]
    pub value: Option<f64>,
    /// What a sum of accumulated carbon holds; none for other values, and where nobody can tell any more.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub contributed: Option<CellCounts>,
}

/// What the sum of a cell after a step holds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct CellCounts {
    /// Steps that had data.
    pub steps: u32,
    /// Steps since accumulation started.
    pub of_steps: u32,
    /// Share of the time since then that had data, percent; below 100 the sum is not complete.
    pub time_percent: f64,
}

/// What a series over a region is asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct RegionSeriesQuery {
    /// Product.
    pub product: ProductId,
    /// Region.
    pub region: Region,
    /// What the answer calls the region.
    pub region_name: String,
    /// First instant; the product's first if absent.
    pub from: Option<TimeMs>,
    /// First instant after the asked period; the product's end if absent.
    pub to: Option<TimeMs>,
    /// Figure of the earth.
    pub earth: Earth,
    /// A version of a product on the same grid that says how much of every cell is sea or land; Natural Earth if absent.
    pub ocean: Option<Arc<Manifest>>,
}

impl RegionSeriesQuery {
    /// The usual question about a region: all steps.
    pub fn new(product: ProductId, asked: AskedRegion) -> Self {
        Self {
            product,
            region: asked.region,
            region_name: asked.name,
            from: None,
            to: None,
            earth: Earth::default(),
            ocean: None,
        }
    }
}

/// The mean of a product over a region, step by step, with all that is needed to cite it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RegionSeries {
    /// What it is to be cited with.
    #[serde(flatten)]
    pub cited: Cited,
    /// The region by its name, or as `west,south,east,north`.
    pub region: String,
    /// Area of the region, land included, m².
    pub region_area_m2: f64,
    /// Area of the sea in it, m².
    pub ocean_area_m2: f64,
    /// What says which part of a cell is sea.
    pub ocean_source: String,
    /// How the region was taken where that may surprise.
    pub notes: Vec<String>,
    /// Figure of the earth for areas.
    pub earth: Earth,
    /// One mean for each step in the period, in the order of time.
    pub series: Vec<RegionValue>,
}

/// The mean of a step over a region.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RegionValue {
    /// First instant that it covers.
    pub start: TimeMs,
    /// First instant after it.
    pub end: TimeMs,
    /// The middle.
    pub mid: TimeMs,
    /// Mean by area over the cells with data, in the answer's unit; none where no cell has any.
    #[schema(required)]
    pub mean: Option<f64>,
    /// Area that holds data, m².
    pub area_m2: f64,
    /// Share of the region's sea that holds data, percent; 0 where it holds no sea.
    pub coverage_percent: f64,
}
