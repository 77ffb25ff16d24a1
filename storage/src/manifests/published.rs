//! When manifests were published: when the store wrote them.

use contract::kind::Kind;
use contract::manifest::Manifest;
use contract::product::ProductId;
use contract::time::TimeMs;

use super::{number_of, numbered};
use crate::{StorageError, Store};

/// The newest version of a product at an instant.
#[derive(Debug, Clone, PartialEq)]
pub enum AtInstant {
    /// It had one.
    Version(Box<Manifest>),
    /// The first that is kept was published later.
    BeforeFirst(TimeMs),
    /// Clean-up has taken it: the last one that is kept of those before it.
    Gone(u64),
    /// It has none.
    Nothing,
}

/// Numbers of the manifests that a product has, ascending, and when the store wrote each. In a store that was copied that is the
/// time of the copy.
pub async fn published(
    store: &Store,
    product: &ProductId,
) -> Result<Vec<(u64, TimeMs)>, StorageError> {
    let folder = format!("{}/{product}", Kind::Manifest.folder());
    let keys = store.list_written(&folder).await?;
    let mut all: Vec<(u64, TimeMs)> = keys
        .iter()
        .filter_map(|(key, written)| Some((number_of(key)?, *written)))
        .collect();
    all.sort_unstable();
    Ok(all)
}

/// The newest version that was published at an instant or before.
pub async fn as_of(
    store: &Store,
    product: &ProductId,
    instant: TimeMs,
) -> Result<AtInstant, StorageError> {
    let all = published(store, product).await?;
    let newest = all.iter().rposition(|(_, written)| *written <= instant);
    if let Some(at) = newest {
        let (number, _) = all[at];
        // Where those that follow it are gone, the newest of then may have been one of them: it is there for being pinned, or for what was
        // made of it.
        let is_known = all.get(at + 1).is_none_or(|(next, _)| *next == number + 1);
        return Ok(match numbered(store, product, number).await? {
            Some(manifest) if is_known => AtInstant::Version(Box::new(manifest)),
            // Clean-up may have taken it meanwhile.
            _ => AtInstant::Gone(number),
        });
    }
    Ok(match all.iter().map(|(_, written)| *written).min() {
        Some(first) => AtInstant::BeforeFirst(first),
        None => AtInstant::Nothing,
    })
}
