//! Numbered manifests: the newest of a product, one by its name, and the commit of the next.

mod hint;
mod over_time;
mod pages;
mod published;

use std::collections::BTreeMap;

use contract::digest::Digest;
use contract::key::ObjectKey;
use contract::kind::Kind;
use contract::manifest::{
    LEAST_PAGED_STEPS, MANIFEST_SCHEMA, Manifest, ManifestId, OLDEST_MANIFEST_SCHEMA,
    OLDEST_PAGED_SCHEMA, PAGED_SCHEMA, PagedManifest, Step,
};
use contract::product::ProductId;

use crate::sound::damage;
use crate::{StorageError, Store, document, fields};

pub use over_time::{OverTime, of_kind, over_time};
pub use published::{AtInstant, as_of, published};

/// Versions that were published since the last look, up to which each is asked for.
const MOST_ASKED: u64 = 16;

/// Products that have a manifest, sorted by name.
pub async fn products(store: &Store) -> Result<Vec<ProductId>, StorageError> {
    let names = store.folders(Kind::Manifest.folder()).await?;
    Ok(names.iter().filter_map(|name| name.parse().ok()).collect())
}

/// The newest manifest of a product, if it has one.
///
/// The next number is asked for behind the one that this process has seen a short while ago, else behind that of the hint, and nothing is
/// listed: three small requests where the hint says the newest.
pub async fn latest(store: &Store, product: &ProductId) -> Result<Option<Manifest>, StorageError> {
    if let Some(known) = store.newest.get(product) {
        let newest = follow(store, product, known).await?;
        if let Some(manifest) = numbered(store, product, newest).await? {
            store.newest.insert(product.clone(), newest);
            return Ok(Some(manifest));
        }
        // Somebody took it away.
        store.newest.remove(product);
    } else if let Some(newest) = hinted(store, product).await?
        && let Some(manifest) = numbered(store, product, newest).await?
    {
        store.newest.insert(product.clone(), newest);
        return Ok(Some(manifest));
    }
    let Some(newest) = numbers(store, product).await?.pop() else {
        return Ok(None);
    };
    store.newest.insert(product.clone(), newest);
    numbered(store, product, newest).await
}

/// Products that have a manifest, sorted by name, with the number of their newest one: one list for all, and not one for each.
pub async fn newest_numbers(store: &Store) -> Result<BTreeMap<ProductId, u64>, StorageError> {
    let mut newest: BTreeMap<ProductId, u64> = BTreeMap::new();
    for key in store.list(Kind::Manifest.folder()).await? {
        if let (Some(product), Some(number)) = (product_of(&key), number_of(&key)) {
            let own = newest.entry(product).or_insert(number);
            *own = number.max(*own);
        }
    }
    Ok(newest)
}

/// The newest manifest of a product if it is newer than the number that the caller knows: one small request where it is not and
/// was looked for a short while ago, else two where the hint says so.
///
/// That the one it knows is still there is not asked; see [`is_there`].
pub async fn newer(
    store: &Store,
    product: &ProductId,
    known: u64,
) -> Result<Option<Manifest>, StorageError> {
    let newest = match store.newest.get(product) {
        Some(seen) => follow(store, product, known.max(seen)).await?,
        None => match hinted(store, product).await? {
            Some(newest) if newest == known => known,
            Some(newest) if newest > known && is_there(store, product, newest).await? => newest,
            // Of those that followed it some may be gone.
            _ => last(store, product, known).await?,
        },
    };
    store.newest.insert(product.clone(), newest);
    if newest == known {
        return Ok(None);
    }
    numbered(store, product, newest).await
}

/// Is the manifest of a number there?
pub async fn is_there(
    store: &Store,
    product: &ProductId,
    number: u64,
) -> Result<bool, StorageError> {
    store.exists(&ObjectKey::manifest(product, number)).await
}

