//! What is in use: every object that a kept version of a product or dataset names, or that belongs to one.

use std::collections::BTreeSet;

use contract::key::ObjectKey;
use contract::manifest::Manifest;
use contract::quantity::Quantity;
use contract::region::NAMED_REGIONS;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use storage::{Store, document, manifests};

use crate::ComputeError;
use crate::budget::named::EARTH;
use crate::budget::{Measure, sums};
use crate::derive::exact;
use crate::region::weights::RegionKeys;

/// Folder of the numbered indexes of datasets of observations.
pub(super) const INDEXES: &str = "observation-indexes";
/// The newest version of the indexes' JSON whose files are known.
const INDEX_SCHEMA: u32 = 2;

/// As much of an index of observations as says what it names.
#[derive(Deserialize)]
struct Index {
    schema: u32,
    months: Vec<Month>,
}

/// A month of an index.
#[derive(Deserialize)]
struct Month {
    file: ObjectKey,
}

/// Every object that a kept version names, or that belongs to one.
pub(super) async fn living(
    store: &Store,
    versions: usize,
) -> Result<BTreeSet<ObjectKey>, ComputeError> {
    let mut living = BTreeSet::new();
    observed(store, versions, &mut living).await?;
    for product in manifests::products(store).await? {
        let keys = store.list(&format!("manifests/{product}")).await?;
        for key in keys.iter().rev().take(versions) {
            let Some(manifest) = read::<Manifest>(store, key).await? else {
                continue;
            };
            if let Some(source) = &manifest.derived_from {
                let key = ObjectKey::manifest(&source.product, source.number);
                // The version that a kept one cites stays readable with it.
                if let Some(source) = read::<Manifest>(store, &key).await? {
                    add(&mut living, &source)?;
                }
            }
            add(&mut living, &manifest)?;
        }
    }
    Ok(living)
}

/// Every file of observations that a kept index names, and these indexes.
async fn observed(
    store: &Store,
    versions: usize,
    living: &mut BTreeSet<ObjectKey>,
) -> Result<(), ComputeError> {
    for dataset in store.folders(INDEXES).await? {
        let keys = store.list(&format!("{INDEXES}/{dataset}")).await?;
        for key in keys.into_iter().rev().take(versions) {
            let Some(index) = read::<Index>(store, &key).await? else {
                continue;
            };
            if index.schema > INDEX_SCHEMA {
                let reason = format!("its schema {} is unknown", index.schema);
                return Err(ComputeError::inconsistent(key.as_str(), reason));
            }
            living.extend(index.months.into_iter().map(|month| month.file));
            living.insert(key);
        }
    }
    Ok(())
}

/// A numbered list; none if it is gone.
async fn read<T: DeserializeOwned>(
    store: &Store,
    key: &ObjectKey,
) -> Result<Option<T>, ComputeError> {
    // A list that cannot be read names things that nobody knows: nothing may be removed.
    Ok(document::get(store, key).await?)
}

fn add(living: &mut BTreeSet<ObjectKey>, manifest: &Manifest) -> Result<(), ComputeError> {
    let product = &manifest.product;
    living.insert(ObjectKey::manifest(product, manifest.number));
    living.insert(manifest.domain.clone());
    living.extend(manifest.series.iter().map(|segment| segment.series.clone()));
    for step in &manifest.steps {
        living.insert(step.frame.clone());
        living.extend(step.contributed.iter().map(|step| step.counts.clone()));
        living.insert(ObjectKey::raw(product, &step.raw_sha256));
    }
    if manifest.quantity == Quantity::AccumulatedCarbon {
        living.extend(
            manifest
                .steps
                .last()
                .map(|last| exact::key(last.raw_sha256)),
        );
    }
    living.extend(named_sums(manifest)?);
    Ok(())
}

/// Stored sums of the named regions.
fn named_sums(manifest: &Manifest) -> Result<Vec<ObjectKey>, ComputeError> {
    let (id, mut keys) = (manifest.id(), vec![]);
    for named in NAMED_REGIONS {
        let region = named.name.parse()?;
        let weights = RegionKeys::new(&manifest.grid, &region, EARTH);
        for measure in [Measure::Mass, Measure::Mean] {
            keys.push(sums::key(&id, &weights, measure));
        }
    }
    Ok(keys)
}
