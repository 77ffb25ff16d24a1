//! Versions of products by their name, so that what was cited once can be shown again.

use std::sync::Arc;

use contract::manifest::{Manifest, ManifestId};
use contract::quantity::Quantity;
use prometheus::IntCounter;
use quick_cache::sync::Cache;
use storage::{StorageError, Store, manifests};

use crate::catalogue::{Accumulated, Layer};
use crate::derivations::Derivations;
use crate::error::ServerError;

/// Versions remembered: each is the list of its steps, some ten KiB.
const REMEMBERED: usize = 256;

/// The versions of all products.
#[derive(Debug)]
pub(crate) struct Versions {
    known: Cache<String, Arc<Layer>>,
    manifests: Cache<String, Arc<Manifest>>,
    derivations: Derivations,
    store: Store,
}

impl Versions {
    /// None read yet; `panics` counts those of looking for derived ones.
    pub(crate) fn new(store: Store, panics: &IntCounter) -> Self {
        Self {
            known: Cache::new(REMEMBERED),
            manifests: Cache::new(REMEMBERED),
            derivations: Derivations::new(store.clone(), panics),
            store,
        }
    }

    /// A version as it was published; what its particles drift with is another product.
    ///
    /// # Errors
    /// Not found if it was never there, or is there no more.
    pub(crate) async fn layer(&self, id: &ManifestId) -> Result<Arc<Layer>, ServerError> {
        let name = id.to_string();
        if let Some(layer) = self.known.get(&name) {
            return Ok(layer);
        }
        let manifest = self.manifest(id).await?;
        let extent = manifest.extent().ok_or_else(|| ServerError::EmptyProduct {
            name: manifest.product.to_string(),
        })?;
        let accumulated = self.derivation(&manifest, id).await?;
        // A derivation may still be on its way.
        let is_settled = accumulated.is_some() || manifest.quantity != Quantity::CarbonFlux;
        let layer = Arc::new(Layer {
            id: id.clone(),
            manifest,
            extent,
            accumulated,
            northward: None,
        });
        if is_settled {
            self.known.insert(name, Arc::clone(&layer));
        }
        Ok(layer)
    }

    /// The manifest of a version.
    ///
    /// # Errors
    /// Not found if it was never there, or is there no more.
    pub(crate) async fn manifest(&self, id: &ManifestId) -> Result<Arc<Manifest>, ServerError> {
        let name = id.to_string();
        if let Some(manifest) = self.manifests.get(&name) {
            return Ok(manifest);
        }
        match manifests::load(&self.store, id).await {
            Ok(manifest) => {
                let manifest = Arc::new(manifest);
                self.manifests.insert(name, Arc::clone(&manifest));
                Ok(manifest)
            }
            // Also one whose number is there with other contents: the name is that of nothing.
            Err(error) if error.is_not_found() || matches!(error, StorageError::Damaged { .. }) => {
                tracing::debug!(%error, manifest = name, "a version is not there");
                Err(ServerError::UnknownVersion { manifest: name })
            }
            Err(error) => Err(error.into()),
        }
    }

    /// The accumulated carbon that was derived from exactly this version.
    async fn derivation(
        &self,
        manifest: &Manifest,
        id: &ManifestId,
    ) -> Result<Option<Accumulated>, ServerError> {
        if manifest.quantity != Quantity::CarbonFlux {
            return Ok(None);
        }
        let Ok(product) = manifest.product.accumulated() else {
            return Ok(None);
        };
        let derived = self.derivations.of(id, &product).await?;
        Ok(derived.map(|derived| Accumulated::new(derived.id(), derived)))
    }
}
