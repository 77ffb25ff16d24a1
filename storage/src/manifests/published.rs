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
    for (number, _) in all.iter().rev().filter(|(_, written)| *written <= instant) {
        // Clean-up may have taken it meanwhile.
        if let Some(manifest) = numbered(store, product, *number).await? {
            return Ok(AtInstant::Version(Box::new(manifest)));
        }
    }
    Ok(match all.iter().map(|(_, written)| *written).min() {
        Some(first) => AtInstant::BeforeFirst(first),
        None => AtInstant::Nothing,
    })
}
