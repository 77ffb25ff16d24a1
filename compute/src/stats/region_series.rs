//! The series of a product over a region: its mean over the cells that hold data, by area, for every step.

use std::sync::Arc;

use contract::earth::Earth;
use contract::manifest::{Manifest, ManifestId};
use contract::product::ProductId;
use contract::region::Region;
use contract::time::TimeMs;
use serde::{Deserialize, Serialize};

use crate::budget::fixed::{AREA_DECIMALS, MASS_DECIMALS};
use crate::budget::over_region::{AskedArea, over_region};
use crate::budget::rows::{StepSum, coverage_percent};
use crate::budget::steps_inside;
use crate::budget::sums::Measure;
use crate::{ComputeError, Engine, catalogue};

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

/// One step of a series.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RegionValue {
    /// First instant that it covers.
    pub start: TimeMs,
    /// First instant after it.
    pub end: TimeMs,
    /// Mean by area over the cells with data, in the answer's unit; none where no cell has any.
    pub mean: Option<f64>,
    /// Area that holds data, m².
    pub area_m2: f64,
    /// Share of the region's sea that holds data, percent; 0 where it holds no sea.
    pub coverage_percent: f64,
}

/// A series with all that is needed to cite it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RegionSeries {
    /// Product.
    pub product: ProductId,
    /// The version of the product that was read.
    pub manifest: ManifestId,
    /// Title of the product.
    pub title: String,
    /// Citation of the product.
    pub source: String,
    /// Made up by a program rather than measured.
    pub synthetic: bool,
    /// Name of the quantity.
    pub quantity: String,
    /// Unit of the values.
    pub unit: String,
    /// Name of the region.
    pub region: String,
    /// Area of the region, land included, m².
    pub region_area_m2: f64,
    /// Area of the sea in it, m².
    pub ocean_area_m2: f64,
    /// What says which part of a cell is sea.
    #[serde(default)]
    pub ocean_source: String,
    /// How the region was taken where that may surprise.
    pub notes: Vec<String>,
    /// Figure of the earth.
    pub earth: Earth,
    /// Values in the order of time.
    pub series: Vec<RegionValue>,
}

/// The series of a product over a region.
pub async fn region_series(
    engine: &Engine,
    query: &RegionSeriesQuery,
) -> Result<RegionSeries, ComputeError> {
    let manifest = catalogue::product(engine.store(), &query.product).await?;
    region_series_of(engine, query, &manifest).await
}

/// The same of one version of a product.
pub async fn region_series_of(
    engine: &Engine,
    query: &RegionSeriesQuery,
    manifest: &Manifest,
) -> Result<RegionSeries, ComputeError> {
    let (_window, steps) = steps_inside(manifest, query.from, query.to)?;
    let area = AskedArea {
        region: &query.region,
        earth: query.earth,
        ocean: query.ocean.as_deref(),
    };
    let over = over_region(engine, manifest, &steps, area, Measure::Mean).await?;
    let (sums, extent) = (over.sums, over.extent);
    let display = manifest.quantity.display();
    let value = |sum: &StepSum| {
        let (mean, area_m2) = mean_and_area(sum);
        RegionValue {
            start: sum.period.start,
            end: sum.period.end,
            mean: mean.map(|mean| mean * display.factor + display.offset),
            area_m2,
            coverage_percent: coverage_percent(m2(sum.sea_area_steps()), extent.ocean_m2),
        }
    };
    let series = sums.steps.iter().map(value).collect();
    Ok(RegionSeries {
        product: manifest.product.clone(),
        manifest: manifest.id(),
        title: manifest.title.clone(),
        source: manifest.source.clone(),
        synthetic: manifest.synthetic,
        quantity: manifest.quantity.title().to_owned(),
        unit: display.unit.to_owned(),
        region: query.region_name.clone(),
        region_area_m2: extent.area_m2,
        ocean_area_m2: extent.ocean_m2,
        ocean_source: over.ocean_source,
        notes: extent.notes,
        earth: query.earth,
        series,
    })
}

fn m2(steps: i128) -> f64 {
    steps as f64 / 10f64.powi(AREA_DECIMALS as i32)
}

/// Mean in the stored unit over the cells with data, none without any, and their area, m².
fn mean_and_area(sum: &StepSum) -> (Option<f64>, f64) {
    let area_m2 = m2(sum.area_steps);
    let integral = sum.mass_steps as f64 / 10f64.powi(MASS_DECIMALS as i32);
    ((sum.area_steps > 0).then(|| integral / area_m2), area_m2)
}
