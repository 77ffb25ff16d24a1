//! Where files from the network are kept while they are worked on: a folder of this process with a budget of bytes.

use std::fs::{File, TryLockError};
use std::io;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

use tempfile::{NamedTempFile, TempDir};

use crate::error::IngestError;
use crate::limits::room::{Room, Taken};

/// Folders of processes begin so; a lock file of the same name with this ending is held while the process lives.
const PREFIX: &str = "ingest-";
const LOCK_SUFFIX: &str = ".lock";

/// A folder of this process, removed when it ends; what a killed process left behind is removed by the next one.
#[derive(Debug)]
pub(super) struct Spool {
    folder: TempDir,
    lock: PathBuf,
    _locked: File,
    room: Room,
    bytes: u64,
}

/// A file in the spool, removed when dropped.
#[derive(Debug)]
pub(super) struct Spooled {
    file: NamedTempFile,
    /// Given back after the file is gone.
    room: Taken,
}

impl Spool {
    /// Makes a folder of its own in `parent`, which may hold `bytes` bytes.
    pub(super) fn open(parent: &Path, bytes: u64) -> Result<Self, IngestError> {
        let failed = |source| failed(parent, source);
        std::fs::create_dir_all(parent).map_err(failed)?;
        remove_leftovers(parent).map_err(failed)?;
        let (folder, lock, locked) = own_folder(parent).map_err(failed)?;
        let spool = Self {
            folder,
            lock,
            _locked: locked,
            room: Room::new(bytes),
            bytes,
        };
        spool.check()?;
        Ok(spool)
    }

    /// Largest file that fits at all.
    pub(super) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// An empty file, once there is room for `bytes`. All room is taken at once, so that no two files wait for each other.
    pub(super) async fn file(&self, bytes: u64) -> Result<Spooled, IngestError> {
        let room = self.room.take(bytes).await;
        let file = NamedTempFile::new_in(self.folder.path())
            .map_err(|source| failed(self.folder.path(), source))?;
        Ok(Spooled { file, room })
    }

    /// Can a file be written now?
    pub(super) fn check(&self) -> Result<(), IngestError> {
        let probe = || {
            let mut file = NamedTempFile::new_in(self.folder.path())?;
            io::Write::write_all(&mut file, &[0; 4096])
        };
        probe().map_err(|source| failed(self.folder.path(), source))
    }
}

impl Drop for Spool {
    fn drop(&mut self) {
        std::fs::remove_file(&self.lock).unwrap_or_else(|error| {
            tracing::debug!(%error, "the spool's lock file stays");
        });
    }
}

impl Spooled {
    pub(super) fn file(&self) -> &File {
        self.file.as_file()
    }

    pub(super) fn path(&self) -> &Path {
        self.file.path()
    }

    /// Gives back the room that the file turned out not to need.
    pub(super) fn shrink_to(&mut self, bytes: u64) {
        self.room.shrink_to(bytes);
    }
}

pub(super) fn failed(folder: &Path, source: io::Error) -> IngestError {
    IngestError::Spool {
        folder: folder.to_owned(),
        source,
    }
}

fn own_folder(parent: &Path) -> io::Result<(TempDir, PathBuf, File)> {
    loop {
        let folder = tempfile::Builder::new().prefix(PREFIX).tempdir_in(parent)?;
        let mut name = folder.path().as_os_str().to_owned();
        name.push(LOCK_SUFFIX);
        let lock = PathBuf::from(name);
        let file = File::create(&lock)?;
        match file.try_lock() {
            // Another process that tidied up may have taken the file away between the two calls.
            Ok(()) if file.metadata()?.nlink() > 0 && folder.path().is_dir() => {
                return Ok((folder, lock, file));
            }
            Ok(()) | Err(TryLockError::WouldBlock) => {}
            Err(TryLockError::Error(error)) => return Err(error),
        }
    }
}

/// Removes folders whose process is gone: nobody holds their lock.
fn remove_leftovers(parent: &Path) -> io::Result<()> {
    for entry in std::fs::read_dir(parent)? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let Some(folder) = name
            .strip_suffix(LOCK_SUFFIX)
            .filter(|name| name.starts_with(PREFIX))
        else {
            continue;
        };
        let is_free = File::open(&path).is_ok_and(|lock| lock.try_lock().is_ok());
        if is_free {
            let removed = std::fs::remove_dir_all(parent.join(folder))
                .or_else(|e| {
                    if e.kind() == io::ErrorKind::NotFound {
                        Ok(())
                    } else {
                        Err(e)
                    }
                })
                .and_then(|()| std::fs::remove_file(&path));
            if let Err(error) = removed {
                tracing::warn!(%error, folder, "what an earlier process left in the spool stays");
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::room::UNIT_BYTES;
    use std::time::Duration;

    fn names(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).unwrap();
        let mut names: Vec<String> = entries
            .map(|e| e.unwrap().file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    #[tokio::test]
    async fn a_file_waits_until_there_is_room() {
        let parent = tempfile::tempdir().unwrap();
        let spool = Spool::open(parent.path(), 2 * UNIT_BYTES).unwrap();
        let mut first = spool.file(2 * UNIT_BYTES).await.unwrap();
        let second = spool.file(UNIT_BYTES);
        tokio::pin!(second);
        let early = tokio::time::timeout(Duration::from_millis(20), &mut second).await;
        assert!(early.is_err(), "there was no room");
        first.shrink_to(UNIT_BYTES);
        let second = second.await.unwrap();
        let path = second.path().to_owned();
        assert!(path.exists());
        drop(second);
        assert!(!path.exists(), "a file goes with its last user");
    }

    #[tokio::test]
    async fn what_a_killed_process_left_is_removed_and_a_living_ones_stays() {
        let parent = tempfile::tempdir().unwrap();
        let living = Spool::open(parent.path(), UNIT_BYTES).unwrap();
        std::fs::create_dir(parent.path().join("ingest-dead")).unwrap();
        std::fs::write(parent.path().join("ingest-dead/file"), "x").unwrap();
        std::fs::write(parent.path().join("ingest-dead.lock"), "").unwrap();
        std::fs::write(parent.path().join("somebody-elses"), "x").unwrap();
        let other = Spool::open(parent.path(), UNIT_BYTES).unwrap();
        assert!(living.folder.path().is_dir() && other.folder.path().is_dir());
        assert!(
            !names(parent.path())
                .iter()
                .any(|name| name.contains("dead"))
        );
        drop((living, other));
        assert_eq!(names(parent.path()), ["somebody-elses"]);
    }
}
