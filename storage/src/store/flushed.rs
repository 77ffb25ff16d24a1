//! Folders of this machine whose names of files are flushed to the disk: each once for all who wait for it, and those above it once
//! in a process as long as they are the same folders.
//!
//! A name lasts once the folder that holds it is flushed after it was made, and that folder's own name, and so on up to the root of
//! the store. The last is so until somebody removes a folder: the next one of that path is another one, which its number tells,
//! since a folder that is held open keeps its own.

use std::collections::BTreeMap;
use std::fs::{self, File, Metadata};
use std::io;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, LazyLock, Mutex, MutexGuard, PoisonError};

/// Folders that are held open; a landing writes to some twelve. Tests count flushes of those that are held.
const MOST_HELD: usize = if cfg!(test) { 512 } else { 64 };

/// Of stores by their roots, folders by their paths.
type Held = BTreeMap<(PathBuf, PathBuf), Arc<Folder>>;

static HELD: LazyLock<Mutex<Held>> = LazyLock::new(Mutex::default);

/// A folder that is held open.
struct Folder {
    file: File,
    /// Device and number of it.
    identity: [u64; 2],
    /// Do its own name and those of all folders above it last?
    lasts: AtomicBool,
    flushes: Flushes,
}

/// Makes the name of a file that is there last, and those of the folders that it is in, up to a root.
///
/// # Errors
/// One of them cannot be flushed: whether the name lasts is not known.
pub(super) fn flush(root: &Path, path: &Path) -> io::Result<()> {
    let inside = |folder: &&Path| folder.starts_with(root);
    let mut made_to_last = vec![];
    for folder in path.ancestors().skip(1).take_while(inside) {
        let folder = held(root, folder)?;
        folder.flushes.wait(|| folder.file.sync_all())?;
        let did_last = folder.lasts.load(Ordering::Acquire);
        made_to_last.push(folder);
        if did_last {
            break;
        }
    }
    // Only now are the folders above flushed.
    for folder in made_to_last {
        folder.lasts.store(true, Ordering::Release);
    }
    Ok(())
}

/// The folder that is there now.
fn held(root: &Path, folder: &Path) -> io::Result<Arc<Folder>> {
    let key = (root.to_owned(), folder.to_owned());
    let now = identity(&fs::metadata(folder)?);
    if let Some(there) = all().get(&key).filter(|there| there.identity == now) {
        return Ok(Arc::clone(there));
    }
    let file = File::open(folder)?;
    let opened = Arc::new(Folder {
        identity: identity(&file.metadata()?),
        file,
        lasts: AtomicBool::new(false),
        flushes: Flushes::default(),
    });
    let mut held = all();
    if held.len() >= MOST_HELD {
        held.clear();
    }
    held.insert(key, Arc::clone(&opened));
    Ok(opened)
}

fn all() -> MutexGuard<'static, Held> {
    // A panic elsewhere leaves a map that is whole.
    HELD.lock().unwrap_or_else(PoisonError::into_inner)
}

fn identity(metadata: &Metadata) -> [u64; 2] {
    [metadata.dev(), metadata.ino()]
}

/// Flushes of one folder, of which one serves all who came before it began.
#[derive(Default)]
struct Flushes {
    turns: Mutex<Turns>,
    ended: Condvar,
}

/// Flushes have numbers from 1 on.
#[derive(Default)]
struct Turns {
    /// The last one that began.
    begun: u64,
    /// The last one that succeeded.
    done: u64,
    is_running: bool,
    /// Who waits for the one that is running to end.
    waiting: usize,
}

impl Flushes {
    /// Returns when a flush has succeeded that began after this was called: one's own, or that of somebody else who waits.
    fn wait(&self, flush: impl Fn() -> io::Result<()>) -> io::Result<()> {
        let mut turns = self.turns();
        // One that is under way may have begun before the caller's file had its name.
        let wanted = turns.begun + 1;
        while turns.done < wanted {
            if turns.is_running {
                turns.waiting += 1;
                let ended = self.ended.wait(turns);
                turns = ended.unwrap_or_else(PoisonError::into_inner);
                turns.waiting -= 1;
                continue;
            }
            turns.begun += 1;
            let own = turns.begun;
            turns.is_running = true;
            drop(turns);
            let flushed = flush();
            turns = self.turns();
            turns.is_running = false;
            if flushed.is_ok() {
                turns.done = own;
            }
            self.ended.notify_all();
            // Others try themselves.
            flushed?;
        }
        Ok(())
    }

    fn turns(&self) -> MutexGuard<'_, Turns> {
        self.turns.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use std::sync::atomic::AtomicUsize;
    use std::sync::mpsc;
    use std::time::{Duration, Instant};

    use super::*;

    /// How often each folder was flushed since it is held, from the file's on up to the root.
    pub(crate) fn counts(root: &Path, path: &Path) -> Vec<u64> {
        let folders = path.ancestors().skip(1);
        folders
            .take_while(|folder| folder.starts_with(root))
            .map(|folder| held(root, folder).unwrap().flushes.turns().begun)
            .collect()
    }

