//! Clean-up: objects that are in nobody's use and old enough to be in nobody's hands.
//!
//! What is in use is said by those who lay it out ([`Owner`]); this module knows no folder. Versions that are pinned are kept
//! as the newest are. Nothing is removed of a kind that no owner speaks for. Half-written files of killed writers go when no writer can be at them any more.

mod owner;
mod versions;

use std::collections::BTreeSet;
use std::time::Duration;

use contract::key::ObjectKey;
use contract::kind::Kind;
use contract::product::ProductId;
use contract::time::TimeMs;
use futures::TryStreamExt as _;
use object_store::ObjectStore as _;
use object_store::path::Path;
use serde::Serialize;

use crate::store::{Leftover, PROBES};
use crate::{StorageError, Store, manifests, pins};

pub use owner::{Kept, LEAST_AGE, Owner};
pub use versions::{Hints, Pictures, Versions};

/// Kinds of the numbered lists that name everything else.
const LISTS: [Kind; 2] = [Kind::Manifest, Kind::ObservationIndex];

/// What is kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Keep {
    /// Newest versions of each product, at least one.
    pub versions: usize,
    /// Whatever was written so long ago or later; at least what its owner says.
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
    /// Objects, numbered lists first: a version is gone before what it is made of.
    pub garbage: Vec<Garbage>,
    /// Files that killed writers left half-written.
    #[serde(skip)]
    pub leftovers: Vec<Leftover>,
    /// Objects that were looked at and stay.
    pub kept_count: usize,
    /// Versions that are there and would not be kept if they were not pinned, but for their age.
    pub only_pinned_count: usize,
    /// Versions that were published at this instant or later stay, ms.
    #[serde(skip)]
    oldest_ms: i64,
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

    /// Looks at all objects of a folder: which are older than an instant, ms, and in nobody's use.
    async fn look_through(
        &mut self,
        store: &Store,
        (folder, oldest_ms): (&str, i64),
        in_use: &InUse<'_>,
    ) -> Result<(), StorageError> {
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
            if is_young || in_use.holds(&key) {
                self.kept_count += 1;
            } else {
                let size_bytes = meta.size;
                garbage.push(Garbage { key, size_bytes });
            }
        }
        garbage.sort_by(|a, b| a.key.cmp(&b.key));
        self.garbage.extend(garbage);
        Ok(())
    }
}

/// What all owners say is in use.
struct InUse<'a> {
    owners: &'a [&'a dyn Owner],
    keys: BTreeSet<ObjectKey>,
    only_pinned_count: usize,
}

impl<'a> InUse<'a> {
    async fn read(
        store: &Store,
        owners: &'a [&'a dyn Owner],
        keep: Keep,
        oldest_ms: i64,
    ) -> Result<Self, StorageError> {
        let kept = Kept::read(store, keep.versions.max(1), oldest_ms).await?;
        let mut keys = BTreeSet::new();
        for owner in owners {
            keys.append(&mut owner.in_use(store, &kept).await?);
        }
        // Who stays for its age is to be read as the newest are, and may be of things that are older. They may be many: one is held at a time.
        for (product, number) in kept.young(store).await? {
            let one = Kept::one(store, &product, number).await?;
            for owner in owners {
                keys.append(&mut owner.in_use(store, &one).await?);
            }
        }
        Ok(Self {
            owners,
            keys,
            only_pinned_count: kept.only_pinned_count,
        })
    }

    fn holds(&self, key: &ObjectKey) -> bool {
        let is_with_one = |owner: &&dyn Owner| {
            let other = owner.lives_with(key);
            other.is_some_and(|other| self.keys.contains(&other))
        };
        self.keys.contains(key) || self.owners.iter().any(is_with_one)
    }
}

