//! The series of a product over a region: its mean over the cells that hold data, by area, for every step.

use contract::cited::Cited;
use contract::manifest::Manifest;
use contract::series::{RegionSeries, RegionSeriesQuery, RegionValue};
use futures::future::BoxFuture;

use crate::budget::Measure;
use crate::budget::fixed::{AREA_DECIMALS, MASS_DECIMALS};
use crate::budget::over_region::{AskedArea, over_region};
use crate::budget::rows::{StepSum, coverage_percent};
use crate::summed::check_averaged;
use crate::{ComputeError, Engine, catalogue};

/// The series of a product over a region.
pub fn region_series<'a>(
    engine: &'a Engine,
    query: &'a RegionSeriesQuery,
) -> BoxFuture<'a, Result<RegionSeries, ComputeError>> {
    Box::pin(async move {
        let manifest = catalogue::product(engine.store(), &query.product).await?;
        region_series_of(engine, query, &manifest).await
    })
}

/// The same of one version of a product.
pub fn region_series_of<'a>(
    engine: &'a Engine,
    query: &'a RegionSeriesQuery,
    manifest: &'a Manifest,
) -> BoxFuture<'a, Result<RegionSeries, ComputeError>> {
    Box::pin(async move {
        check_averaged(engine.store(), manifest).await?;
        let (_window, steps) = manifest.steps_inside(query.from, query.to)?;
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
                mid: sum.period.mid(),
                mean: mean.map(|mean| mean * display.factor + display.offset),
                area_m2,
                coverage_percent: coverage_percent(m2(sum.sea_area_steps()), extent.ocean_m2),
            }
        };
        let series = sums.steps.iter().map(value).collect();
        Ok(RegionSeries {
            cited: Cited::of(manifest, manifest.id()),
            region: query.region_name.clone(),
            region_area_m2: extent.area_m2,
            ocean_area_m2: extent.ocean_m2,
            ocean_source: over.ocean_source,
            notes: extent.notes,
            earth: query.earth,
            series,
        })
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
