//! Values of versions along time, opened once and held: what a version holds never changes.

use std::sync::Arc;

use contract::manifest::{Manifest, ManifestId};
use cube::Values;
use quick_cache::sync::Cache;

use crate::{ComputeError, Engine};

/// Versions that are held: each a few megabytes, and 16 MB of indexes.
const VERSIONS: usize = 8;

/// Versions that were opened, by their names.
pub(crate) struct OpenVersions(Cache<ManifestId, Values>);

impl OpenVersions {
    pub(crate) fn new() -> Self {
        Self(Cache::new(VERSIONS))
    }
}

impl Engine {
    /// Values of a version of a product along time; `id` is its name, which is costly to compute.
    ///
    /// # Errors
    /// A store that does not answer; a cube that cannot be read.
    pub async fn values(
        &self,
        manifest: &Manifest,
        id: &ManifestId,
    ) -> Result<Values, ComputeError> {
        let held = &self.open_versions().0;
        if let Some(values) = held.get(id) {
            return Ok(values);
        }
        let values = Values::of(self.store(), &Arc::new(manifest.clone())).await?;
        match values.in_fields_count() {
            0 => {}
            steps => {
                tracing::debug!(version = %id, steps, "its cube lacks steps, which are read from whole fields");
            }
        }
        // What comes to be faster is opened again until it is.
        if values.is_settled() {
            held.insert(id.clone(), values.clone());
        }
        Ok(values)
    }

    /// Lets go of a version; false if it was not held.
    pub(crate) fn forget_values(&self, id: &ManifestId) -> bool {
        self.open_versions().0.remove(id).is_some()
    }
}
