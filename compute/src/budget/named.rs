//! Sums of the named regions: which of them touch a grid, and storing those of a new version.

use contract::grid::Grid;
use contract::manifest::Manifest;
use contract::region::{NAMED_REGIONS, Region};
use storage::Store;

use super::measure::Measure;
use super::sums::{self, StoredSums};
use crate::region::weights::{self, EARTH, RegionKeys};
use crate::{ComputeError, Engine};

/// A named region that touches a grid.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Touching {
    /// Its name.
    pub(crate) name: &'static str,
    /// Where its weights are, or would be.
    pub(crate) weights: RegionKeys,
}

/// The named regions that have any area on a grid. Nothing is written.
pub(crate) async fn touching(store: &Store, grid: &Grid) -> Result<Vec<Touching>, ComputeError> {
    let mut touching = vec![];
    for named in NAMED_REGIONS {
        let region: Region = named.name.parse()?;
        let (grid, weights) = (*grid, RegionKeys::new(grid, &region, EARTH));
        if !store.exists(&weights.all).await? {
            let cover = move || weights::covers(&grid, &region, EARTH);
            let covered = tokio::task::spawn_blocking(cover).await;
            if !covered.map_err(|e| ComputeError::inconsistent("weights", e))?? {
                continue;
            }
        }
        touching.push(Touching {
            name: named.name,
            weights,
        });
    }
    Ok(touching)
}

/// Stores the sums of a version over one named region.
pub(crate) async fn store_sums(
    engine: &Engine,
    manifest: &Manifest,
    name: &str,
    measure: Measure,
) -> Result<StoredSums, ComputeError> {
    let weights = stored_weights(engine, manifest, name).await?;
    sums::store(engine, manifest, &weights, measure).await
}

/// The stored weights of a named region that touches a product's grid.
pub(crate) async fn stored_weights(
    engine: &Engine,
    manifest: &Manifest,
    name: &str,
) -> Result<RegionKeys, ComputeError> {
    let region: Region = name.parse()?;
    let weights = RegionKeys::stored(engine.store(), &manifest.grid, &region, EARTH).await?;
    weights.ok_or_else(|| ComputeError::inconsistent(name, "it does not touch the product's grid"))
}
