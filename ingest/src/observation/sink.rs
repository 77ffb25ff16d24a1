//! Where observations of files go: the database or the files of the observation store, which ingest does not know.

use async_trait::async_trait;
use contract::observation::Observation;

/// What became of the observations of a file.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Stored {
    /// Names that were not there before.
    pub new: u64,
    /// Names that said something else before.
    pub replaced: u64,
    /// Names that said the same before.
    pub same: u64,
}

/// Why observations could not be stored.
#[derive(Debug, thiserror::Error)]
#[error("{source}")]
pub struct SinkError {
    /// The store's own words.
    pub source: Box<dyn std::error::Error + Send + Sync>,
    /// Where the cause lies.
    pub cause: SinkCause,
}

/// Where the cause lies: whoever hands over observations waits, or refuses their file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SinkCause {
    /// The same call may succeed later.
    Passing,
    /// Somebody must mend the store or its settings.
    Store,
    /// One of the observations can never be stored as it is.
    Observations,
}

/// Takes the observations of a file.
#[async_trait]
pub trait ObservationSink: Send + Sync {
    /// Stores observations; they are durable when this returns. The same ones again change nothing.
    async fn put(&self, observations: Vec<Observation>) -> Result<Stored, SinkError>;
}
