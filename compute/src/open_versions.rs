//! Values of versions along time, opened once and held: what a version holds never changes, though where it is read fastest may.

use std::sync::Arc;

use contract::manifest::{Manifest, ManifestId};
use cube::{CubeError, Values};
use quick_cache::sync::Cache;
use storage::Store;

/// Versions that are held: each a few megabytes, and 16 MB of indexes.
const VERSIONS: usize = 8;

/// Versions that were opened, by their names.
pub(crate) struct OpenVersions(Cache<ManifestId, Values>);

impl OpenVersions {
    pub(crate) fn new() -> Self {
        Self(Cache::new(VERSIONS))
    }

    /// Values of a version, if they are held and opening them again would find nothing that is read faster.
    ///
    /// # Errors
    /// A store that does not answer.
    pub(crate) async fn held(&self, id: &ManifestId) -> Result<Option<Values>, CubeError> {
        let Some(values) = self.0.get(id) else {
            return Ok(None);
        };
        // A cube that grows or is being compacted is asked.
        let is_best = values.is_settled() || values.is_current().await?;
        Ok(is_best.then_some(values))
    }

    /// Values of a version, opened now if they are not held.
    pub(crate) async fn values(
        &self,
        store: &Store,
        manifest: &Manifest,
        id: &ManifestId,
    ) -> Result<Values, CubeError> {
        match self.held(id).await? {
            Some(values) => Ok(values),
            None => self.opened(store, manifest, id).await,
        }
    }

    /// Values of a version, opened now.
    pub(crate) async fn opened(
        &self,
        store: &Store,
        manifest: &Manifest,
        id: &ManifestId,
    ) -> Result<Values, CubeError> {
        let values = Values::of(store, &Arc::new(manifest.clone())).await?;
        match values.in_fields_count() {
            0 => {}
            steps => {
                tracing::debug!(version = %id, steps, "its cube lacks steps, which are read whole");
            }
        }
        // One without a cube may have one at any time.
        if values.is_settled() || values.has_cube() {
            self.0.insert(id.clone(), values.clone());
        }
        Ok(values)
    }

    /// Lets go of a version; false if it was not held.
    pub(crate) fn forget(&self, id: &ManifestId) -> bool {
        self.0.remove(id).is_some()
    }
}

impl std::fmt::Debug for OpenVersions {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} open versions", self.0.len())
    }
}
