//! The exchange where a name can only be created once: each content is an object with the next number, and the newest
//! number is what the object holds.
//!
//! Of two writers that both saw number N, one creates N+1. Old numbers are removed from the oldest on, and never the last
//! ones. A writer that slept so long that even N+1 is gone could create it a second time. It finds out afterwards: there are
//! newer ones then, and the N that it saw is gone too; as long as that is there, so was everything above it.

use bytes::Bytes;
use chrono::{TimeDelta, Utc};
use contract::digest::Digest;
use contract::key::ObjectKey;
use futures::TryStreamExt as _;
use object_store::{Error, ObjectMeta, ObjectStoreExt as _};

use super::Seen;
use crate::StorageError;
use crate::store::{Store, failed, path};

/// Numbers that stay in any case.
const KEPT: u64 = 16;

/// So long a number stays in any case: no request takes that long.
fn least_age() -> TimeDelta {
    TimeDelta::days(1)
}

/// See [`Store::read_changing`].
pub(super) async fn read(
    store: &Store,
    key: &ObjectKey,
) -> Result<Option<(Bytes, Seen)>, StorageError> {
    while let Some((number, _)) = numbers(store, key).await?.pop() {
        let numbered = name(key, number)?;
        match store.objects.get(&path(&numbered)).await {
            Ok(found) => {
                let content = found.bytes().await.map_err(|e| failed(&numbered, e))?;
                let seen = named(number, &Digest::of(&content));
                return Ok(Some((content, seen)));
            }
            // Removed since it was listed, so that there are newer ones.
            Err(Error::NotFound { .. }) => {}
            Err(e) => return Err(failed(&numbered, e)),
        }
    }
    Ok(None)
}

/// See [`Store::swap`].
pub(super) async fn swap(
    store: &Store,
    key: &ObjectKey,
    seen: Option<&Seen>,
    content: Bytes,
) -> Result<Option<Seen>, StorageError> {
    let last = match seen.and_then(|seen| seen.tag.as_deref()) {
        None => 0,
        Some(tag) => tag.parse().map_err(|_no_number| {
            StorageError::damaged(key.as_str(), format!("{tag:?} is no number"))
        })?,
    };
    let digest = Digest::of(&content);
    match store.put_new(&name(key, last + 1)?, content).await {
        Ok(_now_or_by_a_lost_answer) => {}
        Err(StorageError::Conflict { .. }) => return Ok(None),
        Err(e) => return Err(e),
    }
    let there = numbers(store, key).await?;
    let newest = there.last().map_or(last + 1, |(number, _)| *number);
    // The newest is never removed: if that is ours, nobody was before us.
    let stands = newest == last + 1
        || match seen {
            Some(seen) => holds(store, key, last, seen).await?,
            // The first is removed only after more than are kept have come.
            None => newest <= KEPT,
        };
    if !stands {
        return Ok(None);
    }
    clean(store, key, &there, newest).await;
    Ok(Some(named(last + 1, &digest)))
}

/// Is the content that was seen still there under its number?
async fn holds(
    store: &Store,
    key: &ObjectKey,
    number: u64,
    seen: &Seen,
) -> Result<bool, StorageError> {
    let content = match store.fetch(&name(key, number)?).await {
        Ok(content) => content,
        Err(error) if error.is_not_found() => return Ok(false),
        Err(error) => return Err(error),
    };
    Ok(named(number, &Digest::of(&content)) == *seen)
}

/// A number and its content: a late writer may have left another one under the same number.
fn named(number: u64, content: &Digest) -> Seen {
    Seen {
        tag: Some(number.to_string()),
        version: Some(content.to_string()),
    }
}

/// Removes what nobody reads any more, the oldest first. What cannot be removed now is removed after another exchange.
async fn clean(store: &Store, key: &ObjectKey, there: &[(u64, ObjectMeta)], newest: u64) {
    let is_old = |meta: &ObjectMeta| Utc::now() - meta.last_modified > least_age();
    let old = there
        .iter()
        .take_while(|(number, meta)| number + KEPT <= newest && is_old(meta));
    for (number, meta) in old {
        if let Err(error) = store.objects.delete(&meta.location).await {
            tracing::info!(%key, number, %error, "an old number stays for now");
            return;
        }
    }
}

/// Numbers that are there, ascending.
async fn numbers(store: &Store, key: &ObjectKey) -> Result<Vec<(u64, ObjectMeta)>, StorageError> {
    let folder = object_store::path::Path::from(folder(key));
    let found = store.objects.list(Some(&folder));
    let found: Vec<ObjectMeta> = found.try_collect().await.map_err(|e| failed(key, e))?;
    let number = |meta: &ObjectMeta| meta.location.filename()?.parse::<u64>().ok();
    let mut numbers: Vec<(u64, ObjectMeta)> = found
        .into_iter()
        .filter_map(|meta| Some((number(&meta)?, meta)))
        .collect();
    numbers.sort_by_key(|(number, _)| *number);
    Ok(numbers)
}

/// Folder of the numbers, beside where the object itself would be.
fn folder(key: &ObjectKey) -> String {
    format!("{key}.numbers")
}

fn name(key: &ObjectKey, number: u64) -> Result<ObjectKey, StorageError> {
    let text = format!("{}/{number:020}", folder(key));
    text.parse()
        .map_err(|e| StorageError::damaged(key.as_str(), e))
}