/// The newest number by the hint of a product; none where it leads nowhere and a list must tell. Whether that manifest is there is for
/// the caller to see.
async fn hinted(store: &Store, product: &ProductId) -> Result<Option<u64>, StorageError> {
    let Some(hint) = hint::read(store, product).await? else {
        return Ok(None);
    };
    let newest = follow(store, product, hint).await?;
    // Behind one that is gone others may be gone too.
    let leads = newest == hint || is_there(store, product, hint).await?;
    Ok(leads.then_some(newest))
}

/// Has the hint of a product say its newest number: before versions of it are removed.
///
/// # Errors
/// It could not be written: none may be removed.
pub(crate) async fn bring_hint_up(store: &Store, product: &ProductId) -> Result<(), StorageError> {
    match numbers(store, product).await?.pop() {
        Some(newest) => hint::tell(store, product, newest).await,
        None => Ok(()),
    }
}

/// The last number of those that follow a known one: each is asked for, up to some, behind which it is faster to list.
async fn follow(store: &Store, product: &ProductId, known: u64) -> Result<u64, StorageError> {
    for newest in known..known + MOST_ASKED {
        if !is_there(store, product, newest + 1).await? {
            return Ok(newest);
        }
    }
    last(store, product, known).await
}

/// The last number that is there; the known one where none is newer.
async fn last(store: &Store, product: &ProductId, known: u64) -> Result<u64, StorageError> {
    let last = numbers(store, product).await?.pop();
    Ok(last.map_or(known, |last| last.max(known)))
}

/// Numbers of the manifests that a product has, ascending.
pub async fn numbers(store: &Store, product: &ProductId) -> Result<Vec<u64>, StorageError> {
    let keys = store
        .list(&format!("{}/{product}", Kind::Manifest.folder()))
        .await?;
    Ok(keys.iter().filter_map(number_of).collect())
}

/// The product whose manifest has a key.
pub(crate) fn product_of(key: &ObjectKey) -> Option<ProductId> {
    let own = key.as_str().strip_prefix(Kind::Manifest.folder())?;
    let (product, _name) = own.strip_prefix('/')?.split_once('/')?;
    product.parse().ok()
}

/// The number that the key of a manifest ends in.
fn number_of(key: &ObjectKey) -> Option<u64> {
    let name = key.as_str().rsplit('/').next()?;
    name.strip_suffix(".json")?.parse().ok()
}

/// The manifest of a product with a number; none if there is none (any more).
pub async fn numbered(
    store: &Store,
    product: &ProductId,
    number: u64,
) -> Result<Option<Manifest>, StorageError> {
    at(store, &ObjectKey::manifest(product, number)).await
}

/// The manifest of a name, which must still hold what it held when it was named.
pub async fn load(store: &Store, id: &ManifestId) -> Result<Manifest, StorageError> {
    let key = ObjectKey::manifest(&id.product, id.number);
    let Some(manifest) = at(store, &key).await? else {
        let path = key.to_string();
        return Err(StorageError::Object {
            key: path.clone(),
            source: object_store::Error::NotFound {
                path,
                source: "it was cleaned up, or never published".into(),
            },
        });
    };
    if manifest.id() == *id {
        Ok(manifest)
    } else {
        let reason = format!("it is {}, not {id}", manifest.id());
        Err(damage::found(&key, reason))
    }
}

/// Publishes a manifest whose objects are all durable; its name, which takes longer to compute the more steps there are.
///
/// # Errors
/// `Conflict` if another writer took the number: read the newest one again and build on it.
pub async fn commit(store: &Store, manifest: &Manifest) -> Result<ManifestId, StorageError> {
    let id = put(store, manifest).await?;
    hint::tell_published(store, &id.product, id.number).await;
    Ok(id)
}

