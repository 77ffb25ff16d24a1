//! Where ingest hands observations that it found in files.

use std::sync::Arc;

use async_trait::async_trait;
use contract::observation::Observation;
use ingest::observation::{ObservationSink, SinkCause, SinkError, Stored};
use observations::{ErrorClass, ObservationStore};

/// An observation store as ingest's sink.
pub(crate) struct Sink(pub(crate) Arc<dyn ObservationStore>);

#[async_trait]
impl ObservationSink for Sink {
    async fn put(&self, observations: Vec<Observation>) -> Result<Stored, SinkError> {
        let counts = self.0.upsert(&observations).await.map_err(|error| {
            let cause = match error.class() {
                ErrorClass::Retryable => SinkCause::Passing,
                ErrorClass::Internal => SinkCause::Store,
                ErrorClass::BadRequest => SinkCause::Observations,
            };
            SinkError {
                source: Box::new(error),
                cause,
            }
        })?;
        Ok(Stored {
            new: counts.new,
            replaced: counts.replaced,
            same: counts.same,
        })
    }
}
