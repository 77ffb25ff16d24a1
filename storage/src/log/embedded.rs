//! The event log of embedded mode: a journal in a folder, one partition a topic, one process at a time.

use std::collections::BTreeMap;
use std::fs::{File, TryLockError};
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use async_trait::async_trait;
use bytes::Bytes;
use contract::event::{Event, MAX_EVENT_BYTES};
use contract::time::TimeMs;
use contract::topic::{Origin, Topic};
use tokio::sync::Notify;

use super::journal::{Entry, Journal};
use super::{EventLog, Finished, Follower, LowWater, Message, Reader, Start};
use crate::StorageError;

/// How long a lock held by another process is waited for.
const LOCK_LIMIT: Duration = Duration::from_secs(1);
const LOCK_PAUSE: Duration = Duration::from_millis(20);
/// File of the log in its folder.
const JOURNAL: &str = "journal.jsonl";

/// A log in a folder, or in memory when it has none; clones share it.
#[derive(Clone)]
pub struct EmbeddedLog {
    shared: Arc<Shared>,
}

struct Shared {
    state: Mutex<State>,
    /// Rung when a message is appended or a reader leaves.
    news: Notify,
}

/// What is in the file, kept in memory: an embedded log has thousands of messages, not millions.
#[derive(Default)]
struct State {
    journal: Option<Journal>,
    topics: BTreeMap<Topic, Vec<Kept>>,
    /// When the newest message came.
    time: Option<TimeMs>,
    offsets: BTreeMap<String, u64>,
    /// Members of a group by their number; the first one reads, the others wait for it to leave.
    members: BTreeMap<String, Vec<u64>>,
    next_member: u64,
    /// Held for as long as the log is open, so that a second process is told instead of tearing lines.
    _lock: Option<File>,
}

/// A message and when it came.
type Kept = (Option<TimeMs>, Bytes);

impl EmbeddedLog {
    /// A log that is gone with the process.
    pub fn memory() -> Self {
        Self::with_state(State::default())
    }

    /// Opens the log in a folder.
    ///
    /// # Errors
    /// `Damaged` with the file and the entry if its journal does not hold what was written.
    pub fn open(folder: &Path) -> Result<Self, StorageError> {
        std::fs::create_dir_all(folder).map_err(|e| failed(folder, e))?;
        let lock_path = folder.join("lock");
        let lock = File::create(&lock_path).map_err(|e| failed(&lock_path, e))?;
        take_lock(&lock, folder)?;
        let (journal, entries) = Journal::open(folder.join(JOURNAL))?;
        let mut state = State {
            journal: Some(journal),
            _lock: Some(lock),
            ..State::default()
        };
        for entry in entries {
            state.apply(entry);
        }
        Ok(Self::with_state(state))
    }

    /// Reads the journal of the log in a folder, whoever writes to it now. How many entries it has; none if there is none.
    ///
    /// # Errors
    /// As of [`EmbeddedLog::open`].
    pub fn check(folder: &Path) -> Result<Option<usize>, StorageError> {
        Journal::check(&folder.join(JOURNAL))
    }

    fn with_state(state: State) -> Self {
        Self {
            shared: Arc::new(Shared {
                state: Mutex::new(state),
                news: Notify::new(),
            }),
        }
    }
}

impl Shared {
    fn state(&self) -> MutexGuard<'_, State> {
        // A panic elsewhere cannot leave the state half changed: each change is applied after it is durable.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn write(&self, mut entry: Entry) -> Result<(), StorageError> {
        if entry == Entry::default() {
            return Ok(());
        }
        let mut state = self.state();
        if !entry.messages.is_empty() {
            // A clock that was set back must not make a later message look older.
            entry.time = now().max(state.time);
        }
        if let Some(journal) = &mut state.journal {
            let done = journal.append(&entry);
            done.map_err(|e| failed(journal.path(), e))?;
        }
        state.apply(entry);
        drop(state);
        self.news.notify_waiters();
        Ok(())
    }

    /// Waits until `look` finds something, no longer than `wait`.
    async fn wait_for(
        &self,
        wait: Duration,
        mut look: impl FnMut(&mut State) -> Vec<Message> + Send,
    ) -> Vec<Message> {
        let until = tokio::time::Instant::now() + wait;
        loop {
            let news = self.news.notified();
            tokio::pin!(news);
            // Registered before looking, so that nothing appended in between is slept through.
            news.as_mut().enable();
            let found = look(&mut self.state());
            let is_over = !found.is_empty() || wait.is_zero();
            if is_over || tokio::time::timeout_at(until, news).await.is_err() {
                return found;
            }
        }
    }
}

