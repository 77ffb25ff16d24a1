//! One version of a product, as a question reads it.

use std::sync::Arc;

use contract::manifest::{Manifest, ManifestId, Step};
use cube::Values;
use datafusion::common::DataFusionError;
use storage::StorageError;
use storage::rows::{Fetched, Stored};

use super::axes::Axes;
use crate::{ComputeError, Engine};

/// A version, its axes, and the engine that reads it. Clones share it.
#[derive(Clone)]
pub(super) struct Version(Arc<Inner>);

struct Inner {
    engine: Engine,
    manifest: Arc<Manifest>,
    id: ManifestId,
    axes: Axes,
}

impl std::fmt::Debug for Version {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}", self.0.id)
    }
}

impl Version {
    pub(super) fn new(engine: &Engine, manifest: Arc<Manifest>) -> Self {
        Self(Arc::new(Inner {
            engine: engine.clone(),
            id: manifest.id(),
            axes: Axes::of(&manifest),
            manifest,
        }))
    }

    pub(super) fn manifest(&self) -> &Manifest {
        &self.0.manifest
    }

    pub(super) fn id(&self) -> &ManifestId {
        &self.0.id
    }

    pub(super) fn axes(&self) -> &Axes {
        &self.0.axes
    }

    /// Processors that may decode for one question.
    pub(super) fn decoders(&self) -> usize {
        self.0.engine.partitions().get()
    }

    /// Its values along time.
    pub(super) async fn values(&self) -> Result<Values, ComputeError> {
        let Inner {
            engine,
            manifest,
            id,
            ..
        } = &*self.0;
        engine.values(manifest, id).await
    }

    /// The same anew: what was opened may have been made anew and cleaned up since. None if nothing was held.
    pub(super) async fn values_anew(&self) -> Option<Result<Values, ComputeError>> {
        let Inner { engine, id, .. } = &*self.0;
        if engine.forget_values(id) {
            Some(self.values().await)
        } else {
            None
        }
    }

    /// Fetches chunks of a step's field.
    pub(super) async fn chunks(
        &self,
        step: &Step,
        chunks: &[u32],
    ) -> Result<Fetched, ComputeError> {
        let stored = self.stored(step)?;
        let index = self.0.engine.objects().row_index(&stored).await?;
        Ok(storage::rows::fetch(&stored, index, chunks.to_vec()).await?)
    }

    /// Forgets what is remembered of a step's field, if an error says that it was that of a damaged one.
    pub(super) fn is_forgotten(&self, step: &Step, error: &ComputeError) -> bool {
        let is_damaged = matches!(error, ComputeError::Storage(StorageError::Damaged { .. }));
        match self.stored(step) {
            Ok(stored) if is_damaged => {
                self.0.engine.objects().forget(&stored);
                true
            }
            _ => false,
        }
    }

    fn stored(&self, step: &Step) -> Result<Stored, ComputeError> {
        let address = self.0.engine.store().sql_url(&step.field);
        self.0
            .engine
            .objects()
            .stored(&step.field, address.as_str())
    }
}

/// An error of ours among the engine's.
pub(super) fn external(error: impl Into<ComputeError>) -> DataFusionError {
    DataFusionError::External(Box::new(error.into()))
}
