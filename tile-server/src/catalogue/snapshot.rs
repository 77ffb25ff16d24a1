//! What a store says of its products: one listing in, the newest version of each out.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use contract::flow::{check_parts, northward_of};
use contract::key::ObjectKey;
use contract::kind::Kind;
use contract::manifest::{Manifest, ManifestId};
use contract::product::ProductId;
use storage::{StorageError, Store, manifests};

use super::layer::{Accumulated, Layer, Northward, equal_until};
use crate::metrics::Metrics;
use crate::versions::Versions;

/// Folder of all manifests; [`ObjectKey::manifest`] puts them there.
pub(super) const FOLDER: &str = Kind::Manifest.folder();

type Entry = (ObjectKey, Arc<Manifest>, ManifestId);

/// What was known at one moment.
#[derive(Debug, Clone, Default)]
pub(super) struct Snapshot {
    /// When the store was asked; none if that was never, or may have changed since.
    pub(super) read_at: Option<Instant>,
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
    /// One listing of all manifests; only those that are new are read.
    pub(super) async fn read(&self, before: &Snapshot) -> Result<Snapshot, StorageError> {
        let read_at = Some(Instant::now());
        let mut newest: BTreeMap<ProductId, ObjectKey> = BTreeMap::new();
        for key in self.store.list(FOLDER).await? {
            // Keys come sorted and numbers are zero-padded: the last of a product is its newest.
            if let Some(product) = key
                .as_str()
                .split('/')
                .nth(1)
                .and_then(|name| name.parse().ok())
            {
                newest.insert(product, key);
            }
        }
        // Manifests are never deleted: a product that is gone was lost with its disk, not withdrawn.
        let mut known = before.known.clone();
        for (product, key) in newest {
            if known.get(&product).is_none_or(|entry| entry.0 != key)
                && let Some(entry) = self.load(&product, key).await?
            {
                known.insert(product, entry);
            }
        }
        let mut layers = BTreeMap::new();
        for (product, (_, manifest, id)) in &known {
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
        let (_, derived, derived_id) = known.get(&product)?;
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

    /// The newest manifest of a product; none if it is damaged, which must not hide the other products.
    async fn load(
        &self,
        product: &ProductId,
        key: ObjectKey,
    ) -> Result<Option<Entry>, StorageError> {
        match manifests::latest(&self.store, product).await {
            Ok(manifest) => Ok(manifest.map(|manifest| {
                let id = manifest.id();
                (
                    ObjectKey::manifest(product, manifest.number),
                    Arc::new(manifest),
                    id,
                )
            })),
            Err(error) if error.is_retryable() => Err(error),
            Err(error) => {
                self.metrics.store_failures.inc();
                tracing::error!(%error, product.id = %product, object.key = %key, "a manifest cannot be used");
                Ok(None)
            }
        }
    }
}

/// The newest northward part of the vector whose eastward part a product is.
fn northward(known: &BTreeMap<ProductId, Entry>, eastward: &Manifest) -> Option<Northward> {
    let (_, manifest, id) = known.get(&northward_of(eastward)?)?;
    check_parts(eastward, manifest).ok()?;
    manifest.extent()?;
    Some(Northward {
        id: id.clone(),
        manifest: Arc::clone(manifest),
    })
}