async fn put(store: &Store, manifest: &Manifest) -> Result<ManifestId, StorageError> {
    let key = ObjectKey::manifest(&manifest.product, manifest.number);
    if manifest.schema != MANIFEST_SCHEMA {
        let reason = format!("to write, it is of schema {}", manifest.schema);
        return Err(StorageError::damaged(key.as_str(), reason));
    }
    // What the version before names is durable; all else is made so now, whoever may have had it once.
    let before = ObjectKey::manifest(&manifest.product, manifest.number.saturating_sub(1));
    let named_before = if manifest.steps.len() < LEAST_PAGED_STEPS {
        vec![]
    } else {
        page_names(store, &before).await?
    };
    let held = pages::held(store, &manifest.product, &named_before);
    let Some((paged, pages)) = manifest.paged_after(|start| held.get(&start).cloned()) else {
        document::put_new(store, &key, manifest).await?;
        return Ok(manifest.id());
    };
    pages::write(store, &manifest.product, pages, &named_before).await?;
    document::put_new(store, &key, &paged).await?;
    Ok(paged.id)
}

/// Keys of the pages that a stored manifest names; nothing if it has none, or is not there.
pub async fn page_keys(store: &Store, key: &ObjectKey) -> Result<Vec<ObjectKey>, StorageError> {
    match stored(store, key).await? {
        Some(Stored::Paged(paged)) => Ok(paged.page_keys().collect()),
        Some(Stored::Whole(_)) | None => Ok(vec![]),
    }
}

/// Names of the pages of a stored manifest, in their order; nothing if it has none, or is not there.
async fn page_names(store: &Store, key: &ObjectKey) -> Result<Vec<Digest>, StorageError> {
    match stored(store, key).await? {
        Some(Stored::Paged(paged)) => Ok(paged.pages),
        Some(Stored::Whole(_)) | None => Ok(vec![]),
    }
}

/// Gives what the next version holds the names that the newest one has for the same values: what was named by its bytes
/// is no other object for being named by its values.
pub async fn settle(
    store: &Store,
    newest: &Manifest,
    next: &mut Manifest,
) -> Result<(), StorageError> {
    if newest.grid != next.grid {
        return Ok(());
    }
    for step in &mut next.steps {
        let start = step.period.start;
        let there = newest
            .steps
            .binary_search_by_key(&start, |it| it.period.start);
        let there = there.ok().map(|at| &newest.steps[at]);
        let is_renamed = |there: &&Step| there.period == step.period && there.field != step.field;
        if let Some(there) = there.filter(is_renamed) {
            step.field = fields::settle(store, &there.field, &step.field, &next.grid).await?;
        }
    }
    Ok(())
}

/// The manifest under a key; none if there is none (any more).
pub async fn at(store: &Store, key: &ObjectKey) -> Result<Option<Manifest>, StorageError> {
    let manifest = match stored(store, key).await? {
        None => return Ok(None),
        Some(Stored::Whole(manifest)) => manifest,
        Some(Stored::Paged(paged)) => pages::assemble(store, key, paged).await?,
    };
    manifest
        .grid
        .validate()
        .map_err(|e| damage::found(key, e))?;
    Ok(Some(manifest))
}

/// A manifest as it is stored.
enum Stored {
    Whole(Manifest),
    Paged(PagedManifest),
}

async fn stored(store: &Store, key: &ObjectKey) -> Result<Option<Stored>, StorageError> {
    #[derive(serde::Deserialize)]
    struct Schema {
        schema: u32,
    }
    let Some(text) = document::text(store, key).await? else {
        return Ok(None);
    };
    let damaged = |e: serde_json::Error| damage::found(key, e);
    let Schema { schema } = serde_json::from_slice(&text).map_err(damaged)?;
    match schema {
        OLDEST_MANIFEST_SCHEMA..=MANIFEST_SCHEMA => serde_json::from_slice(&text)
            .map(|manifest| Some(Stored::Whole(manifest)))
            .map_err(damaged),
        OLDEST_PAGED_SCHEMA..=PAGED_SCHEMA => serde_json::from_slice(&text)
            .map(|paged| Some(Stored::Paged(paged)))
            .map_err(damaged),
        schema => {
            // Whole, but of a program to come.
            let reason = format!(
                "schema {schema} is unknown, this program reads {OLDEST_MANIFEST_SCHEMA} to {PAGED_SCHEMA}"
            );
            Err(StorageError::damaged(key.as_str(), reason))
        }
    }
}

#[cfg(test)]
mod tests;
