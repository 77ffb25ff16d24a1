//! Pages of manifests: stored once under the digest of their steps, and held, since they never change.

use std::collections::{BTreeSet, HashMap};
use std::sync::Arc;

use contract::digest::Digest;
use contract::key::ObjectKey;
use contract::manifest::{Manifest, Page, PagedManifest};
use contract::product::ProductId;
use contract::time::TimeMs;
use futures::stream::{self, StreamExt as _, TryStreamExt as _};

use crate::sound::damage;
use crate::{StorageError, Store, document};

/// Pages that are read or sent at a time, 25 kB each.
const AT_ONCE: usize = 16;

/// The manifest whose pages these are named in.
///
/// # Errors
/// A page that is gone or damaged, by its name.
pub(super) async fn assemble(
    store: &Store,
    key: &ObjectKey,
    paged: PagedManifest,
) -> Result<Manifest, StorageError> {
    let pages: Vec<Arc<Page>> = stream::iter(paged.page_keys().collect::<Vec<_>>())
        .map(|page| read(store, page))
        .buffered(AT_ONCE)
        .try_collect()
        .await?;
    let whole = paged.with_pages(pages.iter().map(|page| &**page));
    whole.map_err(|e| damage::found(key, e))
}

async fn read(store: &Store, key: ObjectKey) -> Result<Arc<Page>, StorageError> {
    if let Some(page) = store.pages.get(&key) {
        return Ok(page);
    }
    let Some(text) = document::text(store, &key).await? else {
        return Err(StorageError::damaged(
            key.as_str(),
            "a manifest names it, and it is not there",
        ));
    };
    let page: Page = serde_json::from_slice(&text).map_err(|e| damage::found(&key, e))?;
    // As it is stored it is what it is named by; another writer of the same page may have set it otherwise.
    let is_named = |name: Digest| key.as_str().contains(&name.to_string());
    if !is_named(Digest::of(&text)) && !is_named(page.name()) {
        return Err(damage::found(&key, "its steps are not those of its name"));
    }
    let page = Arc::new(page);
    store.pages.insert(key, Arc::clone(&page));
    Ok(page)
}

/// Those of some pages of a product that this process holds, by the start of their first step, with their names: none is read.
pub(super) fn held(
    store: &Store,
    product: &ProductId,
    names: &[Digest],
) -> HashMap<TimeMs, (Digest, Arc<Page>)> {
    let own = |name: &Digest| {
        let page = store.pages.get(&ObjectKey::manifest_page(product, name))?;
        let start = page.steps.first()?.period.start;
        Some((start, (*name, page)))
    };
    names.iter().filter_map(own).collect()
}

/// Makes pages of a product durable, but for those that are so because the version before names them.
pub(super) async fn write(
    store: &Store,
    product: &ProductId,
    pages: Vec<(Digest, Page)>,
    named_before: &[Digest],
) -> Result<(), StorageError> {
    let named_before: BTreeSet<&Digest> = named_before.iter().collect();
    let new = pages.into_iter();
    let new = new.filter(|(name, _)| !named_before.contains(name));
    stream::iter(new.collect::<Vec<_>>())
        .map(|(name, page)| async move {
            let key = ObjectKey::manifest_page(product, &name);
            document::put_new(store, &key, &page).await?;
            store.pages.insert(key, Arc::new(page));
            Ok::<_, StorageError>(())
        })
        .buffer_unordered(AT_ONCE)
        .try_collect::<()>()
        .await
}

#[cfg(test)]
mod tests;
