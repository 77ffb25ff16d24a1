//! The cube of a product in, whatever became of it; the cube of its newest version out.

use contract::key::ObjectKey;
use contract::manifest::Manifest;
use contract::product::ProductId;
use futures::future::BoxFuture;
use serde::Serialize;
use storage::verify::Fault;
use storage::{Store, manifests};

use super::check;
use crate::follow::folder;
use crate::{CubeError, clocks, compact};

/// What is done to a cube.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Mending {
    /// It is as it must be.
    Nothing,
    /// It is sound, or not there yet, and comes to be of its product's newest version.
    BroughtUp,
    /// Something of it is damaged or gone: it is made again.
    MadeAgain,
}

/// Brings the cube of a product to its newest version, whatever became of it: one that is damaged is made again from the
/// versions that are there. True if it was made again.
///
/// One that others bring to a newer version meanwhile is left as it is.
///
/// # Errors
/// The store does not answer: a sound cube is as it was, another one is made by the next call. A field that the cube is made of is damaged or
/// gone. `Clock` where nothing can be committed: whatever there is stays.
pub fn mend<'a>(
    store: &'a Store,
    product: &'a ProductId,
) -> BoxFuture<'a, Result<bool, CubeError>> {
    Box::pin(async move {
        let folder = folder(product);
        let Some(seen) = Seen::of(store, product, &folder).await? else {
            return Ok(false);
        };
        let was_there = !seen.keys.is_empty();
        if was_there {
            if seen.is_whole && follows(store, &seen.newest).await? {
                compact::compact(store, &folder).await?;
                return Ok(false);
            }
            clocks::check(store, &folder).await?;
            remove(store, seen.keys, &folder).await?;
        }
        // Asked for now: others may have published meanwhile, and their version was in the cube that is gone.
        for number in manifests::numbers(store, product).await? {
            if let Some(manifest) = manifests::numbered(store, product, number).await? {
                crate::follow(store, &manifest).await?;
            }
        }
        compact::compact(store, &folder).await?;
        Ok(was_there)
    })
}

/// What [`mend`] would do now; nothing is changed.
///
/// # Errors
/// The store does not answer.
pub fn mending<'a>(
    store: &'a Store,
    product: &'a ProductId,
) -> BoxFuture<'a, Result<Mending, CubeError>> {
    Box::pin(async move {
        let seen = Seen::of(store, product, &folder(product)).await?;
        Ok(match seen {
            Some(seen) if !seen.is_whole => Mending::MadeAgain,
            Some(seen) if seen.is_behind => Mending::BroughtUp,
            Some(_) | None => Mending::Nothing,
        })
    })
}

/// What there is of a cube that somebody may mend.
struct Seen {
    keys: Vec<ObjectKey>,
    newest: Manifest,
    /// Is nothing of it damaged or gone? It may be behind, or not be there at all.
    is_whole: bool,
    is_behind: bool,
}

impl Seen {
    /// None of a product that has no cube.
    async fn of(
        store: &Store,
        product: &ProductId,
        folder: &str,
    ) -> Result<Option<Self>, CubeError> {
        let keys = store.list(folder).await?;
        let damaged = storage::verify::damaged(store, keys.iter().cloned()).await?;
        let (mut is_whole, mut is_behind) = (damaged.is_empty(), keys.is_empty());
        if is_whole && !keys.is_empty() {
            let checked = check(store, product, &damaged).await?;
            let mut faults = checked.findings.iter().map(|finding| finding.fault);
            is_behind = faults.clone().any(|fault| fault == Fault::Behind);
            is_whole = faults.all(|fault| fault == Fault::Behind);
        }
        let Some(newest) = manifests::latest(store, product).await? else {
            return Ok(None);
        };
        // It has no cube, and what there may be of before is nothing's of now.
        if store.attached_to(&newest).await?.is_some() {
            return Ok(None);
        }
        Ok(Some(Self {
            keys,
            newest,
            is_whole,
            is_behind,
        }))
    }
}

/// Brings a sound cube to the newest version of its product; false if it is of one that is no more, or cannot be brought there.
///
/// # Errors
/// What says nothing of the cube: a store that does not answer, a field that is damaged or gone, a clock by which nothing can be committed.
async fn follows(store: &Store, newest: &Manifest) -> Result<bool, CubeError> {
    let followed = match crate::follow(store, newest).await {
        Ok(followed) => followed.version,
        // Nor would what is made again: the store fails, what the newest version is made of is damaged, or the clock is wrong.
        Err(error)
            if error.is_retryable()
                || matches!(error, CubeError::Storage(_) | CubeError::Clock { .. }) =>
        {
            return Err(error);
        }
        Err(error) => {
            tracing::warn!(%error, "a cube cannot follow, and is made again");
            return Ok(false);
        }
    };
    if followed == newest.id() {
        return Ok(true);
    }
    // Of a newer version: others have published meanwhile, or somebody took the newest manifest away.
    let there = manifests::numbered(store, &followed.product, followed.number).await?;
    Ok(there.is_some_and(|there| there.id() == followed))
}

/// Removes the objects of a cube. What says where all else is goes last: until then others find a damaged cube, and none that they may add to.
async fn remove(store: &Store, keys: Vec<ObjectKey>, folder: &str) -> Result<(), CubeError> {
    let entry = format!("{folder}/repo");
    // A Hadoop file system has it in a folder beside it.
    let is_entry =
        |key: &ObjectKey| key.as_str() == entry || key.is_in(&format!("{entry}.numbers"));
    let (last, first): (Vec<_>, Vec<_>) = keys.into_iter().partition(is_entry);
    for key in first.iter().chain(&last) {
        store.remove(key).await?;
    }
    Ok(())
}
