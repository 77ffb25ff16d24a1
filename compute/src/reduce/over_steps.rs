//! Exact sums of some steps of a version over a region, by the one reduction.

use std::sync::Arc;

use contract::manifest::{Manifest, Step};
use cube::scale::Scale;
use cube::weight_unit::WeightUnit;

use super::cells::Cells;
use super::question::{Question, Wanted};
use super::region_sums::RegionStepSums;
use super::run::{changed_meanwhile, opened, run};
use super::tasks::Version;
use crate::budget::Measure;
use crate::region::loaded::RegionWeights;
use crate::{ComputeError, Engine};

/// A region's weights on a product's grid, and where they are.
pub(crate) struct RegionOnGrid {
    /// Addresses of all of it and of its sea.
    pub(crate) addresses: [Arc<str>; 2],
    /// All of it.
    pub(crate) whole: Arc<RegionWeights>,
    /// Its sea.
    pub(crate) sea: Arc<RegionWeights>,
}

/// Sums of these steps of a version, in their order.
pub(crate) async fn sums_over_region(
    engine: &Engine,
    manifest: &Manifest,
    steps: &[&Step],
    region: &RegionOnGrid,
    measure: Measure,
) -> Result<Vec<RegionStepSums>, ComputeError> {
    let at = |step: &&Step| {
        let start = step.period.start;
        let found = manifest
            .steps
            .binary_search_by_key(&start, |own| own.period.start);
        found
            .ok()
            .ok_or_else(|| ComputeError::inconsistent("sums", "a step is not the version's"))
    };
    let at: Vec<usize> = steps.iter().map(at).collect::<Result<_, _>>()?;
    let id = manifest.id();
    let values = opened(engine, manifest, &id).await?;
    let version = Version {
        store: engine.store(),
        manifest,
        id: &id,
        values: values.as_ref(),
    };
    let shape = [manifest.grid.rows, manifest.grid.cols];
    let unit = WeightUnit::default();
    let cells = Cells {
        shape,
        whole: &region.whole,
        covered: &region.sea,
        unit,
    };
    let [whole, covered] = region.addresses.clone();
    let question = Question {
        version: id.clone(),
        shape,
        whole,
        covered,
        unit,
        scale: Scale::of_all(),
        wanted: Wanted::RegionSums {
            grid: manifest.grid,
            measure,
        },
    };
    let mut sums = Vec::with_capacity(at.len());
    // Runs are read whole: what is asked for in pieces is summed in pieces, or a step would count twice.
    for together in at.chunk_by(|before, next| before + 1 == *next) {
        let asked = together[0] as u32..together[0] as u32 + together.len() as u32;
        let pieces = |version: Version<'_>| {
            let runs = version.runs(asked.clone(), &cells, None).into_iter();
            runs.flat_map(|run| run.pieces).collect()
        };
        let along_time = pieces(version);
        let along_time = run(engine, question.clone(), values.clone(), along_time);
        let found = if let Some(found) = along_time.await? {
            found
        } else {
            let fields = Version {
                values: None,
                ..version
            };
            let found = run(engine, question.clone(), None, pieces(fields)).await?;
            found.ok_or_else(changed_meanwhile)?
        };
        let mut found = found.regions;
        for step in asked {
            let own = found.remove(&step);
            sums.push(
                own.ok_or_else(|| ComputeError::inconsistent("sums", "a step was not summed"))?,
            );
        }
    }
    Ok(sums)
}
