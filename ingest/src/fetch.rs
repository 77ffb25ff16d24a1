//! Path in, [`RawGranule`] out: the bytes of the file and their digest.

use std::path::{Path, PathBuf};
use std::time::SystemTime;

use bytes::Bytes;
use contract::digest::Digest;
use contract::event::RejectReason;

use crate::error::{IngestError, Stop};
use crate::rejection::Rejection;
use crate::settings::Limits;

/// A file whose bytes are known.
#[derive(Debug, Clone)]
pub(crate) struct RawGranule {
    pub(crate) path: PathBuf,
    /// Last part of the path, for people and patterns.
    pub(crate) file_name: String,
    pub(crate) bytes: Bytes,
    pub(crate) sha256: Digest,
    stamp: Stamp,
}

/// What changes when a file does.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Stamp {
    len: u64,
    modified: Option<SystemTime>,
}

/// Reads a file whole.
pub(crate) async fn run(path: &Path, limits: Limits) -> Result<RawGranule, Stop> {
    let path = path.to_owned();
    tokio::task::spawn_blocking(move || read(&path, limits)).await?
}

fn read(path: &Path, limits: Limits) -> Result<RawGranule, Stop> {
    let unreadable = |e: std::io::Error| {
        Rejection::new(
            RejectReason::Unreadable,
            "file",
            format!("cannot be read: {e}"),
        )
    };
    let metadata = std::fs::metadata(path).map_err(unreadable)?;
    if !metadata.is_file() {
        return Err(Rejection::new(
            RejectReason::Unreadable,
            "file",
            "is no regular file; give a file",
        )
        .into());
    }
    if metadata.len() > limits.file_bytes {
        let detail = format!(
            "has {} bytes, at most {} are read; give it in smaller pieces",
            metadata.len(),
            limits.file_bytes
        );
        return Err(Rejection::new(RejectReason::TooLarge, "file", detail).into());
    }
    let stamp = stamp(path).map_err(unreadable)?;
    let bytes = Bytes::from(std::fs::read(path).map_err(unreadable)?);
    let file_name = path
        .file_name()
        .unwrap_or(path.as_os_str())
        .to_string_lossy()
        .into_owned();
    Ok(RawGranule {
        path: path.to_owned(),
        file_name,
        sha256: Digest::of(&bytes),
        bytes,
        stamp,
    })
}

fn stamp(path: &Path) -> std::io::Result<Stamp> {
    let metadata = std::fs::metadata(path)?;
    Ok(Stamp {
        len: metadata.len(),
        modified: metadata.modified().ok(),
    })
}

impl RawGranule {
    /// Fails if the file is no longer the one that was fetched: the reader process opens it by its path.
    pub(crate) fn check_unchanged(&self) -> Result<(), IngestError> {
        match stamp(&self.path) {
            Ok(now) if now == self.stamp && now.len == self.bytes.len() as u64 => Ok(()),
            _ => Err(IngestError::Changed {
                file: self.path.clone(),
            }),
        }
    }
}
