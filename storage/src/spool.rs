//! Where bytes lie that are on their way to the store: memory while they are few, a file without a name when they are many.

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

use tempfile::{SpooledData, SpooledTempFile, spooled_tempfile_in};

use crate::StorageError;
use crate::content::Content;

/// Bytes that are held; those of what is larger lie in a file, which ends with the process.
pub const HELD_BYTES: u64 = 32 << 20;
/// Where such files lie when nobody said where: on a disk, where `/tmp` may be memory, unless nothing can be written there.
pub static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
    let disk = PathBuf::from("/var/tmp");
    if tempfile::tempfile_in(&disk).is_ok() {
        disk
    } else {
        std::env::temp_dir()
    }
});

/// Bytes that are being written; clones write to the same place.
#[derive(Debug, Clone)]
pub struct Spool {
    folder: PathBuf,
    inner: Arc<Mutex<Inner>>,
}

#[derive(Debug)]
struct Inner {
    file: SpooledTempFile,
    failure: Option<io::Error>,
}

impl Spool {
    /// One whose file, if it needs one, lies in a folder.
    pub fn new(folder: &Path) -> Self {
        Self::holding(folder, HELD_BYTES)
    }

    /// The same of which so many bytes are held: where several are written at a time.
    pub fn holding(folder: &Path, held_bytes: u64) -> Self {
        let inner = Inner {
            file: spooled_tempfile_in(usize::try_from(held_bytes).unwrap_or(usize::MAX), folder),
            failure: None,
        };
        Self {
            folder: folder.to_owned(),
            inner: Arc::new(Mutex::new(inner)),
        }
    }

    /// Why something could not be written, if that was so; it is told once.
    pub fn failure(&self) -> Option<StorageError> {
        let source = self.with(|inner| inner.failure.take())?;
        Some(self.failed(source))
    }

    /// What failed with an error: the spool where it could not be written, which is no fault of what was.
    pub fn or_failure(&self, error: StorageError) -> StorageError {
        self.failure().unwrap_or(error)
    }

    /// What was written.
    ///
    /// # Errors
    /// Its file cannot be asked how large it is.
    pub fn into_content(self) -> Result<Content, StorageError> {
        let folder = &self.folder;
        let empty = || spooled_tempfile_in(0, folder);
        let file = self.with(|inner| std::mem::replace(&mut inner.file, empty()));
        match file.into_inner() {
            SpooledData::InMemory(bytes) => Ok(Content::Bytes(bytes.into_inner().into())),
            SpooledData::OnDisk(file) => Content::of_file(file).map_err(|e| self.failed(e)),
        }
    }

    fn failed(&self, source: io::Error) -> StorageError {
        StorageError::Spool {
            folder: self.folder.clone(),
            source,
        }
    }

    fn with<T>(&self, work: impl FnOnce(&mut Inner) -> T) -> T {
        // Whoever panicked while writing gives nothing out.
        work(&mut self.inner.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Write for Spool {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.with(|inner| {
            let written = inner.file.write(bytes);
            written.map_err(|error| {
                let kind = error.kind();
                inner.failure = Some(error);
                kind.into()
            })
        })
    }

    fn flush(&mut self) -> io::Result<()> {
        self.with(|inner| inner.file.flush())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_bytes_are_held_and_many_lie_in_a_file() {
        let folder = tempfile::tempdir().unwrap();
        let content = |length: usize| {
            let mut spool = Spool::new(folder.path());
            spool.write_all(&vec![7; length]).unwrap();
            spool.into_content().unwrap()
        };
        assert!(matches!(content(1000), Content::Bytes(_)));
        let large = content(HELD_BYTES as usize + 1);
        assert!(matches!(large, Content::File(..)));
        assert_eq!(large.size_bytes(), HELD_BYTES + 1);
        assert_eq!(
            folder.path().read_dir().unwrap().count(),
            0,
            "it has no name"
        );
    }

    #[test]
    fn a_folder_that_is_gone_is_told_of_as_such() {
        let mut spool = Spool::new(Path::new("/nowhere/at/all"));
        let written = spool.write_all(&vec![7; HELD_BYTES as usize + 1]);
        assert!(written.is_err());
        let failure = spool.failure().unwrap();
        assert!(matches!(failure, StorageError::Spool { .. }), "{failure}");
        assert!(failure.is_retryable() && spool.failure().is_none());
    }
}
