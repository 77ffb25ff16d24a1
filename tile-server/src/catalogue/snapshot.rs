//! What a store says of its products: its folders and one small request for each in, the newest version of each out.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use contract::flow::{check_parts, northward_of};
use contract::kind::Kind;
use contract::manifest::{Manifest, ManifestId};
use contract::product::ProductId;
use futures::stream::{self, StreamExt as _, TryStreamExt as _};
use storage::{StorageError, Store, manifests};

use super::layer::{Accumulated, Layer, Northward, equal_until};
use crate::metrics::Metrics;
use crate::versions::Versions;

/// Folder of all manifests; [`contract::key::ObjectKey::manifest`] puts them there.
pub(super) const FOLDER: &str = Kind::Manifest.folder();

/// Requests under way at a time.
const AT_ONCE: usize = 16;
/// After so many looks, whether the newest version that is known is still there is asked too: somebody may have taken a damaged one
/// away (docs/operations.md).
const LOOKS: u32 = 16;

type Entry = (Arc<Manifest>, ManifestId);

/// What was known at one moment.
#[derive(Debug, Clone, Default)]
pub(super) struct Snapshot {
    /// When the store was asked; none if that was never, or may have changed since.
    pub(super) read_at: Option<Instant>,
    /// How often it was.
    pub(super) looks: u32,
    pub(super) known: BTreeMap<ProductId, Entry>,
    pub(super) layers: BTreeMap<ProductId, Arc<Layer>>,
}

impl Snapshot {
    pub(super) fn is_younger_than(&self, age: Duration) -> bool {
        self.read_at.is_some_and(|at| at.elapsed() < age)
    }

    /// Is it what is known before anything was read?
    pub(super) fn is_first(&self) -> bool {
        self.read_at.is_none() && self.known.is_empty()
    }
}

/// Reads snapshots.
#[derive(Debug)]
pub(super) struct Reader {
    pub(super) store: Store,
    pub(super) metrics: Metrics,
    pub(super) versions: Versions,
}

impl Reader {
    /// Which products there are by one listing of their folders, and of each whether there is a newer version than is known; only
    /// those are read. Versions are not listed but for a product that was not known before.
    pub(super) async fn read(&self, before: &Snapshot) -> Result<Snapshot, StorageError> {
        let read_at = Some(Instant::now());
        let looks = before.looks.wrapping_add(1);
        let is_thorough = looks.is_multiple_of(LOOKS);
        // Manifests are never deleted: a product that is gone was lost with its disk, not withdrawn.
        let mut known = before.known.clone();
        let products = manifests::products(&self.store).await?;
        let mut newest = stream::iter(products)
            .map(|product| {
                let there = before.known.get(&product);
                async move {
                    let newest = self.newest(&product, there, is_thorough).await?;
                    Ok::<_, StorageError>((product, newest))
                }
            })
            .buffered(AT_ONCE);
        while let Some((product, newest)) = newest.try_next().await? {
            known.extend(newest.map(|entry| (product, entry)));
        }
        drop(newest);
        let mut layers = BTreeMap::new();
        for (product, (manifest, id)) in &known {
            let Some(extent) = manifest.extent() else {
                continue;
            };
            let layer = Layer {
                id: id.clone(),
                manifest: Arc::clone(manifest),
                extent,
                accumulated: self.accumulated(&known, manifest, id).await,
                northward: northward(&known, manifest),
            };
            // What is the same stays the same thing: whoever holds it sees that at a glance.
            let kept = before.layers.get(product).filter(|old| old.is_as(&layer));
            let layer = kept.cloned().unwrap_or_else(|| Arc::new(layer));
            layers.insert(product.clone(), layer);
        }
        Ok(Snapshot {
            read_at,
            looks,
            known,
            layers,
        })
    }

    /// The newest accumulated carbon of a version. While the derivation from a new version is on its way, the one
    /// before still holds as far as nothing changed that it was summed from.
    async fn accumulated(
        &self,
        known: &BTreeMap<ProductId, Entry>,
        manifest: &Manifest,
        id: &ManifestId,
    ) -> Option<Accumulated> {
        let product = manifest.product.accumulated().ok()?;
        let (derived, derived_id) = known.get(&product)?;
        let source = derived.derived_from.as_ref()?;
        let accumulated = Accumulated::new(derived_id.clone(), Arc::clone(derived));
        if source == id {
            return Some(accumulated);
        }
        let before = match self.versions.manifest(source).await {
            Ok(before) => before,
            Err(error) => {
                tracing::debug!(%error, manifest = %source, "the version before cannot be compared");
                return None;
            }
        };
        let until = Some(equal_until(&before, manifest)?);
        Some(Accumulated {
            until,
            ..accumulated
        })
    }

    /// The newest version of a product if it is another than is known; none, too, if it is damaged, which must not hide the other
    /// products.
    async fn newest(
        &self,
        product: &ProductId,
        known: Option<&Entry>,
        is_thorough: bool,
    ) -> Result<Option<Entry>, StorageError> {
        let found = match known {
            Some((manifest, _)) => {
                let number = manifest.number;
                let is_gone =
                    is_thorough && !manifests::is_there(&self.store, product, number).await?;
                if is_gone {
                    manifests::latest(&self.store, product).await
                } else {
                    manifests::newer(&self.store, product, number).await
                }
            }
            None => manifests::latest(&self.store, product).await,
        };
        match found {
            Ok(manifest) => Ok(manifest.map(|manifest| {
                let id = manifest.id();
                (Arc::new(manifest), id)
            })),
            Err(error) if error.is_retryable() => Err(error),
            Err(error) => {
                self.metrics.store_failures.inc();
                tracing::error!(%error, product.id = %product, "a manifest cannot be used");
                Ok(None)
            }
        }
    }
}

/// The newest northward part of the vector whose eastward part a product is.
fn northward(known: &BTreeMap<ProductId, Entry>, eastward: &Manifest) -> Option<Northward> {
    let (manifest, id) = known.get(&northward_of(eastward)?)?;
    check_parts(eastward, manifest).ok()?;
    manifest.extent()?;
    Some(Northward {
        id: id.clone(),
        manifest: Arc::clone(manifest),
    })
}

#[cfg(test)]
mod tests;
