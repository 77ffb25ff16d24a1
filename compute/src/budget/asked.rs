//! Exact sums of a region's share of some steps: blocks and chunks are read where the region is, and only sums leave the task that read
//! them (`reduce`).

use contract::grid::Grid;
use contract::manifest::{Manifest, Step};

use super::bands::{BAND_COUNT, band_areas};
use super::measure::Measure;
use super::rows::StepSum;
use crate::reduce::{RegionOnGrid, sums_over_region};
use crate::region::address::RegionAddress;
use crate::region::loaded::weights_failed;
use crate::{ComputeError, Engine};

/// A region on a grid, its weights read.
pub(super) struct WeighedRegion {
    on_grid: RegionOnGrid,
    /// Area of the region on the grid, m².
    pub(super) on_grid_m2: f64,
    /// Area of its sea in every band, m² in steps of 10⁻⁶.
    pub(super) sea_steps: [i128; BAND_COUNT],
}

impl WeighedRegion {
    /// Reads the weights.
    pub(super) async fn read(
        engine: &Engine,
        grid: &Grid,
        weights: &RegionAddress,
    ) -> Result<Self, ComputeError> {
        let weighed = async |address: &str| {
            let weights = engine.objects().weights(address).await;
            weights.map_err(weights_failed)
        };
        let (whole, sea) = (weighed(&weights.all).await?, weighed(&weights.ocean).await?);
        let sea_areas = sea.chunks().map(|(chunk, areas)| (chunk, areas.to_vec()));
        let sea_steps = band_areas(grid, sea_areas)
            .map_err(|e| ComputeError::inconsistent(weights.keys.ocean.as_str(), e))?;
        Ok(Self {
            on_grid_m2: whole.cells().sum(),
            on_grid: RegionOnGrid {
                addresses: [weights.all.clone(), weights.ocean.clone()],
                whole,
                sea,
            },
            sea_steps,
        })
    }
}

/// Exact sums of steps of a version in their order.
pub(super) async fn asked(
    engine: &Engine,
    manifest: &Manifest,
    steps: &[&Step],
    region: &WeighedRegion,
    measure: Measure,
) -> Result<Vec<StepSum>, ComputeError> {
    let sums = sums_over_region(engine, manifest, steps, &region.on_grid, measure).await?;
    let sum = |(step, sums): (&&Step, _)| {
        let sums: &crate::reduce::RegionStepSums = sums;
        let [mass_steps, area_steps] = sums.whole();
        StepSum {
            period: step.period,
            mass_steps,
            area_steps,
            sea: sums.sea(),
        }
    };
    Ok(steps.iter().zip(&sums).map(sum).collect())
}
