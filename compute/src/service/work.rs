//! Where an executor keeps intermediate results: a folder for each life of an executor, locked while it lives.

use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use crate::ComputeError;

/// The folder of one life of an executor; it goes with the process, or with the next executor that finds it unlocked.
#[derive(Debug)]
pub(super) struct WorkFolder {
    folder: PathBuf,
    lock_path: PathBuf,
    /// Held as long as the process lives, even if it is killed.
    _lock: File,
}

const LOCK: &str = "lock";

impl WorkFolder {
    /// Makes a folder for an executor under a root that others may share, and removes those that dead ones left. Their
    /// names are returned: nobody else will tell the scheduler that they are gone.
    pub(super) fn make(
        root: &Path,
        executor_id: &str,
    ) -> Result<(Self, Vec<String>), ComputeError> {
        let failed =
            |path: &Path| ComputeError::machine(format!("executor work folder {}", path.display()));
        fs::create_dir_all(root).map_err(failed(root))?;
        let gone = clear_dead(root).map_err(failed(root))?;
        let folder = root.join(executor_id);
        fs::create_dir_all(&folder).map_err(failed(&folder))?;
        let lock_path = root.join(format!("{executor_id}.{LOCK}"));
        let lock = File::create(&lock_path).map_err(failed(&lock_path))?;
        lock.lock().map_err(failed(&lock_path))?;
        let work = Self {
            folder,
            lock_path,
            _lock: lock,
        };
        Ok((work, gone))
    }

    pub(super) fn path(&self) -> &Path {
        &self.folder
    }

    /// Bytes in it, and removal of queries' folders that nobody wrote to for so long. What goes wrong is left for the
    /// next time: others write and remove at the same time.
    pub(super) fn tidy(&self, older_than: Duration) -> u64 {
        let mut total_bytes = 0;
        for entry in fs::read_dir(&self.folder).into_iter().flatten().flatten() {
            let (size_bytes, newest) = usage(&entry.path());
            let age = newest.and_then(|newest| SystemTime::now().duration_since(newest).ok());
            if age.is_some_and(|age| age > older_than) {
                tracing::info!(job = ?entry.file_name(), "removing forgotten intermediate results");
                if let Err(error) = fs::remove_dir_all(entry.path()) {
                    tracing::debug!(%error, "left for later");
                }
            } else {
                total_bytes += size_bytes;
            }
        }
        total_bytes
    }
}

impl Drop for WorkFolder {
    fn drop(&mut self) {
        let removed =
            fs::remove_dir_all(&self.folder).and_then(|()| fs::remove_file(&self.lock_path));
        if let Err(error) = removed {
            tracing::warn!(folder = %self.folder.display(), %error, "left for the next executor");
        }
    }
}

/// Removes the folders whose lock nobody holds.
fn clear_dead(root: &Path) -> std::io::Result<Vec<String>> {
    let mut gone = vec![];
    for entry in fs::read_dir(root)? {
        let path = entry?.path();
        let (Some(name), true) = (
            path.file_stem().and_then(|name| name.to_str()),
            path.extension().is_some_and(|extension| extension == LOCK),
        ) else {
            continue;
        };
        // Another executor may have removed it since.
        let Ok(lock) = File::open(&path) else {
            continue;
        };
        match lock.try_lock() {
            Ok(()) => {
                let folder = root.join(name);
                if folder.is_dir() {
                    fs::remove_dir_all(folder)?;
                }
                fs::remove_file(&path)?;
                gone.push(name.to_owned());
            }
            Err(TryLockError::WouldBlock) => {}
            Err(TryLockError::Error(error)) => return Err(error),
        }
    }
    gone.sort();
    Ok(gone)
}

/// Bytes under a path, and when the newest of it was written.
fn usage(path: &Path) -> (u64, Option<SystemTime>) {
    let Ok(meta) = fs::symlink_metadata(path) else {
        return (0, None);
    };
    let (mut size_bytes, mut newest) = (meta.len(), meta.modified().ok());
    if meta.is_dir() {
        for entry in fs::read_dir(path).into_iter().flatten().flatten() {
            let (inner_bytes, inner_newest) = usage(&entry.path());
            size_bytes += inner_bytes;
            newest = newest.max(inner_newest);
        }
    }
    (size_bytes, newest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_dead_executor_left_goes_and_what_a_living_one_has_stays() {
        let root = tempfile::tempdir().unwrap();
        let (living, gone) = WorkFolder::make(root.path(), "living").unwrap();
        assert!(gone.is_empty());
        fs::write(living.path().join("result"), "x").unwrap();
        // Dead: a lock file that nobody holds.
        fs::create_dir(root.path().join("dead")).unwrap();
        fs::write(root.path().join("dead/result"), "x").unwrap();
        fs::write(root.path().join("dead.lock"), "").unwrap();
        let (second, gone) = WorkFolder::make(root.path(), "second").unwrap();
        assert_eq!(gone, ["dead"]);
        assert!(!root.path().join("dead").exists());
        assert!(living.path().join("result").exists());
        drop((living, second));
        assert_eq!(fs::read_dir(root.path()).unwrap().count(), 0);
    }

    #[test]
    fn only_what_nobody_wrote_to_for_long_is_forgotten() {
        let root = tempfile::tempdir().unwrap();
        let (work, _gone) = WorkFolder::make(root.path(), "a").unwrap();
        fs::create_dir(work.path().join("job")).unwrap();
        fs::write(work.path().join("job/part"), vec![0; 5000]).unwrap();
        assert!(work.tidy(Duration::from_hours(1)) >= 5000);
        assert!(work.path().join("job/part").exists());
        std::thread::sleep(Duration::from_millis(20));
        assert_eq!(work.tidy(Duration::from_millis(1)), 0);
        assert!(!work.path().join("job").exists());
    }
}
