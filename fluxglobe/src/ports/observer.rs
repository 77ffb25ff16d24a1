//! The tile server's questions about observations, put to the observation store of this deployment.

use std::sync::Arc;

use async_trait::async_trait;
use contract::observation::{Filter, Page, PlatformList, TrackPoint, TrackQuery};
use contract::product::ProductId;
use observations::{ErrorClass, ObservationError, ObservationStore};
use tile_server::backend::{BackendError, Class, Observe};

/// An observation store as the tile server's port.
pub(crate) struct Observer(pub(crate) Arc<dyn ObservationStore>);

#[async_trait]
impl Observe for Observer {
    async fn platforms(&self, filter: &Filter) -> Result<PlatformList, BackendError> {
        self.0.platforms(filter).await.map_err(failed)
    }

    async fn datasets(&self) -> Result<Vec<ProductId>, BackendError> {
        self.0.datasets().await.map_err(failed)
    }

    async fn tracks(&self, queries: &[TrackQuery]) -> Result<Vec<Vec<TrackPoint>>, BackendError> {
        self.0.tracks(queries).await.map_err(failed)
    }

    async fn observations(&self, filter: &Filter) -> Result<Page, BackendError> {
        self.0.query(filter).await.map_err(failed)
    }

    async fn ready(&self) -> Result<(), BackendError> {
        self.0.ready().await.map_err(failed)
    }
}

fn failed(error: ObservationError) -> BackendError {
    let class = match error.class() {
        ErrorClass::BadRequest => Class::BadRequest,
        ErrorClass::Retryable => Class::Unavailable,
        ErrorClass::Internal => Class::Internal,
    };
    let text = match class {
        // The error names servers: the log may know them, whoever asks here need not.
        Class::Unavailable => "the observation store does not answer at the moment".to_owned(),
        _ => error.to_string(),
    };
    BackendError::new(class, text).because(error)
}
