//! A whole store read and checked: every object against its name or its seal, every version for what it names.

use std::collections::BTreeSet;

use contract::key::ObjectKey;
use contract::kind::Kind;
use contract::manifest::Manifest;
use contract::product::ProductId;
use futures::{StreamExt as _, TryStreamExt as _, stream};
use serde::Serialize;

use crate::failure::Cause;
use crate::sound::Soundness;
use crate::sound::large;
use crate::{StorageError, Store, manifests};

/// Objects that are read at the same time.
const AT_ONCE: usize = 4;

/// What is wrong with an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Fault {
    /// It is not what was stored.
    Damaged,
    /// A version names it, and it is not there.
    Missing,
    /// It is sound, and made from another version than the newest.
    Behind,
}

/// An object that is not as it must be.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// Its key.
    pub key: ObjectKey,
    /// What is wrong.
    pub fault: Fault,
    /// How that was seen.
    pub reason: String,
}

/// What a store was found to be.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Report {
    /// Objects that are what their names or seals say.
    pub sound_count: usize,
    /// Objects that nothing says of what they should be: written before their kind was sealed.
    pub unsealed_count: usize,
    /// Bytes read.
    pub read_bytes: u64,
    /// What is wrong, sorted by key.
    pub findings: Vec<Finding>,
}

/// Every object of the kinds that are stored, or those of one product alone, kind by kind.
pub async fn keys(
    store: &Store,
    product: Option<&ProductId>,
) -> Result<Vec<ObjectKey>, StorageError> {
    let mut keys = vec![];
    for kind in Kind::ALL {
        let folder = match product {
            Some(product) => format!("{}/{product}", kind.folder()),
            None => kind.folder().to_owned(),
        };
        keys.extend(store.list(&folder).await?);
    }
    Ok(keys)
}

/// Reads and checks all of these; `progress` is told how many are done, and of each finding as it is made.
///
/// # Errors
/// The store does not answer. Whatever is wrong with an object is a finding.
pub async fn run(
    store: &Store,
    keys: &[ObjectKey],
    progress: &(dyn Fn(usize, Option<&Finding>) + Send + Sync),
) -> Result<Report, StorageError> {
    let mut report = Report::default();
    let mut named = BTreeSet::new();
    let checks: Vec<_> = keys
        .iter()
        .map(|key| checked(store.clone(), key.clone()))
        .collect();
    let mut checked = stream::iter(checks).buffered(AT_ONCE);
    let mut done_count = 0;
    while let Some((key, found)) = checked.try_next().await? {
        done_count += 1;
        match found {
            Checked::Sound(soundness, bytes) => {
                report.read_bytes += bytes;
                match soundness {
                    Soundness::Sound => report.sound_count += 1,
                    Soundness::Unsealed => report.unsealed_count += 1,
                }
                if Kind::of(&key) == Some(Kind::Manifest) {
                    named.extend(names_of(store, &key).await?);
                }
                progress(done_count, None);
            }
            Checked::Gone => progress(done_count, None),
            Checked::Damaged(reason) => {
                let finding = Finding {
                    key,
                    fault: Fault::Damaged,
                    reason,
                };
                progress(done_count, Some(&finding));
                report.findings.push(finding);
            }
        }
    }
    drop(checked);
    let there: BTreeSet<&ObjectKey> = keys.iter().collect();
    for key in named.iter().filter(|key| !there.contains(key)) {
        // Landed, perhaps, after the keys were listed.
        if store.exists(key).await? {
            continue;
        }
        let finding = Finding {
            key: key.clone(),
            fault: Fault::Missing,
            reason: "a manifest names it".to_owned(),
        };
        progress(done_count, Some(&finding));
        report.findings.push(finding);
    }
    report.findings.sort_by(|a, b| a.key.cmp(&b.key));
    Ok(report)
}

/// Is an object what its name or its seal says?
///
/// # Errors
/// `Damaged` if it is not.
pub async fn sound(store: &Store, key: &ObjectKey) -> Result<(), StorageError> {
    large::of_stored(store, key).await.map(|_soundness| ())
}

/// Those of these objects that are damaged, and may be made again.
pub async fn damaged(
    store: &Store,
    keys: impl IntoIterator<Item = ObjectKey>,
) -> Result<BTreeSet<ObjectKey>, StorageError> {
    let checks: Vec<_> = keys
        .into_iter()
        .map(|key| if_damaged(store.clone(), key))
        .collect();
    let found: Vec<Option<ObjectKey>> = stream::iter(checks)
        .buffer_unordered(AT_ONCE)
        .try_collect()
        .await?;
    Ok(found.into_iter().flatten().collect())
}