impl State {
    fn apply(&mut self, entry: Entry) {
        let time = entry.time;
        for (topic, text) in entry.messages {
            let kept = (time, Bytes::from(text));
            self.topics.entry(topic).or_default().push(kept);
        }
        self.time = time.max(self.time);
        self.offsets.extend(entry.offsets);
    }

    fn read(&self, topic: Topic, from: u64, max: usize) -> Vec<Message> {
        let all = self.topics.get(&topic).map_or(&[][..], Vec::as_slice);
        let numbered = all.iter().enumerate().skip(from as usize).take(max);
        let message = |(offset, (time, content)): (usize, &Kept)| Message {
            origin: origin(topic, offset as u64),
            content: content.clone(),
            time: *time,
        };
        numbered.map(message).collect()
    }

    fn len(&self, topic: Topic) -> u64 {
        self.topics.get(&topic).map_or(0, Vec::len) as u64
    }
}

#[async_trait]
impl EventLog for EmbeddedLog {
    async fn append(&self, events: &[Event]) -> Result<(), StorageError> {
        self.shared.write(Entry {
            messages: lines(events)?,
            ..Entry::default()
        })
    }

    async fn append_message(
        &self,
        topic: Topic,
        _key: &str,
        content: Bytes,
    ) -> Result<(), StorageError> {
        check_length(topic, content.len())?;
        let text = String::from_utf8(content.to_vec())
            .map_err(|e| StorageError::damaged(format!("message for {topic}"), e))?;
        self.shared.write(Entry {
            messages: vec![(topic, text)],
            ..Entry::default()
        })
    }

    async fn join(&self, topic: Topic, group: &str) -> Result<Box<dyn Reader>, StorageError> {
        let group = format!("{topic}/{group}");
        let mut state = self.shared.state();
        state.next_member += 1;
        let member = state.next_member;
        state.members.entry(group.clone()).or_default().push(member);
        Ok(Box::new(EmbeddedReader {
            shared: Arc::clone(&self.shared),
            topic,
            group,
            member,
            at: None,
            water: LowWater::default(),
        }))
    }

    async fn follow(&self, topic: Topic, start: Start) -> Result<Box<dyn Follower>, StorageError> {
        let at = match start {
            Start::Oldest => 0,
            Start::Now => self.shared.state().len(topic),
        };
        Ok(Box::new(EmbeddedFollower {
            shared: Arc::clone(&self.shared),
            topic,
            at,
        }))
    }

    fn end_wait(&self) -> Duration {
        Duration::ZERO
    }

    async fn message(&self, origin: Origin) -> Result<Option<Message>, StorageError> {
        if origin.partition != 0 {
            return Ok(None);
        }
        let found = self.shared.state().read(origin.topic, origin.offset, 1);
        Ok(found.into_iter().next())
    }

    async fn lag(&self, topic: Topic, group: &str) -> Result<u64, StorageError> {
        let state = self.shared.state();
        let next = state
            .offsets
            .get(&format!("{topic}/{group}"))
            .copied()
            .unwrap_or(0);
        Ok(state.len(topic).saturating_sub(next))
    }

    async fn ready(&self) -> Result<(), StorageError> {
        Ok(())
    }
}

struct EmbeddedReader {
    shared: Arc<Shared>,
    topic: Topic,
    /// `topic/group`.
    group: String,
    member: u64,
    /// Where to read on; the group's offset until something was delivered, and again after an error.
    at: Option<u64>,
    water: LowWater,
}

#[async_trait]
impl Reader for EmbeddedReader {
    async fn next(&mut self, max: usize, wait: Duration) -> Result<Vec<Message>, StorageError> {
        let (topic, group, member, at) = (self.topic, &self.group, self.member, self.at);
        let look = |state: &mut State| {
            let first = state.members.get(group).and_then(|members| members.first());
            if first != Some(&member) {
                return vec![];
            }
            let from = at.unwrap_or_else(|| state.offsets.get(group).copied().unwrap_or(0));
            state.read(topic, from, max)
        };
        let found = self.shared.wait_for(wait, look).await;
        for message in &found {
            self.water.delivered(message.origin);
            self.at = Some(message.origin.offset + 1);
        }
        Ok(found)
    }

