//! What can go wrong between a service and its durable things.

use contract::key::ObjectKey;

/// A failed read or write of something durable.
#[derive(Debug, thiserror::Error)]
pub enum StorageError {
    /// The object store refused or lost a request.
    #[error("object {key:?}: {source}")]
    Object {
        key: String,
        source: object_store::Error,
    },
    /// Something else is stored under a key that was to be created.
    #[error("{key} exists with other content; stored objects never change")]
    Conflict { key: ObjectKey },
    /// A stored object does not hold what its kind must hold.
    #[error("{object} is damaged: {reason}")]
    Damaged { object: String, reason: String },
    /// The place to store in cannot be used.
    #[error("cannot store in {location:?}: {reason}")]
    Location { location: String, reason: String },
    /// The event log cannot be read or written now.
    #[error("event log {log}: {source}")]
    Log {
        /// A folder or a list of brokers.
        log: String,
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The event log is not set up as it must be; trying again does not help.
    #[error("event log {log} cannot be used: {reason}")]
    LogSetup { log: String, reason: String },
}

impl StorageError {
    /// May the same call succeed later?
    pub fn is_retryable(&self) -> bool {
        match self {
            Self::Object { source, .. } => !matches!(
                source,
                object_store::Error::NotFound { .. }
                    | object_store::Error::InvalidPath { .. }
                    | object_store::Error::NotSupported { .. }
                    | object_store::Error::NotImplemented { .. }
                    | object_store::Error::PermissionDenied { .. }
                    | object_store::Error::Unauthenticated { .. }
            ),
            Self::Log { .. } => true,
            Self::Conflict { .. }
            | Self::Damaged { .. }
            | Self::Location { .. }
            | Self::LogSetup { .. } => false,
        }
    }

    /// Is the object simply not there?
    pub fn is_not_found(&self) -> bool {
        matches!(
            self,
            Self::Object {
                source: object_store::Error::NotFound { .. },
                ..
            }
        )
    }

    /// A failure of an event log that may pass.
    pub fn log(
        log: impl Into<String>,
        source: impl Into<Box<dyn std::error::Error + Send + Sync>>,
    ) -> Self {
        Self::Log {
            log: log.into(),
            source: source.into(),
        }
    }

    pub(crate) fn damaged(object: impl Into<String>, reason: impl std::fmt::Display) -> Self {
        Self::Damaged {
            object: object.into(),
            reason: reason.to_string(),
        }
    }
}
