//! What can go wrong between a service and its durable things.

use std::io::ErrorKind;
use std::path::PathBuf;

use contract::key::ObjectKey;

use crate::failure::Failure;

/// A failed read or write of something durable.
#[derive(Debug, thiserror::Error)]
pub enum StorageError {
    /// The object store refused or lost a request.
    #[error("{}", of_object(key, source))]
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
    /// What is on its way to the store cannot be put aside: a full disk may be emptied.
    #[error("cannot write to the spool {folder:?}: {source}")]
    Spool {
        folder: PathBuf,
        source: std::io::Error,
    },
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
            Self::Object { source, .. } => may_pass(source),
            Self::Log { .. } | Self::Spool { .. } => true,
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

    /// Is it that the store takes nothing: it may not be written, or there is no room in it? What is there can be read.
    pub fn takes_nothing(&self) -> bool {
        use object_store::Error;
        match self {
            Self::Object { source, .. } => match source {
                Error::PermissionDenied { .. } => true,
                Error::Generic { source, .. } => io_kinds(source.as_ref()).any(|kind| {
                    matches!(
                        kind,
                        ErrorKind::PermissionDenied
                            | ErrorKind::ReadOnlyFilesystem
                            | ErrorKind::StorageFull
                            | ErrorKind::QuotaExceeded
                    )
                }),
                _ => false,
            },
            Self::Conflict { .. }
            | Self::Damaged { .. }
            | Self::Spool { .. }
            | Self::Location { .. }
            | Self::Log { .. }
            | Self::LogSetup { .. } => false,
        }
    }

    /// Why a field of an attached product could not be read, if that is what failed.
    pub fn attached(&self) -> Option<&Failure> {
        Failure::behind(self)
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

/// What failed: of a field that lies in a store of others that store, and the reference to it is no part of the matter.
fn of_object(key: &str, source: &object_store::Error) -> String {
    match Failure::behind(source) {
        Some(failure) => failure.to_string(),
        None => format!("object {key:?}: {source}"),
    }
}

/// May the same request to an object store succeed later?
///
/// Clients put whatever they do not tell apart into one kind, `Generic`: there the cause decides. A full disk may be
/// emptied and a server may come back; a request that a server finds wrong (400 to 499), a part behind the end of an object, a
/// folder that may not be written, or a file larger than its file system takes, stays as it is.
pub(crate) fn may_pass(error: &object_store::Error) -> bool {
    use object_store::Error;
    match error {
        Error::NotFound { .. }
        | Error::InvalidPath { .. }
        | Error::NotSupported { .. }
        | Error::NotImplemented { .. }
        | Error::PermissionDenied { .. }
        | Error::Unauthenticated { .. }
        | Error::UnknownConfigurationKey { .. } => false,
        Error::Generic { source, .. } => !is_final(source.as_ref()),
        // Two writers at once, or a kind that this version does not know.
        _ => true,
    }
}

fn is_final(cause: &(dyn std::error::Error + 'static)) -> bool {
    // Requests that were too slow, too many, or in each other's way.
    const PASSING: [&str; 3] = ["408", "409", "429"];
    // An object that is shorter than whoever asks for a part of it was told: in memory, and twice of a folder.
    const SHORT: [&str; 3] = [
        "Wanted range starting at",
        "Requested range was invalid",
        "Out of range of file",
    ];
    if let Some(failure) = cause.downcast_ref::<Failure>() {
        return !failure.is_retryable();
    }
    let text = cause.to_string();
    if let Some((_, status)) = text.split_once("status code: ")
        && status.starts_with('4')
    {
        return !PASSING.iter().any(|passing| status.starts_with(passing));
    }
    if SHORT.iter().any(|short| text.contains(short)) {
        return true;
    }
    io_kinds(cause).any(|kind| {
        matches!(
            kind,
            ErrorKind::PermissionDenied
                | ErrorKind::ReadOnlyFilesystem
                | ErrorKind::NotADirectory
                | ErrorKind::FileTooLarge
        )
    })
}

/// What the system said, of an error and of what is behind it.
fn io_kinds(cause: &(dyn std::error::Error + 'static)) -> impl Iterator<Item = ErrorKind> {
    std::iter::successors(Some(cause), |cause| cause.source())
        .filter_map(|cause| cause.downcast_ref::<std::io::Error>())
        .map(std::io::Error::kind)
}

#[cfg(test)]
mod tests {
    use super::*;
    use object_store::local::LocalFileSystem;
    use object_store::memory::InMemory;
    use object_store::path::Path;
    use object_store::{ObjectStore, ObjectStoreExt as _};
    use std::io::Error as IoError;
    use std::sync::Arc;

    fn generic(source: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> object_store::Error {
        object_store::Error::Generic {
            store: "test",
            source: source.into(),
        }
    }

    #[test]
    fn a_full_disk_may_pass_and_a_locked_folder_may_not() {
        assert!(may_pass(&generic(IoError::from(ErrorKind::StorageFull))));
        assert!(may_pass(&generic(IoError::from(
            ErrorKind::ConnectionRefused
        ))));
        assert!(!may_pass(&generic(IoError::from(
            ErrorKind::PermissionDenied
        ))));
        assert!(!may_pass(&generic(IoError::from(
            ErrorKind::ReadOnlyFilesystem
        ))));
        assert!(!may_pass(&generic(IoError::from(ErrorKind::FileTooLarge))));
    }

    #[test]
    fn a_store_that_takes_nothing_is_told_from_one_that_is_away() {
        let of = |source| StorageError::Object {
            key: "a".to_owned(),
            source,
        };
        for kind in [
            ErrorKind::StorageFull,
            ErrorKind::QuotaExceeded,
            ErrorKind::ReadOnlyFilesystem,
        ] {
            assert!(of(generic(IoError::from(kind))).takes_nothing(), "{kind}");
        }
        let denied = object_store::Error::PermissionDenied {
            path: "a".to_owned(),
            source: "read only".into(),
        };
        assert!(of(denied).takes_nothing());
        assert!(!of(generic(IoError::from(ErrorKind::ConnectionRefused))).takes_nothing());
        assert!(!of(generic("no answer within 60 s")).takes_nothing());
    }

    #[tokio::test]
    async fn a_part_behind_the_end_of_an_object_is_not_there_later_either() {
        let folder = tempfile::tempdir().unwrap();
        let local = LocalFileSystem::new_with_prefix(folder.path()).unwrap();
        let stores: [Arc<dyn ObjectStore>; 2] = [Arc::new(InMemory::new()), Arc::new(local)];
        for store in stores {
            let path = Path::from("a");
            store.put(&path, "abc".into()).await.unwrap();
            let error = store.get_range(&path, 5..9).await.unwrap_err();
            assert!(!may_pass(&error), "{error}");
        }
    }

    #[test]
    fn a_servers_trouble_may_pass_and_a_wrong_request_may_not() {
        let answer =
            |status: &str| generic(format!("Server returned non-2xx status code: {status}: x"));
        for status in [
            "500 Internal Server Error",
            "503 Slow Down",
            "429 Too Many Requests",
        ] {
            assert!(may_pass(&answer(status)), "{status}");
        }
        for status in [
            "400 Bad Request",
            "405 Method Not Allowed",
            "411 Length Required",
        ] {
            assert!(!may_pass(&answer(status)), "{status}");
        }
        assert!(may_pass(&generic("no answer within 60 s")));
    }
}
