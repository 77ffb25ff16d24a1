//! The suite on the embedded log, in a folder as it is used.

use storage::log::EmbeddedLog;

use crate::suite::run_suite;

/// Keeps the folder for as long as the log is used.
struct InFolder {
    log: EmbeddedLog,
    folder: tempfile::TempDir,
}

async fn open() -> InFolder {
    let folder = tempfile::tempdir().unwrap();
    InFolder {
        log: EmbeddedLog::open(folder.path()).unwrap(),
        folder,
    }
}

async fn end(own: InFolder) {
    drop(own.log);
    own.folder.close().unwrap();
}

run_suite!(open, end);