/// What a version has of its own: its domain, its fields, and counts of what contributed to them.
pub fn own_of(manifest: &Manifest) -> impl Iterator<Item = &ObjectKey> {
    let of_steps = manifest.steps.iter().flat_map(|step| {
        let counts = step.contributed.as_ref().map(|of| &of.counts);
        std::iter::once(&step.field).chain(counts)
    });
    std::iter::once(&manifest.domain).chain(of_steps)
}

/// What is there of that of all versions of a product, whole or damaged.
pub async fn own_there(
    store: &Store,
    product: &ProductId,
) -> Result<BTreeSet<ObjectKey>, StorageError> {
    let mut there = BTreeSet::new();
    for kind in [Kind::Domain, Kind::Field, Kind::Contributed] {
        there.extend(store.list(&format!("{}/{product}", kind.folder())).await?);
    }
    Ok(there)
}

/// Is all of that there, whole or damaged, of a version?
pub async fn has_own(store: &Store, manifest: &Manifest) -> Result<bool, StorageError> {
    let there = own_there(store, &manifest.product).await?;
    Ok(own_of(manifest).all(|own| there.contains(own)))
}

/// What of that is damaged or gone.
pub async fn broken(
    store: &Store,
    manifest: &Manifest,
) -> Result<BTreeSet<ObjectKey>, StorageError> {
    broken_of(
        store,
        &manifest.product,
        own_of(manifest).cloned().collect(),
    )
    .await
}

/// What of that is damaged or gone of versions before the newest one, and that one does not share.
pub async fn broken_before(
    store: &Store,
    product: &ProductId,
) -> Result<BTreeSet<ObjectKey>, StorageError> {
    let mut numbers = manifests::numbers(store, product).await?;
    let Some(newest) = numbers.pop() else {
        return Ok(BTreeSet::new());
    };
    let mut own = BTreeSet::new();
    for number in numbers {
        let manifest = manifests::numbered(store, product, number).await?;
        own.extend(manifest.iter().flat_map(own_of).cloned());
    }
    if let Some(newest) = manifests::numbered(store, product, newest).await? {
        for shared in own_of(&newest) {
            own.remove(shared);
        }
    }
    broken_of(store, product, own).await
}

async fn broken_of(
    store: &Store,
    product: &ProductId,
    own: BTreeSet<ObjectKey>,
) -> Result<BTreeSet<ObjectKey>, StorageError> {
    let there = own_there(store, product).await?;
    let (there, mut broken): (BTreeSet<_>, BTreeSet<_>) =
        own.into_iter().partition(|own| there.contains(own));
    broken.extend(damaged(store, there).await?);
    Ok(broken)
}

async fn if_damaged(store: Store, key: ObjectKey) -> Result<Option<ObjectKey>, StorageError> {
    let found = check(&store, &key).await?;
    Ok(matches!(found, Checked::Damaged(_)).then_some(key))
}

enum Checked {
    Sound(Soundness, u64),
    /// Removed since it was listed.
    Gone,
    Damaged(String),
}

async fn checked(store: Store, key: ObjectKey) -> Result<(ObjectKey, Checked), StorageError> {
    let found = check(&store, &key).await?;
    Ok((key, found))
}

async fn check(store: &Store, key: &ObjectKey) -> Result<Checked, StorageError> {
    match large::of_stored(store, key).await {
        Ok((soundness, bytes)) => Ok(Checked::Sound(soundness, bytes)),
        Err(e) if e.is_not_found() => Ok(Checked::Gone),
        // Of an attached product, and not what was attached any more. Who is not let in knows nothing of that.
        Err(e) if e.attached().is_some_and(|of| of.cause == Cause::Content) => {
            Ok(Checked::Damaged(e.to_string()))
        }
        Err(StorageError::Damaged { reason, .. }) => Ok(Checked::Damaged(reason)),
        Err(e) => Err(e),
    }
}

/// What a manifest names.
async fn names_of(store: &Store, key: &ObjectKey) -> Result<Vec<ObjectKey>, StorageError> {
    let manifest = match manifests::at(store, key).await {
        Ok(Some(manifest)) => manifest,
        Ok(None) => return Ok(vec![]),
        // A page of it is gone, which is told by its name; or it is of a program to come.
        Err(StorageError::Damaged { .. }) => {
            return match manifests::page_keys(store, key).await {
                Err(StorageError::Damaged { .. }) => Ok(vec![]),
                keys => keys,
            };
        }
        Err(e) => return Err(e),
    };
    let mut names = manifests::page_keys(store, key).await?;
    names.push(manifest.domain.clone());
    for step in &manifest.steps {
        names.push(step.field.clone());
        names.extend(step.contributed.as_ref().map(|of| of.counts.clone()));
        if manifest.derived_from.is_none() {
            names.push(ObjectKey::raw(&manifest.product, &step.raw_sha256));
        }
    }
    Ok(names)
}
