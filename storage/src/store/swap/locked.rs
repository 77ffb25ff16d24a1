//! The exchange in a folder of this machine: under a lock of the object's folder, which the system gives back when its
//! holder ends, however it ends. The file gets its name by a rename, so that readers need no lock.

use std::fs::{self, File, TryLockError};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use bytes::Bytes;
use contract::key::ObjectKey;

use super::Seen;
use crate::store::folder;

/// Between two looks at a lock that another process holds; an exchange takes milliseconds.
const PAUSE: Duration = Duration::from_millis(2);

/// See [`super::Store::swap`].
pub(super) async fn swap(
    root: PathBuf,
    key: ObjectKey,
    seen: Option<&Seen>,
    content: Bytes,
    lock_limit: Duration,
) -> Result<Option<Seen>, object_store::Error> {
    let seen = seen.cloned();
    blocking(key.clone(), move || {
        let path = root.join(key.as_str());
        let _lock = lock(&path, lock_limit)?;
        if held(&path)? != seen {
            return Ok(None);
        }
        folder::replace_now(&root, &path, &content)?;
        Ok(Some(Seen::of_digest(&content)))
    })
    .await
}

fn held(path: &Path) -> io::Result<Option<Seen>> {
    match fs::read(path) {
        Ok(content) => Ok(Some(Seen::of_digest(&content))),
        Err(e) if e.kind() == ErrorKind::NotFound => Ok(None),
        Err(e) => Err(e),
    }
}

/// Locks the folder of an object until the answer is dropped.
fn lock(path: &Path, lock_limit: Duration) -> io::Result<File> {
    let folder = path.parent().ok_or(ErrorKind::InvalidInput)?;
    fs::create_dir_all(folder)?;
    let file = File::open(folder)?;
    let start = Instant::now();
    loop {
        match file.try_lock() {
            Ok(()) => return Ok(file),
            Err(TryLockError::WouldBlock) if start.elapsed() < lock_limit => {
                std::thread::sleep(PAUSE);
            }
            Err(TryLockError::WouldBlock) => {
                return Err(io::Error::new(
                    ErrorKind::TimedOut,
                    format!(
                        "another process has held the lock of {} for {} s",
                        folder.display(),
                        lock_limit.as_secs()
                    ),
                ));
            }
            Err(TryLockError::Error(e)) => return Err(e),
        }
    }
}

async fn blocking<T: Send + 'static>(
    key: ObjectKey,
    work: impl FnOnce() -> io::Result<T> + Send + 'static,
) -> Result<T, object_store::Error> {
    match tokio::task::spawn_blocking(work).await {
        Ok(done) => done.map_err(|e| folder::failed(&key, e)),
        Err(e) => Err(e.into()),
    }
}
