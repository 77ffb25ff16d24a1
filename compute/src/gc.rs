//! Clean-up: objects that no kept version names and that are old enough to be in nobody's hands.
//!
//! What makes up a version (frames, series, domains, raw files, manifests) is kept as long as its manifest is among the
//! newest of its product, or was a source of one that is. What can be made again from those (tiles, sums, states of
//! accumulation, comparisons) is kept as long as it is young or belongs to a kept version. Weights and observations are
//! never removed here.

use std::collections::BTreeSet;
use std::time::Duration;

use contract::key::ObjectKey;
use contract::manifest::Manifest;
use contract::quantity::Quantity;
use contract::region::NAMED_REGIONS;
use contract::time::TimeMs;
use futures::TryStreamExt as _;
use object_store::ObjectStore as _;
use object_store::path::Path;
use serde::Serialize;
use storage::{StorageError, Store, manifests};

use crate::ComputeError;
use crate::budget::named::EARTH;
use crate::budget::{Measure, sums};
use crate::derive::exact;
use crate::region::weights;

/// Folders of what versions are made of.
const VERSIONED: [&str; 5] = ["domain", "frames", "manifests", "raw", "series"];
/// Folders of what can be made again.
const MADE_AGAIN: [&str; 4] = [exact::FOLDER, "checks", sums::FOLDER, "tiles"];
/// The youngest age that may be removed: whoever is writing has long been done.
pub const LEAST_AGE: Duration = Duration::from_hours(1);

/// What is kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Keep {
    /// Newest versions of each product, at least one.
    pub versions: usize,
    /// Whatever was written so long ago or later; at least [`LEAST_AGE`].
    pub age: Duration,
}

/// An object that would be removed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Garbage {
    /// Its key.
    pub key: ObjectKey,
    /// Its size.
    pub size_bytes: u64,
}

/// What would be removed.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct GcPlan {
    /// Objects, manifests first: a version is gone before what it is made of.
    pub garbage: Vec<Garbage>,
    /// Objects that were looked at and stay.
    pub kept_count: usize,
}

impl GcPlan {
    /// Size of all that would be removed.
    pub fn size_bytes(&self) -> u64 {
        self.garbage.iter().map(|garbage| garbage.size_bytes).sum()
    }
}

/// What clean-up at an instant would remove. Nothing is changed.
pub async fn plan(store: &Store, keep: Keep, now: TimeMs) -> Result<GcPlan, ComputeError> {
    let living = living(store, keep.versions.max(1)).await?;
    let age_ms = keep.age.max(LEAST_AGE).as_millis() as i64;
    let oldest_ms = now.ms() - age_ms;
    let mut plan = GcPlan::default();
    // Manifests come first: nobody may find a version whose parts are gone.
    let mut folders: Vec<&str> = VERSIONED.into_iter().chain(MADE_AGAIN).collect();
    folders.sort_by_key(|&folder| folder != "manifests");
    for folder in folders {
        let mut found = store.object_store().list(Some(&Path::from(folder)));
        let failed = |source| StorageError::Object {
            key: folder.to_owned(),
            source,
        };
        let mut garbage = vec![];
        while let Some(meta) = found.try_next().await.map_err(failed)? {
            // Names that are no keys of ours are not ours to remove.
            let Ok(key) = meta.location.as_ref().parse::<ObjectKey>() else {
                continue;
            };
            if meta.last_modified.timestamp_millis() >= oldest_ms || living.contains(&key) {
                plan.kept_count += 1;
            } else {
                let size_bytes = meta.size;
                garbage.push(Garbage { key, size_bytes });
            }
        }
        garbage.sort_by(|a, b| a.key.cmp(&b.key));
        plan.garbage.extend(garbage);
    }
    Ok(plan)
}

/// Removes what a plan names, but for what has come into use since.
///
/// Returns how many objects were removed. A run that was killed is resumed by planning again.
pub async fn run(
    store: &Store,
    plan: &GcPlan,
    keep: Keep,
    progress: &(dyn Fn(usize) + Send + Sync),
) -> Result<usize, ComputeError> {
    let versions = keep.versions.max(1);
    let in_use = living(store, versions).await?;
    let mut removed = BTreeSet::new();
    for (index, garbage) in plan.garbage.iter().enumerate() {
        if !in_use.contains(&garbage.key) {
            store.remove(&garbage.key).await?;
            removed.insert(&garbage.key);
        }
        progress(index + 1);
    }
    // Something equal to an old object may have been stored, and found there, just before it went.
    let lost: Vec<String> = living(store, versions)
        .await?
        .iter()
        .filter(|key| removed.contains(key) && VERSIONED.contains(&folder_of(key)))
        .map(ToString::to_string)
        .collect();
    if lost.is_empty() {
        Ok(removed.len())
    } else {
        let reason = format!(
            "a new version came to use {} while they were removed; ingest or derive it again",
            lost.join(", ")
        );
        Err(ComputeError::inconsistent("clean-up", reason))
    }
}

fn folder_of(key: &ObjectKey) -> &str {
    key.as_str().split('/').next().unwrap_or_default()
}

/// Every object that a kept version names, or that belongs to one.
async fn living(store: &Store, versions: usize) -> Result<BTreeSet<ObjectKey>, ComputeError> {
    let mut living = BTreeSet::new();
    for product in manifests::products(store).await? {
        let keys = store.list(&format!("manifests/{product}")).await?;
        for key in keys.iter().rev().take(versions) {
            let Some(manifest) = read(store, key).await? else {
                continue;
            };
            if let Some(source) = &manifest.derived_from {
                let key = ObjectKey::manifest(&source.product, source.number);
                // The version that a kept one cites stays readable with it.
                if let Some(source) = read(store, &key).await? {
                    add(&mut living, &source)?;
                }
            }
            add(&mut living, &manifest)?;
        }
    }
    Ok(living)
}

/// A manifest; none if it is gone.
async fn read(store: &Store, key: &ObjectKey) -> Result<Option<Manifest>, ComputeError> {
    let content = match store.get(key).await {
        Ok(content) => content,
        Err(e) if e.is_not_found() => return Ok(None),
        Err(e) => return Err(e.into()),
    };
    // A manifest that cannot be read names things that nobody knows: nothing may be removed.
    serde_json::from_slice(&content)
        .map(Some)
        .map_err(|e| ComputeError::inconsistent(key.as_str(), e))
}

fn add(living: &mut BTreeSet<ObjectKey>, manifest: &Manifest) -> Result<(), ComputeError> {
    let product = &manifest.product;
    living.insert(ObjectKey::manifest(product, manifest.number));
    living.insert(manifest.domain.clone());
    living.extend(manifest.series.iter().map(|segment| segment.series.clone()));
    for step in &manifest.steps {
        living.insert(step.frame.clone());
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
        let weights = weights::key(&manifest.grid, &region, EARTH);
        for measure in [Measure::Mass, Measure::Mean] {
            keys.push(sums::key(&id, &weights, measure));
        }
    }
    Ok(keys)
}