/// What clean-up at an instant would remove. Nothing is changed.
///
/// # Errors
/// A store that does not answer, and a list or a pin that cannot be read: it names things that nobody knows.
pub async fn plan(
    store: &Store,
    owners: &[&dyn Owner],
    keep: Keep,
    now: TimeMs,
) -> Result<GcPlan, StorageError> {
    let oldest_ms = now.ms() - keep.age.max(LEAST_AGE).as_millis() as i64;
    let in_use = InUse::read(store, owners, keep, oldest_ms).await?;
    let mut plan = GcPlan {
        only_pinned_count: in_use.only_pinned_count,
        oldest_ms,
        ..GcPlan::default()
    };
    let mut kinds: Vec<(Kind, Duration)> = owners
        .iter()
        .flat_map(|owner| owner.kinds().iter().map(|kind| (*kind, owner.least_age())))
        .collect();
    // Lists come first: nobody may find a version whose parts are gone.
    kinds.sort_by_key(|(kind, _)| (!LISTS.contains(kind), *kind));
    for (kind, least_age) in kinds {
        let oldest_ms = now.ms() - keep.age.max(least_age).as_millis() as i64;
        plan.look_through(store, (kind.folder(), oldest_ms), &in_use)
            .await?;
    }
    // Of services whose keys may remove nothing.
    let oldest_ms = now.ms() - LEAST_AGE.as_millis() as i64;
    plan.look_through(store, (PROBES, oldest_ms), &in_use)
        .await?;
    plan.leftovers = store.leftovers(keep.age.max(LEAST_AGE)).await?;
    Ok(plan)
}

/// Has the hints of products whose versions may go say the newest: before one that is kept would stand others that are gone.
async fn bring_hints_up(store: &Store, plan: &GcPlan) -> Result<(), StorageError> {
    let keys = plan.garbage.iter().map(|garbage| &garbage.key);
    let products: BTreeSet<ProductId> = keys.filter_map(manifests::product_of).collect();
    for product in &products {
        manifests::bring_hint_up(store, product).await?;
    }
    Ok(())
}

/// Removes what a plan names, but for what has come into use since.
///
/// Returns how many objects and half-written files were removed. A run that was killed is resumed by planning again.
///
/// # Errors
/// As [`plan`]; a hint of a newest number that cannot be written; and what was put to use by a new version or a pin while it was removed, by name.
pub async fn run(
    store: &Store,
    owners: &[&dyn Owner],
    plan: &GcPlan,
    keep: Keep,
    progress: &(dyn Fn(usize) + Send + Sync),
) -> Result<usize, StorageError> {
    // First, and what is in use after it: who has read an older hint has long asked for what follows.
    bring_hints_up(store, plan).await?;
    let mut in_use = InUse::read(store, owners, keep, plan.oldest_ms).await?;
    let mut removed = BTreeSet::new();
    for (index, garbage) in plan.garbage.iter().enumerate() {
        // Where somebody has pinned a version since, what it names, which comes later, stays with it.
        if !in_use.holds(&garbage.key) && pins::holds(store, &garbage.key).await? {
            in_use = InUse::read(store, owners, keep, plan.oldest_ms).await?;
        }
        if !in_use.holds(&garbage.key) {
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
        let kind = Kind::of(key);
        let owner = owners
            .iter()
            .find(|owner| kind.is_some_and(|kind| owner.kinds().contains(&kind)));
        owner.is_some_and(|owner| !owner.is_made_again())
    };
    let now_in_use = InUse::read(store, owners, keep, plan.oldest_ms).await?;
    let lost: Vec<String> = now_in_use
        .keys
        .iter()
        .filter(|key| removed.contains(key) && matters(key))
        .map(ToString::to_string)
        .collect();
    if lost.is_empty() {
        Ok(removed.len() + leftovers_count)
    } else {
        Err(StorageError::Damaged {
            object: lost.join(", "),
            reason: "a new version or a pin came to use it while it was removed; ingest or derive it again"
                .to_owned(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn probes_that_services_left_go_an_hour_later() {
        let store = Store::memory();
        let key: ObjectKey = "probe/1-2".parse().unwrap();
        store.put_new(&key, "x".into()).await.unwrap();
        let keep = Keep {
            versions: 1,
            age: Duration::from_hours(720),
        };
        let now_ms = std::time::SystemTime::now()
            .duration_since(std::time::UNIX_EPOCH)
            .unwrap()
            .as_millis() as i64;
        let in_hours = |hours: i64| TimeMs::new(now_ms + hours * 3_600_000).unwrap();
        let young = plan(&store, &[&Versions], keep, in_hours(0)).await.unwrap();
        assert_eq!((young.garbage.len(), young.kept_count), (0, 1));
        let old = plan(&store, &[&Versions], keep, in_hours(2)).await.unwrap();
        assert_eq!(old.garbage[0].key, key);
        run(&store, &[&Versions], &old, keep, &|_done| ())
            .await
            .unwrap();
        assert!(store.list("").await.unwrap().is_empty());
    }
}
