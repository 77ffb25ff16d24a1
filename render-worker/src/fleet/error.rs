//! Why a fleet brought no picture.

use std::time::Duration;

/// A picture that could not be had.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum FleetError {
    /// The settings name a worker that cannot be one, or a metric exists twice.
    #[error("render workers cannot be used: {0}")]
    Setup(String),
    /// The job is wrong; the text says how.
    #[error("{0}")]
    BadRequest(String),
    /// The job names something that is not stored.
    #[error("{0}")]
    NotFound(String),
    /// All workers that were asked are full.
    #[error("all render workers are full; ask again in {} ms", retry_after.as_millis())]
    Busy { retry_after: Duration },
    /// No worker could be reached, or none of this version.
    #[error("no render worker could draw: {0}")]
    Unavailable(String),
    /// No picture within the time.
    #[error("no picture within {} ms", deadline.as_millis())]
    Late { deadline: Duration },
    /// Workers tried and failed.
    #[error("the picture cannot be drawn: {0}")]
    Failed(String),
}

impl FleetError {
    /// May the same job succeed later?
    pub fn is_retryable(&self) -> bool {
        match self {
            Self::Busy { .. } | Self::Unavailable(_) | Self::Late { .. } => true,
            Self::Setup(_) | Self::BadRequest(_) | Self::NotFound(_) | Self::Failed(_) => false,
        }
    }

    /// When to ask again, where a worker said so.
    pub fn retry_after(&self) -> Option<Duration> {
        match self {
            Self::Busy { retry_after } => Some(*retry_after),
            _ => None,
        }
    }
}
