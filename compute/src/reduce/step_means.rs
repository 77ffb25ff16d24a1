//! The mean of every step over a region, and what it is set against: a version and a region in; means in steps of their own values out.

use contract::manifest::{Manifest, ManifestId};
use contract::statistics::StatisticsQuery;
use contract::time::Period;
use futures::future::BoxFuture;

use super::answer::Reduction;
use super::question::Wanted;
use super::weighed::Weighed;
use crate::{ComputeError, Engine};

/// The mean of a step over a region.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct StepMean {
    /// All of the step, also where it reaches out of the asked period.
    pub(crate) period: Period,
    /// By area over the cells with data, stored unit; none without any.
    pub(crate) mean: Option<f64>,
    /// Area of these, m².
    pub(crate) area_m2: f64,
    /// The sea in that, m².
    pub(crate) sea_m2: f64,
}

/// Means over a region, step by step.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct RegionMeans {
    /// Area of the region, wherever the grid lies, m².
    pub(crate) area_m2: f64,
    /// The sea in it, m².
    pub(crate) ocean_m2: f64,
    /// What says which part of a cell is sea.
    pub(crate) ocean_source: String,
    /// How the region was taken where that may surprise.
    pub(crate) notes: Vec<String>,
    /// In the order of time.
    pub(crate) steps: Vec<StepMean>,
}

/// The means of the steps that reach into the period of a question about a region, whose statistics and rows are not looked at. They are those that
/// the statistic `mean` has of native steps: of whatever size values are, they are summed in steps far below it.
///
/// # Errors
/// No step in the period, a region beside the grid, and what reading meets.
pub(crate) fn means_over_region<'a>(
    engine: &'a Engine,
    query: &'a StatisticsQuery,
    manifest: &'a Manifest,
    id: &'a ManifestId,
) -> BoxFuture<'a, Result<RegionMeans, ComputeError>> {
    Box::pin(async move {
        let (window, inside) = manifest.steps_inside(query.from, query.to)?;
        let weighed = Weighed::of(engine, manifest, query).await?;
        let count = (window, inside.len());
        let reduction = Reduction::of(engine, (manifest, id), &weighed, count).await?;
        let wanted = Wanted::Sums {
            with_squares: false,
            with_extremes: false,
        };
        let periods: Vec<Period> = manifest.steps.iter().map(|step| step.period).collect();
        let inside: Vec<Period> = inside.iter().map(|step| step.period).collect();
        // A step by itself is a bin that counts it once.
        let (sums, scales) = reduction.summed(&periods, &inside, wanted).await?;
        let unit_m2 = weighed.unit.size();
        let steps = sums.iter().zip(scales).map(|(of_step, scale)| {
            // What has no data has no sums.
            let own = &of_step.sums;
            StepMean {
                period: of_step.period,
                mean: (own.weight > 0).then(|| scale.mean(own.sum, own.weight)),
                area_m2: own.weight as f64 * unit_m2,
                sea_m2: own.covered as f64 * unit_m2,
            }
        });
        let steps = steps.collect();
        Ok(RegionMeans {
            area_m2: weighed.size,
            ocean_m2: weighed.covered_size,
            ocean_source: weighed.ocean_source.unwrap_or_default(),
            notes: weighed.notes,
            steps,
        })
    })
}
