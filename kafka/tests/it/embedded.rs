//! The suite on the embedded log, in a folder as it is used.

use std::future::{Ready, ready};

use storage::log::EmbeddedLog;

use crate::suite::run_suite;

/// Keeps the folder for as long as the log is used.
struct InFolder {
    log: EmbeddedLog,
    folder: tempfile::TempDir,
}

fn open() -> Ready<InFolder> {
    let folder = tempfile::tempdir().unwrap();
    ready(InFolder {
        log: EmbeddedLog::open(folder.path()).unwrap(),
        folder,
    })
}

fn end(own: InFolder) -> Ready<()> {
    drop(own.log);
    own.folder.close().unwrap();
    ready(())
}

run_suite!(open, end);
