//! What a picture is drawn from, as a name: pictures of one name find their frames on one worker.

use std::sync::{Arc, Mutex, PoisonError};

use contract::job::RenderJob;
use contract::manifest::{Bracket, Manifest, ManifestId};
use storage::Store;

use super::FleetError;
use crate::recent::Recent;

/// Manifests kept; each is a few kilobytes a step.
const MOST_MANIFESTS: u64 = 64;

/// Names places. Reads manifests, which never change, once.
pub(super) struct Places {
    store: Store,
    manifests: Mutex<Recent<String, Arc<Manifest>>>,
}

impl Places {
    pub(super) fn new(store: Store) -> Self {
        Self {
            store,
            manifests: Mutex::default(),
        }
    }

    /// The product and the two frames that a job lies between. A store that cannot be read now does not keep anybody
    /// from asking a worker: then the instant stands for the frames.
    pub(super) async fn of(&self, job: &RenderJob) -> Result<String, FleetError> {
        let product = &job.product.product;
        match self.manifest(&job.product).await {
            Ok(manifest) => Ok(manifest.bracket(job.time).map_or_else(
                || format!("{product} {}", job.time.ms()),
                |bracket| of_bracket(&manifest, &bracket),
            )),
            Err(error) if error.is_not_found() => {
                Err(FleetError::NotFound(format!("there is no {}", job.product)))
            }
            Err(error) => {
                tracing::warn!(%error, "a manifest cannot be read to choose a worker");
                Ok(format!("{product} {}", job.time.ms()))
            }
        }
    }

    async fn manifest(&self, id: &ManifestId) -> Result<Arc<Manifest>, storage::StorageError> {
        let name = id.to_string();
        // Changed by single inserts and removals, so a poisoned lock still guards a whole map.
        let held = || {
            self.manifests
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
        };
        let known = held().get(&name);
        if let Some(manifest) = known {
            return Ok(manifest);
        }
        let manifest = Arc::new(storage::manifests::load(&self.store, id).await?);
        held().keep(name, Arc::clone(&manifest), MOST_MANIFESTS, |_| 1);
        Ok(manifest)
    }
}

/// Frames are named by their content, so a new version of a product leaves what did not change where it is.
fn of_bracket(manifest: &Manifest, bracket: &Bracket) -> String {
    let frame = |step: usize| manifest.steps[step].frame.as_str();
    let before = bracket.before.map_or("start", frame);
    format!("{} {before} {}", manifest.product, frame(bracket.after))
}