    async fn finish(&mut self, done: Vec<Finished>) -> Result<(), StorageError> {
        // Before anything is noted: what is too long would hold up whatever is finished after it.
        for event in done.iter().flat_map(|finished| &finished.follows) {
            check_length(event.body.topic(), event.to_json().len())?;
        }
        for finished in done {
            self.water.finish(finished);
        }
        let ready = self.water.take_ready();
        if ready.next.is_empty() {
            return Ok(());
        }
        let offsets = ready
            .next
            .values()
            .map(|next| (self.group.clone(), *next))
            .collect();
        let written = self.shared.write(Entry {
            messages: lines(&ready.events)?,
            offsets,
            ..Entry::default()
        });
        if written.is_err() {
            self.at = None;
            self.water = LowWater::default();
        }
        written
    }

    async fn leave(self: Box<Self>) -> Result<(), StorageError> {
        Ok(())
    }
}

impl Drop for EmbeddedReader {
    fn drop(&mut self) {
        if let Some(members) = self.shared.state().members.get_mut(&self.group) {
            members.retain(|member| *member != self.member);
        }
        self.shared.news.notify_waiters();
    }
}

struct EmbeddedFollower {
    shared: Arc<Shared>,
    topic: Topic,
    at: u64,
}

#[async_trait]
impl Follower for EmbeddedFollower {
    async fn next(&mut self, max: usize, wait: Duration) -> Result<Vec<Message>, StorageError> {
        let (topic, at) = (self.topic, self.at);
        let found = self
            .shared
            .wait_for(wait, |state| state.read(topic, at, max))
            .await;
        self.at += found.len() as u64;
        Ok(found)
    }
}

fn lines(events: &[Event]) -> Result<Vec<(Topic, String)>, StorageError> {
    let line = |event: &Event| {
        let (topic, text) = (event.body.topic(), event.to_json());
        check_length(topic, text.len()).map(|()| (topic, text))
    };
    events.iter().map(line).collect()
}

/// Every log refuses what is longer, so that an event that passes one passes all.
fn check_length(topic: Topic, bytes: usize) -> Result<(), StorageError> {
    if bytes <= MAX_EVENT_BYTES {
        return Ok(());
    }
    let reason = format!("it is longer than {MAX_EVENT_BYTES} bytes");
    Err(StorageError::damaged(
        format!("message for {topic}"),
        reason,
    ))
}

/// The instant now; none on a clock that stands outside the years that instants have.
fn now() -> Option<TimeMs> {
    TimeMs::new(chrono::Utc::now().timestamp_millis()).ok()
}

fn origin(topic: Topic, offset: u64) -> Origin {
    Origin {
        topic,
        partition: 0,
        offset,
    }
}

/// Takes the lock. A process that was just killed can hold it for some milliseconds more, so it is tried for a while.
fn take_lock(lock: &File, folder: &Path) -> Result<(), StorageError> {
    let start = Instant::now();
    loop {
        match lock.try_lock() {
            Ok(()) => return Ok(()),
            Err(TryLockError::Error(error)) => return Err(failed(folder, error)),
            Err(TryLockError::WouldBlock) if start.elapsed() < LOCK_LIMIT => {
                std::thread::sleep(LOCK_PAUSE);
            }
            Err(TryLockError::WouldBlock) => {
                let reason = "another fluxglobe process writes to this data folder; wait for it, stop it or give another --data";
                return Err(failed(folder, std::io::Error::other(reason)));
            }
        }
    }
}

