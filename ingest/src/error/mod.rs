//! What can go wrong with the program itself (not with a file): with what failed and whether to try again.

mod blame;
pub(crate) mod boundary;
mod rejection;

use std::path::PathBuf;

use contract::ContractError;
use storage::StorageError;

use crate::observation::SinkCause;

pub(crate) use blame::blame;
pub use rejection::Rejection;

/// A failure of ingest itself. A bad file is a [`Rejection`], never one of these.
#[derive(Debug, thiserror::Error)]
pub enum IngestError {
    /// The object store or the event log failed.
    #[error("cannot {action}: {source}")]
    Storage {
        /// What was being done.
        action: &'static str,
        /// Why it failed.
        #[source]
        source: StorageError,
    },
    /// The sandboxed reader could not be started.
    #[error("cannot start the file reader {program:?}: {source}")]
    Spawn {
        /// Program that was to be started.
        program: PathBuf,
        /// Why it failed.
        #[source]
        source: std::io::Error,
    },
    /// The conversation with the sandboxed reader failed on this side.
    #[error("cannot talk to the file reader: {source}")]
    Pipe {
        /// Why it failed.
        #[source]
        source: std::io::Error,
    },
    /// A file changed while it was read.
    #[error("{file:?} changed while it was read; it is read again")]
    Changed {
        /// The file.
        file: PathBuf,
    },
    /// Other writers kept taking the next manifest number.
    #[error(
        "gave up on product {product} after {attempts} lost races for the next manifest number"
    )]
    Contended {
        /// Product.
        product: String,
        /// How many.
        attempts: usize,
    },
    /// A profile could not be read.
    #[error("profile {name:?}: {detail}")]
    Profile {
        /// File or name of the profile.
        name: String,
        /// What is wrong and what to do.
        detail: String,
    },
    /// A value this program made itself is not valid.
    #[error("internal value: {0}")]
    Contract(#[from] ContractError),
    /// A background task ended early.
    #[error("a background task ended early: {0}")]
    Task(#[from] tokio::task::JoinError),
    /// The program panicked over a file.
    #[error("the program stopped short: {what}")]
    Panicked {
        /// What it said.
        what: String,
    },
    /// Observations could not be stored.
    #[error("cannot store observations: {source}")]
    Observations {
        /// Why it failed.
        #[source]
        source: crate::observation::SinkError,
    },
    /// A setting cannot be used.
    #[error("--{setting}: {detail}")]
    Setting {
        /// Its flag.
        setting: &'static str,
        /// What is wrong and what to do.
        detail: String,
    },
    /// A file cannot be kept while it is worked on: the disk is full, say.
    #[error("cannot write to the spool {folder:?}: {source}")]
    Spool {
        /// Folder.
        folder: PathBuf,
        /// Why it failed.
        #[source]
        source: std::io::Error,
    },
    /// A digest cannot be taken.
    #[error("cannot take a digest: {source}")]
    Digest {
        /// Why it failed.
        #[source]
        source: openssl::error::ErrorStack,
    },
    /// Nothing can be fetched over HTTP.
    #[error("cannot set up HTTP: {source}")]
    Client {
        /// Why it failed.
        #[source]
        source: reqwest::Error,
    },
    /// The sandboxed reader was killed, and not for what its file asked of it.
    #[error("the file reader was killed")]
    Killed,
    /// Files that landed before cannot be read anew; what readers see is unchanged.
    #[error("{product} stays as it is: {detail}")]
    Reread {
        /// Product.
        product: String,
        /// What is in the way and what to do.
        detail: String,
    },
    /// A store of others does not answer.
    #[error(transparent)]
    Foreign {
        /// Where and why.
        source: cube::foreign::ForeignError,
    },
    /// A product cannot be attached so; what readers see is unchanged.
    #[error("{product} cannot be attached: {detail}")]
    Attach {
        /// Product.
        product: String,
        /// What is in the way and what to do.
        detail: String,
    },
    /// A synthetic file could not be written.
    #[error("cannot write {file:?}: {detail}")]
    Generate {
        /// The file.
        file: PathBuf,
        /// What failed.
        detail: String,
    },
}

impl IngestError {
    pub(crate) fn storage(action: &'static str) -> impl FnOnce(StorageError) -> Self {
        move |source| Self::Storage { action, source }
    }

    /// Is the same call worth another try?
    pub fn is_retryable(&self) -> bool {
        matches!(self.cause(), Cause::Passing)
    }

    /// Did the program panic?
    pub(crate) fn is_panic(&self) -> bool {
        match self {
            Self::Panicked { .. } => true,
            Self::Task(task) => task.is_panic(),
            _ => false,
        }
    }

    /// Is there no room on a disk (or none left of somebody's share of it)?
    pub fn is_disk_full(&self) -> bool {
        use std::io::{Error as IoError, ErrorKind};
        let first: &(dyn std::error::Error + 'static) = self;
        std::iter::successors(Some(first), |error| error.source())
            .filter_map(|error| error.downcast_ref::<IoError>())
            .any(|io| matches!(io.kind(), ErrorKind::StorageFull | ErrorKind::QuotaExceeded))
    }

    /// Where the cause lies.
    pub(crate) fn cause(&self) -> Cause {
        match self {
            Self::Storage { source, .. } if source.is_retryable() => Cause::Passing,
            Self::Storage { source, .. } => match source {
                StorageError::Conflict { .. } | StorageError::Damaged { .. } => Cause::Stored,
                _ if source.is_not_found() => Cause::Stored,
                _ => Cause::Place,
            },
            Self::Observations { source } => match source.cause {
                SinkCause::Passing => Cause::Passing,
                SinkCause::Store => Cause::Place,
                SinkCause::Observations => Cause::Granule,
            },
            Self::Foreign { source } if source.is_retryable() => Cause::Passing,
            Self::Changed { .. } | Self::Contended { .. } | Self::Spool { .. } | Self::Killed => {
                Cause::Passing
            }
            Self::Spawn { .. }
            | Self::Pipe { .. }
            | Self::Setting { .. }
            | Self::Client { .. }
            | Self::Digest { .. }
            | Self::Generate { .. } => Cause::Place,
            Self::Foreign { .. }
            | Self::Attach { .. }
            | Self::Profile { .. }
            | Self::Reread { .. }
            | Self::Contract(_)
            | Self::Task(_)
            | Self::Panicked { .. } => Cause::Granule,
        }
    }
}

/// Where the cause of a failure lies: what a service does next depends on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Cause {
    /// It may be gone at the next try.
    Passing,
    /// The place that this program runs in: somebody must mend it, and no file is to blame.
    Place,
    /// What is stored of the product.
    Stored,
    /// This file makes the program fail.
    Granule,
}

/// How a stage can end early: the file is bad, or the program failed.
#[derive(Debug)]
pub(crate) enum Stop {
    Rejected(Rejection),
    Failed(IngestError),
}

impl From<Rejection> for Stop {
    fn from(rejection: Rejection) -> Self {
        Self::Rejected(rejection)
    }
}

impl<E: Into<IngestError>> From<E> for Stop {
    fn from(error: E) -> Self {
        Self::Failed(error.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Error as IoError, ErrorKind};

    #[test]
    fn a_full_disk_is_known_behind_every_door() {
        let full = || IoError::from(ErrorKind::StorageFull);
        let spool = |source| IngestError::Spool {
            folder: PathBuf::from("spool"),
            source,
        };
        assert!(spool(full()).is_disk_full());
        assert!(!spool(IoError::from(ErrorKind::PermissionDenied)).is_disk_full());
        let log = IngestError::storage("finish notices")(StorageError::log("events", full()));
        assert!(log.is_disk_full() && log.is_retryable(), "{log}");
        let object = object_store::Error::Generic {
            store: "folder",
            source: full().into(),
        };
        let key = "frames/p/x".to_owned();
        let store = StorageError::Object {
            key,
            source: object,
        };
        let store = IngestError::storage("store a field")(store);
        assert!(store.is_disk_full() && store.is_retryable(), "{store}");
    }
}
