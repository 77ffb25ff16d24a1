//! The embedded log's file: a line a step, so that what belongs together is written together.
//!
//! A line is the JSON of an [`Entry`] that ends in a member `crc32`: the CRC-32 (ISO 3309) of all of the file before that
//! member, in eight hexadecimal digits. So it vouches for its own line and for every one before it, also for those that were
//! written before lines had checks. No line without a check follows one with a check.

use std::collections::BTreeMap;
use std::fs::OpenOptions;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use contract::time::TimeMs;
use contract::topic::Topic;
use crc32fast::Hasher;
use serde::{Deserialize, Serialize};

use crate::StorageError;

/// Before the check of a line.
const MEMBER: &[u8] = b",\"crc32\":\"";
/// After it.
const MEMBER_END: &[u8] = b"\"}";
const HEX_BYTES: usize = 8;

/// Messages and offsets that became durable together.
#[derive(Debug, Default, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Entry {
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) messages: Vec<(Topic, String)>,
    /// When the messages came; never earlier than those before, whatever the clock says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) time: Option<TimeMs>,
    /// Offset to go on from, by `topic/group`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub(super) offsets: BTreeMap<String, u64>,
}

/// A file of entries.
#[derive(Debug)]
pub(super) struct Journal {
    path: PathBuf,
    /// Of all that is in the file.
    written: Hasher,
    written_bytes: u64,
}

impl Journal {
    /// Opens a file and reads its entries. A last line cut short by a crash was never acknowledged and is cut off.
    ///
    /// # Errors
    /// `Damaged` with the file and the entry if it does not hold what was written.
    pub(super) fn open(path: PathBuf) -> Result<(Self, Vec<Entry>), StorageError> {
        let JournalReader {
            entries,
            seen,
            seen_bytes,
            torn_bytes,
            ..
        } = JournalReader::of(&path)?.unwrap_or_default();
        if torn_bytes > 0 {
            let file = OpenOptions::new().write(true).open(&path);
            let cut = file.and_then(|file| file.set_len(seen_bytes));
            cut.map_err(|e| StorageError::log(path.display().to_string(), e))?;
        }
        let journal = Self {
            path,
            written: seen,
            written_bytes: seen_bytes,
        };
        Ok((journal, entries))
    }

    /// Reads a file that another process may be writing to, and changes nothing. How many entries it has; none if there is
    /// no file.
    ///
    /// # Errors
    /// As of [`Journal::open`].
    pub(super) fn check(path: &Path) -> Result<Option<usize>, StorageError> {
        Ok(JournalReader::of(path)?.map(|reading| reading.entries.len()))
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Appends an entry that holds something; on an error the file is as it was.
    pub(super) fn append(&mut self, entry: &Entry) -> std::io::Result<()> {
        let mut line = serde_json::to_vec(entry)?;
        line.pop();
        let mut written = self.written.clone();
        written.update(&line);
        let check = hex(&written);
        let rest = [MEMBER, check.as_bytes(), MEMBER_END, b"\n"].concat();
        written.update(&rest);
        line.extend(rest);
        let mut file = OpenOptions::new()
            .create(true)
            .append(true)
            .open(&self.path)?;
        let length = file.metadata()?.len();
        if length != self.written_bytes {
            let reason = format!(
                "it is {length} bytes long where {} were written: something else changed it; start this process again",
                self.written_bytes
            );
            return Err(std::io::Error::other(reason));
        }
        let done = file.write_all(&line).and_then(|()| file.sync_data());
        if done.is_err() {
            // A disk that is full took part of the line: what follows must not be glued to it.
            file.set_len(length)?;
        } else {
            self.written = written;
            self.written_bytes += line.len() as u64;
        }
        done
    }
}

/// What was read of a file, from its first line on.
#[derive(Default)]
struct JournalReader {
    entries: Vec<Entry>,
    /// Of all whole lines so far.
    seen: Hasher,
    seen_bytes: u64,
    /// Entries at the beginning that were written before there were checks.
    unchecked_count: usize,
    /// After the last whole line.
    torn_bytes: usize,
}

impl JournalReader {
    /// Reads a file; none if there is none.
    fn of(path: &Path) -> Result<Option<Self>, StorageError> {
        let content = match std::fs::read(path) {
            Ok(content) => content,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(e) => return Err(StorageError::log(path.display().to_string(), e)),
        };
        let mut reading = Self::default();
        for line in content.split_inclusive(|&byte| byte == b'\n') {
            let read = match line.strip_suffix(b"\n") {
                Some(text) => reading.add(text),
                None => reading.add_torn(line),
            };
            read.map_err(|reason| {
                let number = reading.entries.len() + 1;
                StorageError::damaged(format!("entry {number} of {}", path.display()), reason)
            })?;
        }
        Ok(Some(reading))
    }

    /// Adds a line that came without its end; if it is damaged, the reason.
    fn add(&mut self, line: &[u8]) -> Result<(), String> {
        let entry = self.entry(line)?;
        if checked_parts(line).is_none() {
            self.unchecked_count += 1;
        }
        self.seen.update(line);
        self.seen.update(b"\n");
        self.seen_bytes += line.len() as u64 + 1;
        self.entries.push(entry);
        Ok(())
    }

    /// What a whole line holds.
    fn entry(&self, line: &[u8]) -> Result<Entry, String> {
        let text = match checked_parts(line) {
            Some((before, told)) => {
                let mut seen = self.seen.clone();
                seen.update(before);
                if hex(&seen).as_bytes() != told {
                    return Err(self.differs());
                }
                [before, b"}"].concat()
            }
            None if self.unchecked_count < self.entries.len() => {
                return Err(advised("its check is gone"));
            }
            None => line.to_vec(),
        };
        serde_json::from_slice(&text).map_err(|e| advised(&e.to_string()))
    }

    /// What follows the last end of a line is the beginning of one that a crash cut short, unless it is a whole one whose
    /// end is another byte.
    fn add_torn(&mut self, tail: &[u8]) -> Result<(), String> {
        self.torn_bytes = tail.len();
        match tail.split_last() {
            Some((_, line)) if self.entry(line).is_ok() => {
                Err(advised("its line does not end where it must"))
            }
            _ => Ok(()),
        }
    }

    fn differs(&self) -> String {
        let is_first = self.unchecked_count > 0 && self.unchecked_count == self.entries.len();
        if is_first {
            let count = self.unchecked_count;
            return advised(&format!(
                "it, or one of the {count} before it that have no checks, is not what was written"
            ));
        }
        advised("it is not what was written")
    }
}

/// A reason, and what to do.
fn advised(reason: &str) -> String {
    format!(
        "{reason}; restore the file from a copy, or move it away: files that landed stay landed, notices that nobody \
         finished must be given again"
    )
}

/// What stands before the check of a line, and the check.
fn checked_parts(line: &[u8]) -> Option<(&[u8], &[u8])> {
    let rest = line.strip_suffix(MEMBER_END)?;
    let (rest, told) = rest.split_at_checked(rest.len().checked_sub(HEX_BYTES)?)?;
    Some((rest.strip_suffix(MEMBER)?, told))
}

fn hex(hasher: &Hasher) -> String {
    format!("{:08x}", hasher.clone().finalize())
}

#[cfg(test)]
mod tests;
