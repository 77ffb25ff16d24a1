//! What computations keep, for clean-up.

use std::collections::BTreeSet;

use async_trait::async_trait;
use contract::key::ObjectKey;
use contract::kind::Kind;
use contract::manifest::Manifest;
use contract::quantity::Quantity;
use contract::region::NAMED_REGIONS;
use storage::gc::{Kept, Owner};
use storage::{StorageError, Store};

use crate::budget::{Measure, sums};
use crate::derive::exact;
use crate::region::weights::{EARTH, RegionKeys};

/// Sums, states of accumulation and comparisons: kept while they are young or belong to a kept version.
#[derive(Debug)]
pub struct Computed;

#[async_trait]
impl Owner for Computed {
    fn kinds(&self) -> &'static [Kind] {
        &[Kind::Accumulating, Kind::Check, Kind::Sums]
    }

    fn is_made_again(&self) -> bool {
        true
    }

    async fn in_use(
        &self,
        _store: &Store,
        kept: &Kept,
    ) -> Result<BTreeSet<ObjectKey>, StorageError> {
        let manifests = kept.manifests.iter();
        Ok(manifests
            .flat_map(|manifest| {
                let state = exact_sums(manifest);
                named_sums(manifest).into_iter().chain(state)
            })
            .collect())
    }
}

/// The state of accumulation that the next step goes on from.
fn exact_sums(manifest: &Manifest) -> Vec<ObjectKey> {
    let is_accumulated = manifest.quantity == Quantity::AccumulatedCarbon;
    let last = manifest.steps.last().filter(|_| is_accumulated);
    let keys = last.map(|last| exact::keys(last.raw_sha256, &manifest.grid));
    keys.into_iter().flatten().collect()
}

/// Stored sums of the named regions.
fn named_sums(manifest: &Manifest) -> Vec<ObjectKey> {
    let (id, mut keys) = (manifest.id(), vec![]);
    for named in NAMED_REGIONS {
        let region = named.name.parse().expect("named regions have regions");
        let weights = RegionKeys::new(&manifest.grid, &region, EARTH);
        for measure in [Measure::Mass, Measure::Mean] {
            keys.push(sums::key(&id, &weights, measure));
        }
    }
    keys
}