fn failed(path: &Path, source: std::io::Error) -> StorageError {
    StorageError::log(path.display().to_string(), source)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::contents;
    use contract::event::Body;
    use futures::FutureExt as _;

    fn notice(path: &str) -> Event {
        let body = Body::GranuleNotice {
            path: path.to_owned(),
            profile: None,
            product: None,
            variable: None,
            indexes: vec![],
            sha256: None,
            size_bytes: None,
            attempt: 1,
        };
        Event::new("t", body)
    }

    const TOPIC: Topic = Topic::GranuleNotice;

    async fn read(log: &EmbeddedLog, group: &str) -> Vec<Event> {
        let mut reader = log.join(TOPIC, group).await.unwrap();
        let messages = reader.next(10, Duration::ZERO).await.unwrap();
        messages
            .iter()
            .map(|message| message.event().unwrap())
            .collect()
    }

    #[tokio::test]
    async fn events_and_offsets_outlive_the_process() {
        let folder = tempfile::tempdir().unwrap();
        {
            let log = EmbeddedLog::open(folder.path()).unwrap();
            log.append(&[notice("a"), notice("b")]).await.unwrap();
            let mut reader = log.join(TOPIC, "g").await.unwrap();
            let first = reader.next(1, Duration::ZERO).await.unwrap().remove(0);
            reader
                .finish(vec![Finished {
                    origin: first.origin,
                    follows: vec![],
                }])
                .await
                .unwrap();
        }
        let log = EmbeddedLog::open(folder.path()).unwrap();
        assert_eq!(read(&log, "g").await, [notice("b")]);
        assert_eq!(log.lag(TOPIC, "g").await.unwrap(), 1);
    }

    #[tokio::test]
    async fn all_messages_are_had_without_waiting_for_more() {
        let folder = tempfile::tempdir().unwrap();
        let log = EmbeddedLog::open(folder.path()).unwrap();
        let many: Vec<Event> = (0..300).map(|at| notice(&at.to_string())).collect();
        log.append(&many).await.unwrap();
        let all = contents(&log, TOPIC).now_or_never();
        let all = all.expect("nobody else appends").unwrap();
        assert!(all.iter().map(|it| it.event().unwrap()).eq(many));
        let none = contents(&log, Topic::RenderDone).now_or_never();
        assert!(none.is_some_and(|none| none.unwrap().is_empty()));
    }

    #[tokio::test]
    async fn a_line_cut_short_by_a_crash_is_dropped() {
        let folder = tempfile::tempdir().unwrap();
        EmbeddedLog::open(folder.path())
            .unwrap()
            .append(&[notice("a")])
            .await
            .unwrap();
        let path = folder.path().join("journal.jsonl");
        let mut bytes = std::fs::read(&path).unwrap();
        bytes.extend_from_slice(b"{\"messages\":[[\"granule.no");
        std::fs::write(&path, bytes).unwrap();
        let log = EmbeddedLog::open(folder.path()).unwrap();
        log.append(&[notice("b")]).await.unwrap();
        assert_eq!(read(&log, "g").await, [notice("a"), notice("b")]);
    }

    #[tokio::test]
    async fn a_flipped_bit_of_the_journal_is_named_and_no_other_message() {
        let folder = tempfile::tempdir().unwrap();
        let log = EmbeddedLog::open(folder.path()).unwrap();
        log.append(&[notice("a")]).await.unwrap();
        log.append(&[]).await.unwrap();
        log.append(&[notice("b")]).await.unwrap();
        drop(log);
        let path = folder.path().join("journal.jsonl");
        let whole = std::fs::read_to_string(&path).unwrap();
        std::fs::write(
            &path,
            whole.replacen(r#"\"path\":\"b\""#, r#"\"path\":\"c\""#, 1),
        )
        .unwrap();
        let error = EmbeddedLog::check(folder.path()).unwrap_err();
        assert!(error.to_string().contains("entry 2 of"), "{error}");
        let error = EmbeddedLog::open(folder.path()).err().unwrap();
        let text = error.to_string();
        assert!(
            text.contains("entry 2 of") && text.contains("journal.jsonl"),
            "{text}"
        );
        assert!(!error.is_retryable());
    }

    /// A clock that is set back makes no later message look older, also not after a restart.
    #[tokio::test]
    async fn messages_have_times_that_never_go_back() {
        let folder = tempfile::tempdir().unwrap();
        let late = "2990-01-01T00:00:00Z";
        let line = |time: &str| {
            let text = notice("a").to_json().replace('"', "\\\"");
            format!("{{\"messages\":[[\"granule.notice\",\"{text}\"]]{time}}}\n")
        };
        let journal = line("") + &line(&format!(",\"time\":\"{late}\""));
        std::fs::write(folder.path().join("journal.jsonl"), journal).unwrap();
        let log = EmbeddedLog::open(folder.path()).unwrap();
        log.append(&[notice("b")]).await.unwrap();
        let mut reader = log.join(TOPIC, "g").await.unwrap();
        let messages = reader.next(9, Duration::ZERO).await.unwrap();
        let times: Vec<_> = messages.iter().map(|message| message.time).collect();
        let late = Some(late.parse().unwrap());
        assert_eq!(times, [None, late, late]);
    }

    #[test]
    fn a_second_process_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let _first = EmbeddedLog::open(folder.path()).unwrap();
        let second = EmbeddedLog::open(folder.path());
        assert!(second.is_err_and(|e| e.to_string().contains("another fluxglobe process")));
    }
}
