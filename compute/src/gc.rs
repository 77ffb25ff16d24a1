//! Clean-up: objects that no kept version names and that are old enough to be in nobody's hands.
//!
//! What makes up a version (frames, counts beside accumulated ones, series, domains, raw files, manifests) is kept as long as its manifest is among the
//! newest of its product, or was a source of one that is; observations as long as one of the newest indexes of their
//! dataset names them. What can be made again from those (tiles, sums, states of accumulation, comparisons) is kept as
//! long as it is young or belongs to a kept version, what is known of the reading of a raw file as long as that file.
//! Notes of landings are kept for as long as a notice may come again. Half-written files of killed writers go when no
//! writer can be at them any more. Weights are never removed here.

mod living;

use std::collections::BTreeSet;
use std::time::Duration;

use contract::key::ObjectKey;
use contract::time::TimeMs;
use futures::TryStreamExt as _;
use object_store::ObjectStore as _;
use object_store::path::Path;
use serde::Serialize;
use storage::store::Leftover;
use storage::{StorageError, Store};

use self::living::living;
use crate::ComputeError;
use crate::budget::sums;
use crate::derive::exact;

/// Folders of the numbered lists that name everything else.
const LISTS: [&str; 2] = ["manifests", living::INDEXES];
/// Folders of what versions are made of.
const VERSIONED: [&str; 6] = [
    "contributed",
    "domain",
    "frames",
    "observations",
    "raw",
    "series",
];
/// Folders of what can be made again.
const MADE_AGAIN: [&str; 4] = [exact::FOLDER, "checks", sums::FOLDER, "tiles"];
/// Folder of what is known of the reading of raw files, as `PRODUCT/RAW-RECIPE`.
const READINGS: &str = "readings";
/// Folder of the notes by which a notice that comes again is known.
const NOTES: &str = "landings";
/// The youngest age that may be removed: whoever is writing has long been done.
pub const LEAST_AGE: Duration = Duration::from_hours(1);
/// The youngest age of a note that may be removed: longer than any log keeps a notice (30 days).
const LEAST_NOTE_AGE: Duration = Duration::from_hours(24 * 45);

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
    /// Files that killed writers left half-written.
    #[serde(skip)]
    pub leftovers: Vec<Leftover>,
    /// Objects that were looked at and stay.
    pub kept_count: usize,
}

impl GcPlan {
    /// Size of all that would be removed.
    pub fn size_bytes(&self) -> u64 {
        let objects = self.garbage.iter().map(|garbage| garbage.size_bytes);
        let leftovers = self.leftovers.iter().map(|leftover| leftover.size_bytes);
        objects.chain(leftovers).sum()
    }

    /// Number of all that would be removed.
    pub fn count(&self) -> usize {
        self.garbage.len() + self.leftovers.len()
    }
}

/// What clean-up at an instant would remove. Nothing is changed.
pub async fn plan(store: &Store, keep: Keep, now: TimeMs) -> Result<GcPlan, ComputeError> {
    let living = living(store, keep.versions.max(1)).await?;
    let mut plan = GcPlan::default();
    // Lists come first: nobody may find a version whose parts are gone.
    let folders = LISTS.into_iter().chain(VERSIONED).chain(MADE_AGAIN);
    for folder in folders.chain([READINGS, NOTES]) {
        let least = if folder == NOTES {
            LEAST_NOTE_AGE
        } else {
            LEAST_AGE
        };
        let oldest_ms = now.ms() - keep.age.max(least).as_millis() as i64;
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
            let is_young = meta.last_modified.timestamp_millis() >= oldest_ms;
            if is_young || is_living(&living, &key) {
                plan.kept_count += 1;
            } else {
                let size_bytes = meta.size;
                garbage.push(Garbage { key, size_bytes });
            }
        }
        garbage.sort_by(|a, b| a.key.cmp(&b.key));
        plan.garbage.extend(garbage);
    }
    plan.leftovers = store.leftovers(keep.age.max(LEAST_AGE)).await?;
    Ok(plan)
}

fn is_living(living: &BTreeSet<ObjectKey>, key: &ObjectKey) -> bool {
    living.contains(key) || raw_of(key).is_some_and(|raw| living.contains(&raw))
}

/// The raw file that a reading is of.
fn raw_of(key: &ObjectKey) -> Option<ObjectKey> {
    let (product, name) = key
        .as_str()
        .strip_prefix(READINGS)?
        .strip_prefix('/')?
        .split_once('/')?;
    let (raw, _recipe) = name.split_once('-')?;
    format!("raw/{product}/{raw}").parse().ok()
}

/// Removes what a plan names, but for what has come into use since.
///
/// Returns how many objects and half-written files were removed. A run that was killed is resumed by planning again.
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
        if !is_living(&in_use, &garbage.key) {
            store.remove(&garbage.key).await?;
            removed.insert(&garbage.key);
        }
        progress(index + 1);
    }
    let leftovers_count = if plan.leftovers.is_empty() {
        0
    } else {
        store.remove_leftovers(keep.age.max(LEAST_AGE)).await?
    };
    progress(plan.count());
    // Something equal to an old object may have been stored, and found there, just before it went.
    let matters = |key: &&ObjectKey| {
        let folder = folder_of(key);
        LISTS.contains(&folder) || VERSIONED.contains(&folder)
    };
    let lost: Vec<String> = living(store, versions)
        .await?
        .iter()
        .filter(|key| removed.contains(key) && matters(key))
        .map(ToString::to_string)
        .collect();
    if lost.is_empty() {
        Ok(removed.len() + leftovers_count)
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
