//! The series of a product over a region: its mean over the cells that hold data, by area, for every step.

use contract::cited::Cited;
use contract::geometry::{AskedGeometry, Geometry};
use contract::manifest::{Manifest, ManifestId};
use contract::quantity::Quantity;
use contract::region::Cells;
use contract::series::{RegionSeries, RegionSeriesQuery, RegionValue};
use contract::statistics::StatisticsQuery;
use futures::future::BoxFuture;

use crate::budget::Measure;
use crate::budget::fixed::{AREA_DECIMALS, MASS_DECIMALS};
use crate::budget::over_region::{AskedArea, extent_of, over_region, weights};
use crate::budget::rows::{StepSum, coverage_percent};
use crate::complete_sums::told_of_sums;
use crate::derive::accumulated_from;
use crate::reduce::{RegionMeans, StepMean, means_over_region};
use crate::region::loaded::weights_failed;
use crate::summed::check_averaged;
use crate::{ComputeError, Engine, catalogue};

/// Below this area a sum in steps of 1e-9 of the unit may hold too few of them, m²: 1e-8 of a flux of 1e-9 kg m⁻² s⁻¹.
const SMALL_M2: f64 = 1e8;

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
        check_averaged(manifest)?;
        let id = manifest.id();
        // Sums as budgets have them are in steps of 1e-9 of the unit: nothing of a concentration of 1e-17, too many of a heat of 1e11, and of
        // a flux of 1e-9 in a square of 10 m a hundred.
        let has_own_steps = match manifest.quantity {
            Quantity::Open(_) => true,
            _ => extent_of(engine, asked_area(query)).await?.area_m2 < SMALL_M2,
        };
        let mut means = if has_own_steps {
            in_own_steps(engine, query, manifest, &id).await?
        } else {
            in_steps_of_masses(engine, query, manifest).await?
        };
        means
            .notes
            .extend(incomplete(engine, query, manifest).await?);
        let display = manifest.quantity.display();
        let value = |step: &StepMean| RegionValue {
            start: step.period.start,
            end: step.period.end,
            mid: step.period.mid(),
            mean: step.mean.map(|mean| mean * display.factor + display.offset),
            area_m2: step.area_m2,
            coverage_percent: coverage_percent(step.sea_m2, means.ocean_m2),
        };
        Ok(RegionSeries {
            series: means.steps.iter().map(value).collect(),
            cited: Cited::of(manifest, id),
            region: query.region_name.clone(),
            region_area_m2: means.area_m2,
            ocean_area_m2: means.ocean_m2,
            ocean_source: means.ocean_source,
            notes: means.notes,
            earth: query.earth,
        })
    })
}

/// What is to be said of sums of accumulated carbon.
async fn incomplete(
    engine: &Engine,
    query: &RegionSeriesQuery,
    manifest: &Manifest,
) -> Result<Option<String>, ComputeError> {
    let (_window, inside) = manifest.steps_inside(query.from, query.to)?;
    let is_accumulated = accumulated_from(manifest).is_some();
    let Some(last) = inside.last().filter(|_| is_accumulated) else {
        return Ok(None);
    };
    let address = weights(engine, manifest, asked_area(query)).await?.all;
    let areas = engine.objects().weights(&address).await;
    let areas = areas.map_err(weights_failed)?;
    told_of_sums(engine, manifest, &areas, last).await
}

fn asked_area(query: &RegionSeriesQuery) -> AskedArea<'_> {
    AskedArea {
        region: &query.region,
        earth: query.earth,
        ocean: query.ocean.as_deref(),
    }
}

/// Means of a quantity whose values may be of any size, or over a region that may be.
async fn in_own_steps(
    engine: &Engine,
    query: &RegionSeriesQuery,
    manifest: &Manifest,
    id: &ManifestId,
) -> Result<RegionMeans, ComputeError> {
    let geometry = AskedGeometry {
        geometry: Geometry::Region(query.region.clone()),
        name: query.region_name.clone(),
    };
    let asked = StatisticsQuery {
        from: query.from,
        to: query.to,
        earth: query.earth,
        cells: Cells::Whole,
        ocean: query.ocean.clone(),
        ..StatisticsQuery::new(query.product.clone(), geometry)
    };
    means_over_region(engine, &asked, manifest, id).await
}

/// Means made of exact sums, which may be stored.
async fn in_steps_of_masses(
    engine: &Engine,
    query: &RegionSeriesQuery,
    manifest: &Manifest,
) -> Result<RegionMeans, ComputeError> {
    let (_window, steps) = manifest.steps_inside(query.from, query.to)?;
    let over = over_region(engine, manifest, &steps, asked_area(query), Measure::Mean).await?;
    let mean = |sum: &StepSum| {
        let (mean, area_m2) = mean_and_area(sum);
        StepMean {
            period: sum.period,
            mean,
            area_m2,
            sea_m2: m2(sum.sea_area_steps()),
        }
    };
    Ok(RegionMeans {
        area_m2: over.extent.area_m2,
        ocean_m2: over.extent.ocean_m2,
        ocean_source: over.ocean_source,
        notes: over.extent.notes,
        steps: over.sums.steps.iter().map(mean).collect(),
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