    #[test]
    fn folders_above_are_flushed_once_and_again_where_one_was_made_anew() {
        let root = tempfile::tempdir().unwrap();
        let root = root.path();
        let make = |name: &str| {
            let path = root.join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(&path, "content").unwrap();
            flush(root, &path).unwrap();
            counts(root, &path)
        };
        assert_eq!(make("a/b/one"), [1, 1, 1]);
        assert_eq!(make("a/b/two"), [2, 1, 1], "only where the name is");
        assert_eq!(make("a/c/one"), [1, 2, 1], "its folder is a new name");
        fs::remove_dir_all(root.join("a/b")).unwrap();
        assert_eq!(make("a/b/three"), [1, 3, 1], "its folder is another one");
        fs::remove_dir_all(root.join("a")).unwrap();
        assert_eq!(make("a/b/four"), [1, 1, 2]);
    }

    #[test]
    fn what_could_not_be_flushed_to_the_root_is_no_lasting_folder() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("a/b/one");
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        // A folder above that is gone: as if it could not be flushed.
        let above = root.path().join("a");
        let aside = root.path().join("aside");
        let own = held(root.path(), path.parent().unwrap()).unwrap();
        fs::rename(&above, &aside).unwrap();
        assert!(flush(root.path(), &path).is_err());
        fs::rename(&aside, &above).unwrap();
        assert!(!own.lasts.load(Ordering::Acquire));
        flush(root.path(), &path).unwrap();
        assert!(own.lasts.load(Ordering::Acquire));
    }

    /// A device in its place, which cannot be flushed.
    #[test]
    fn a_folder_lasts_only_when_those_above_it_are_flushed() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("a/b/one");
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, "content").unwrap();
        let above = root.path().join("a");
        let unwilling = Folder {
            file: File::open("/dev/null").unwrap(),
            identity: identity(&fs::metadata(&above).unwrap()),
            lasts: AtomicBool::new(false),
            flushes: Flushes::default(),
        };
        let key = (root.path().to_owned(), above);
        all().insert(key.clone(), Arc::new(unwilling));
        assert!(flush(root.path(), &path).is_err());
        let own = held(root.path(), path.parent().unwrap()).unwrap();
        assert_eq!(own.flushes.turns().done, 1, "it was flushed itself");
        assert!(!own.lasts.load(Ordering::Acquire));
        all().remove(&key);
        flush(root.path(), &path).unwrap();
        assert!(own.lasts.load(Ordering::Acquire));
    }

    #[test]
    fn one_flush_serves_all_who_waited_for_it_and_nobody_who_came_after_its_beginning() {
        const WAITING: usize = 5;
        let (flushes, ran) = (Arc::new(Flushes::default()), Arc::new(AtomicUsize::new(0)));
        let (release, held_up) = mpsc::sync_channel::<()>(1);
        let held_up = Arc::new(Mutex::new(held_up));
        let begin = || {
            let (flushes, ran) = (Arc::clone(&flushes), Arc::clone(&ran));
            let held_up = Arc::clone(&held_up);
            std::thread::Builder::new()
                .spawn(move || {
                    flushes.wait(|| {
                        // The first one takes until it is let go.
                        if ran.fetch_add(1, Ordering::SeqCst) == 0 {
                            held_up.lock().unwrap().recv().unwrap();
                        }
                        Ok(())
                    })
                })
                .unwrap()
        };
        let wait_for = |is_so: &dyn Fn() -> bool| {
            let limit = Instant::now() + Duration::from_secs(30);
            while !is_so() {
                assert!(Instant::now() < limit, "it did not come");
                std::thread::yield_now();
            }
        };
        let first = begin();
        wait_for(&|| ran.load(Ordering::SeqCst) == 1);
        let waiting: Vec<_> = (0..WAITING).map(|_| begin()).collect();
        wait_for(&|| flushes.turns().waiting == WAITING);
        release.send(()).unwrap();
        first.join().unwrap().unwrap();
        for one in waiting {
            one.join().unwrap().unwrap();
        }
        // What began before a name was there does not hold it.
        assert_eq!(ran.load(Ordering::SeqCst), 2);
    }

    /// While a first one runs two come, of whom one makes the next flush, which fails: that is no flush of the other one's.
    #[test]
    fn who_waited_for_a_flush_that_failed_makes_one_again() {
        let (flushes, ran) = (Arc::new(Flushes::default()), Arc::new(AtomicUsize::new(0)));
        let begin = || {
            let (flushes, ran) = (Arc::clone(&flushes), Arc::clone(&ran));
            let limit = Instant::now() + Duration::from_secs(30);
            let wait = move || {
                flushes.wait(|| match ran.fetch_add(1, Ordering::SeqCst) {
                    0 => {
                        while flushes.turns().waiting < 2 && Instant::now() < limit {
                            std::thread::yield_now();
                        }
                        Ok(())
                    }
                    1 => Err(io::Error::from(io::ErrorKind::StorageFull)),
                    _ => Ok(()),
                })
            };
            std::thread::Builder::new().spawn(wait).unwrap()
        };
        let all = [begin(), begin(), begin()].map(|one| one.join().unwrap());
        let failed = all.iter().filter(|one| one.is_err()).count();
        assert_eq!((failed, ran.load(Ordering::SeqCst)), (1, 3));
    }

    #[test]
    fn a_flush_that_fails_is_told_to_who_made_it_and_made_again_by_others() {
        let flushes = Flushes::default();
        let failing = || Err(io::Error::from(io::ErrorKind::StorageFull));
        assert!(flushes.wait(failing).is_err());
        let count = AtomicUsize::new(0);
        let counted = || {
            count.fetch_add(1, Ordering::SeqCst);
            Ok(())
        };
        flushes.wait(counted).unwrap();
        assert_eq!(count.load(Ordering::SeqCst), 1, "none had succeeded");
    }
}
