//! The event log of embedded mode: a file of JSON lines a topic, a small file a group of readers.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use async_trait::async_trait;
use contract::event::Event;

use super::EventLog;
use crate::StorageError;

/// How long a lock held by another process is waited for.
const LOCK_PATIENCE: Duration = Duration::from_secs(1);
const LOCK_PAUSE: Duration = Duration::from_millis(20);

/// A log in a folder, or in memory when it has none. One process at a time.
pub struct EmbeddedLog {
    folder: Option<PathBuf>,
    state: Mutex<State>,
}

/// What is in the files, kept in memory: an embedded log has thousands of events, not millions.
#[derive(Default)]
struct State {
    topics: BTreeMap<String, Vec<String>>,
    offsets: BTreeMap<String, u64>,
    /// Held for as long as the log is open, so that a second process is told instead of tearing lines.
    _lock: Option<File>,
}

impl EmbeddedLog {
    /// A log that is gone with the process.
    pub fn memory() -> Self {
        Self {
            folder: None,
            state: Mutex::default(),
        }
    }

    /// Opens the log in a folder. A last line cut short by a crash was never acknowledged and is dropped.
    pub fn open(folder: &Path) -> Result<Self, StorageError> {
        std::fs::create_dir_all(folder).map_err(|e| failed(folder, e))?;
        let lock_path = folder.join("lock");
        let lock = File::create(&lock_path).map_err(|e| failed(&lock_path, e))?;
        take_lock(&lock).map_err(|e| failed(&lock_path, e))?;
        let mut state = State {
            _lock: Some(lock),
            ..State::default()
        };
        for entry in std::fs::read_dir(folder).map_err(|e| failed(folder, e))? {
            let path = entry.map_err(|e| failed(folder, e))?.path();
            let name = |suffix| {
                let file = path.file_name().and_then(|name| name.to_str());
                file.and_then(|file| file.strip_suffix(suffix))
            };
            if let Some(topic) = name(".jsonl") {
                let lines = read_lines(&path).map_err(|e| failed(&path, e))?;
                state.topics.insert(topic.to_owned(), lines);
            } else if let Some(group) = name(".offset") {
                let text = std::fs::read_to_string(&path).map_err(|e| failed(&path, e))?;
                let next = text
                    .trim()
                    .parse()
                    .map_err(|e| StorageError::damaged(path.display().to_string(), e))?;
                state.offsets.insert(group.to_owned(), next);
            }
        }
        Ok(Self {
            folder: Some(folder.to_owned()),
            state: Mutex::new(state),
        })
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // A panic elsewhere cannot leave the state half changed: each change is one insertion.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[async_trait]
impl EventLog for EmbeddedLog {
    async fn append(&self, event: &Event) -> Result<u64, StorageError> {
        let topic = event.body.topic();
        let line = event.to_json();
        let mut state = self.state();
        if let Some(folder) = &self.folder {
            let path = folder.join(format!("{topic}.jsonl"));
            append_line(&path, &line).map_err(|e| failed(&path, e))?;
        }
        let lines = state.topics.entry(topic.to_owned()).or_default();
        lines.push(line);
        Ok(lines.len() as u64 - 1)
    }

    async fn read(
        &self,
        topic: &str,
        from: u64,
        max: usize,
    ) -> Result<Vec<(u64, Event)>, StorageError> {
        let state = self.state();
        let Some(lines) = state.topics.get(topic) else {
            return Ok(vec![]);
        };
        let numbered = lines.iter().enumerate().skip(from as usize).take(max);
        let event = |(offset, line): (usize, &String)| {
            let event = Event::from_json(line)
                .map_err(|e| StorageError::damaged(format!("{topic} event {offset}"), e))?;
            Ok((offset as u64, event))
        };
        numbered.map(event).collect()
    }

    async fn committed(&self, topic: &str, group: &str) -> Result<u64, StorageError> {
        let state = self.state();
        Ok(state
            .offsets
            .get(&format!("{topic}.{group}"))
            .copied()
            .unwrap_or(0))
    }

    async fn commit(&self, topic: &str, group: &str, next: u64) -> Result<(), StorageError> {
        let name = format!("{topic}.{group}");
        let mut state = self.state();
        if state.offsets.get(&name).is_some_and(|&now| now >= next) {
            return Ok(());
        }
        if let Some(folder) = &self.folder {
            let path = folder.join(format!("{name}.offset"));
            replace_file(&path, &next.to_string()).map_err(|e| failed(&path, e))?;
        }
        state.offsets.insert(name, next);
        Ok(())
    }
}

/// Takes the lock. A process that was just killed can hold it for some milliseconds more, so it is tried for a while.
fn take_lock(lock: &File) -> std::io::Result<()> {
    let start = Instant::now();
    loop {
        match lock.try_lock() {
            Ok(()) => return Ok(()),
            Err(TryLockError::Error(error)) => return Err(error),
            Err(TryLockError::WouldBlock) if start.elapsed() < LOCK_PATIENCE => {
                std::thread::sleep(LOCK_PAUSE);
            }
            Err(TryLockError::WouldBlock) => {
                return Err(std::io::Error::other(
                    "another fluxglobe process writes to this data folder; wait for it, stop it or give another --data",
                ));
            }
        }
    }
}

fn failed(path: &Path, source: std::io::Error) -> StorageError {
    StorageError::Log {
        path: path.display().to_string(),
        source,
    }
}

fn append_line(path: &Path, line: &str) -> std::io::Result<()> {
    let mut file = OpenOptions::new().create(true).append(true).open(path)?;
    file.write_all(format!("{line}\n").as_bytes())?;
    file.sync_data()
}

/// Writes beside and renames, so that a crash leaves the old or the new content.
fn replace_file(path: &Path, content: &str) -> std::io::Result<()> {
    let beside = path.with_extension("new");
    let mut file = File::create(&beside)?;
    file.write_all(content.as_bytes())?;
    file.sync_data()?;
    std::fs::rename(&beside, path)
}

/// Whole lines of a file; a last line without its end is cut off the file.
fn read_lines(path: &Path) -> std::io::Result<Vec<String>> {
    let mut reader = BufReader::new(File::open(path)?);
    let (mut lines, mut whole_bytes) = (vec![], 0);
    let mut line = String::new();
    while reader.read_line(&mut line)? > 0 {
        let Some(text) = line.strip_suffix('\n') else {
            break;
        };
        whole_bytes += line.len() as u64;
        lines.push(text.to_owned());
        line.clear();
    }
    if !line.is_empty() {
        OpenOptions::new()
            .write(true)
            .open(path)?
            .set_len(whole_bytes)?;
    }
    Ok(lines)
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::event::Body;

    fn notice(path: &str) -> Event {
        let body = Body::GranuleNotice {
            path: path.to_owned(),
            profile: None,
            product: None,
        };
        Event::new("t", body)
    }

    const TOPIC: &str = "granule.notice";

    #[tokio::test]
    async fn events_and_offsets_outlive_the_process() {
        let folder = tempfile::tempdir().unwrap();
        {
            let log = EmbeddedLog::open(folder.path()).unwrap();
            assert_eq!(log.append(&notice("a")).await.unwrap(), 0);
            assert_eq!(log.append(&notice("b")).await.unwrap(), 1);
            log.commit(TOPIC, "g", 1).await.unwrap();
        }
        let log = EmbeddedLog::open(folder.path()).unwrap();
        assert_eq!(log.committed(TOPIC, "g").await.unwrap(), 1);
        let rest = log.read(TOPIC, 1, 10).await.unwrap();
        assert_eq!(rest, [(1, notice("b"))]);
    }

    #[tokio::test]
    async fn an_offset_never_goes_back() {
        let log = EmbeddedLog::memory();
        log.commit(TOPIC, "g", 5).await.unwrap();
        log.commit(TOPIC, "g", 3).await.unwrap();
        assert_eq!(log.committed(TOPIC, "g").await.unwrap(), 5);
    }

    #[tokio::test]
    async fn a_line_cut_short_by_a_crash_is_dropped() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("granule.notice.jsonl");
        let whole = notice("a").to_json();
        std::fs::write(&path, format!("{whole}\n{{\"schema\":1,\"tr")).unwrap();
        let log = EmbeddedLog::open(folder.path()).unwrap();
        assert_eq!(log.append(&notice("b")).await.unwrap(), 1);
        let all = log.read(TOPIC, 0, 10).await.unwrap();
        assert_eq!(all, [(0, notice("a")), (1, notice("b"))]);
    }

    #[test]
    fn a_second_process_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let _first = EmbeddedLog::open(folder.path()).unwrap();
        let second = EmbeddedLog::open(folder.path());
        assert!(second.is_err_and(|e| e.to_string().contains("another fluxglobe process")));
    }
}
