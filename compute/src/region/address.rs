//! How queries name a region's weights: by where they are stored, or by the question itself.
//!
//! An engine that answers strangers stores nothing for them, however many regions they think of. Regions that have a name
//! are few: their weights are stored for everybody.

use std::sync::Arc;

use contract::geometry::Geometry;
use contract::key::ObjectKey;
use contract::region::{NAMED_REGIONS, NamedRegion};
use storage::{StorageError, Store};

use super::computed::ComputedWeights;
use super::loaded::weights_failed;
use super::weights::{EARTH, OnGrid, RegionKeys, Surface};
use crate::{ComputeError, Engine};

/// A region's weights as queries name them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct RegionAddress {
    /// What they are stored under, if anybody stored them; sums are named by it either way.
    pub(crate) keys: RegionKeys,
    /// Of all of the region: an address, or a question, which is as long as the text of the region and held once however many ask it.
    pub(crate) all: Arc<str>,
    /// The same of its sea.
    pub(crate) ocean: Arc<str>,
}

impl RegionAddress {
    /// Weights that are stored.
    pub(crate) fn stored(store: &Store, keys: RegionKeys) -> Self {
        let address = |key| store.sql_url(key).to_string().into();
        Self {
            all: address(&keys.all),
            ocean: address(&keys.ocean),
            keys,
        }
    }

    /// The weights of a region, stored now if the engine may and the store takes them; none if it lies outside the grid.
    pub(crate) async fn of(
        engine: &Engine,
        asked: OnGrid<'_>,
    ) -> Result<Option<Self>, ComputeError> {
        let store = engine.store();
        if engine.stores_weights() || is_for_everybody(asked) {
            return match RegionKeys::stored_of(store, asked).await {
                Ok(keys) => Ok(keys.map(|keys| Self::stored(store, keys))),
                Err(ComputeError::Storage(error)) if error.takes_nothing() => {
                    Self::unstored(engine, asked, error).await
                }
                Err(error) => Err(error),
            };
        }
        Self::asked(engine, asked).await
    }

    /// Weights that the store does not take: they are computed for this question alone.
    ///
    /// # Errors
    /// That of the store for a region so large that its weights must be stored.
    async fn unstored(
        engine: &Engine,
        asked: OnGrid<'_>,
        refusal: StorageError,
    ) -> Result<Option<Self>, ComputeError> {
        match Self::asked(engine, asked).await {
            // What this would say is to ask with a command, which stores them.
            Err(ComputeError::Region { .. }) => Err(refusal.into()),
            Err(error) => Err(error),
            Ok(found) => {
                tracing::warn!(error = %refusal, "weights of the region are not stored; they are computed for this question");
                Ok(found)
            }
        }
    }

    /// Weights of which those that nobody stored are a question.
    async fn asked(engine: &Engine, asked: OnGrid<'_>) -> Result<Option<Self>, ComputeError> {
        let store = engine.store();
        let keys = RegionKeys::of(asked);
        let all = found_or_asked(store, &keys.all, asked, &Surface::All).await?;
        let ocean = found_or_asked(store, &keys.ocean, asked, asked.ocean).await?;
        let whole = engine.objects().weights(&all).await;
        let is_outside = whole.map_err(weights_failed)?.chunk_count() == 0;
        Ok((!is_outside).then_some(Self { keys, all, ocean }))
    }
}

/// One of a bounded number of regions, weighed as the sums are that are stored of new versions.
fn is_for_everybody(asked: OnGrid<'_>) -> bool {
    let is_named = || {
        let mut regions = NAMED_REGIONS.iter().map(NamedRegion::region);
        regions.any(|region| region == *asked.region)
    };
    asked.earth == EARTH && *asked.ocean == Surface::Ocean && is_named()
}

/// The address of stored weights, else the question.
async fn found_or_asked(
    store: &Store,
    key: &ObjectKey,
    asked: OnGrid<'_>,
    surface: &Surface,
) -> Result<Arc<str>, ComputeError> {
    match storage::weights::check(store, key).await {
        Ok(()) => return Ok(store.sql_url(key).to_string().into()),
        Err(e) if e.is_not_found() => {}
        Err(error @ StorageError::Damaged { .. }) => {
            tracing::warn!(%error, "weights are computed again");
        }
        Err(e) => return Err(e.into()),
    }
    let question = ComputedWeights {
        grid: *asked.grid,
        geometry: Geometry::Region(asked.region.clone()),
        earth: asked.earth,
        surface: surface.clone(),
        shares_at: surface
            .shares()
            .map(|shares| store.sql_url(&shares.field).to_string()),
    };
    question.check_size()?;
    Ok(question.text().into())
}
