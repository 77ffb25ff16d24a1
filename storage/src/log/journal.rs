//! The embedded log's file: a line a step, so that what belongs together is written together.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};

use contract::time::TimeMs;
use contract::topic::Topic;
use serde::{Deserialize, Serialize};

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
}

impl Journal {
    /// Opens a file and reads its entries. A last line cut short by a crash was never acknowledged and is cut off.
    pub(super) fn open(path: PathBuf) -> std::io::Result<(Self, Vec<Entry>)> {
        let entries = if path.exists() { read(&path)? } else { vec![] };
        Ok((Self { path }, entries))
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Appends an entry; on an error the file is as it was.
    pub(super) fn append(&self, entry: &Entry) -> std::io::Result<()> {
        let mut line = serde_json::to_vec(entry)?;
        line.push(b'\n');
        let mut file = OpenOptions::new()
            .create(true)
            .append(true)
            .open(&self.path)?;
        let length = file.metadata()?.len();
        let written = file.write_all(&line).and_then(|()| file.sync_data());
        if written.is_err() {
            // A disk that is full took part of the line: what follows must not be glued to it.
            file.set_len(length)?;
        }
        written
    }
}

fn read(path: &Path) -> std::io::Result<Vec<Entry>> {
    let mut reader = BufReader::new(File::open(path)?);
    let (mut entries, mut whole_bytes, mut line) = (vec![], 0, String::new());
    while reader.read_line(&mut line)? > 0 {
        let Some(text) = line.strip_suffix('\n') else {
            break;
        };
        entries.push(serde_json::from_str(text)?);
        whole_bytes += line.len() as u64;
        line.clear();
    }
    if !line.is_empty() {
        OpenOptions::new()
            .write(true)
            .open(path)?
            .set_len(whole_bytes)?;
    }
    Ok(entries)
}
