//! What can go wrong with the program itself (not with a file): with what failed and whether to try again.

use std::path::PathBuf;

use contract::ContractError;
use storage::StorageError;

use crate::rejection::Rejection;

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
    #[error("gave up on product {product} after {tries} lost races for the next manifest number")]
    Contended {
        /// Product.
        product: String,
        /// Number of tries.
        tries: u32,
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
        match self {
            Self::Storage { source, .. } => source.is_retryable(),
            Self::Changed { .. } | Self::Contended { .. } => true,
            Self::Spawn { .. }
            | Self::Pipe { .. }
            | Self::Profile { .. }
            | Self::Contract(_)
            | Self::Task(_)
            | Self::Generate { .. } => false,
        }
    }
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
