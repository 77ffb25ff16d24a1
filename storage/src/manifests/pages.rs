//! Pages of manifests: stored once under the digest of their steps, and held, since they never change.

use std::collections::BTreeSet;
use std::sync::Arc;

use contract::key::ObjectKey;
use contract::manifest::{Manifest, Page, PagedManifest};
use futures::stream::{self, StreamExt as _, TryStreamExt as _};

use crate::sound::damage;
use crate::{StorageError, Store, document};

/// Pages that are read or sent at a time.
const AT_ONCE: usize = 8;

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
    let Some(page) = document::get::<Page>(store, &key).await? else {
        return Err(StorageError::damaged(
            key.as_str(),
            "a manifest names it, and it is not there",
        ));
    };
    if !key.as_str().contains(&page.name().to_string()) {
        return Err(damage::found(&key, "its steps are not those of its name"));
    }
    let page = Arc::new(page);
    store.pages.insert(key, Arc::clone(&page));
    Ok(page)
}

/// Makes pages durable, but for those that are so because the version before names them.
pub(super) async fn write(
    store: &Store,
    paged: &PagedManifest,
    pages: Vec<Page>,
    named_before: &BTreeSet<ObjectKey>,
) -> Result<(), StorageError> {
    let new = paged.page_keys().zip(pages);
    let new = new.filter(|(key, _)| !named_before.contains(key));
    stream::iter(new.collect::<Vec<_>>())
        .map(|(key, page)| async move {
            document::put_new(store, &key, &page).await?;
            store.pages.insert(key, Arc::new(page));
            Ok::<_, StorageError>(())
        })
        .buffer_unordered(AT_ONCE)
        .try_collect::<()>()
        .await
}
