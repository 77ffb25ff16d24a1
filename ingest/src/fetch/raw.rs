//! A file that is here, held open: its name, size and digest, and whether it is still the same.

use std::fs::{File, Metadata};
use std::os::unix::fs::{FileExt as _, MetadataExt as _};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::SystemTime;

use bytes::Bytes;
use contract::digest::Digest;
use storage::content::Content;

use super::spool::Spooled;
use crate::error::IngestError;

/// Files up to this size are held while they are stored, bytes.
pub(crate) const HELD_BYTES: u64 = 64 << 20;

/// A file whose digest is known.
#[derive(Debug, Clone)]
pub(crate) struct RawGranule {
    /// Where the reader process opens it.
    pub(crate) path: PathBuf,
    /// Last part of the path, for people and patterns.
    pub(crate) file_name: String,
    pub(crate) size_bytes: u64,
    pub(crate) sha256: Digest,
    stamp: Stamp,
    held: Held,
}

/// What keeps the file where it is.
#[derive(Debug, Clone)]
pub(super) enum Held {
    /// Somebody else's file.
    Theirs(Arc<File>),
    /// Our copy, removed with the last clone.
    Spooled(Arc<Spooled>),
}

/// What changes when a file does.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Stamp {
    len: u64,
    modified: Option<SystemTime>,
    device: u64,
    inode: u64,
}

impl Stamp {
    pub(super) fn of(metadata: &Metadata) -> Self {
        Self {
            len: metadata.len(),
            modified: metadata.modified().ok(),
            device: metadata.dev(),
            inode: metadata.ino(),
        }
    }
}

impl RawGranule {
    pub(super) fn new(
        path: PathBuf,
        file_name: String,
        sha256: Digest,
        stamp: Stamp,
        held: Held,
    ) -> Self {
        Self {
            path,
            file_name,
            size_bytes: stamp.len,
            sha256,
            stamp,
            held,
        }
    }

    fn file(&self) -> &File {
        match &self.held {
            Held::Theirs(file) => file,
            Held::Spooled(spooled) => spooled.file(),
        }
    }

    /// The whole content. Of a small file it is read, and still the one of the digest; a larger one is compared with that as it
    /// is stored.
    pub(crate) async fn content(&self) -> Result<Content, IngestError> {
        if self.size_bytes > HELD_BYTES {
            let file = self.file().try_clone();
            let file = file.map_err(|_gone| IngestError::Changed {
                file: self.path.clone(),
            })?;
            return Ok(Content::File(Arc::new(file), self.size_bytes));
        }
        self.bytes().await.map(Content::Bytes)
    }

    /// All of it in memory, which is still the one of the digest.
    pub(crate) async fn bytes(&self) -> Result<Bytes, IngestError> {
        let own = self.clone();
        tokio::task::spawn_blocking(move || own.read()).await?
    }

    /// The first bytes, at most so many.
    pub(crate) async fn head(&self, bytes: usize) -> Result<Vec<u8>, IngestError> {
        let own = self.clone();
        let read = move || {
            let mut head = vec![0; own.size_bytes.min(bytes as u64) as usize];
            own.file().read_exact_at(&mut head, 0).map(|()| head)
        };
        let read = tokio::task::spawn_blocking(read).await?;
        read.map_err(|_cut_short| IngestError::Changed {
            file: self.path.clone(),
        })
    }

    fn read(&self) -> Result<Bytes, IngestError> {
        let changed = || IngestError::Changed {
            file: self.path.clone(),
        };
        let mut content = vec![0; self.size_bytes as usize];
        // At positions of its own: clones of this value share the file and may read at the same time.
        if let Err(error) = self.file().read_exact_at(&mut content, 0) {
            tracing::debug!(%error, "a file that was there cannot be read");
            return Err(changed());
        }
        if Digest::of(&content) == self.sha256 {
            Ok(content.into())
        } else {
            Err(changed())
        }
    }

    /// Fails if the file is no longer the one that was fetched: the reader process opens it by its path.
    pub(crate) fn check_unchanged(&self) -> Result<(), IngestError> {
        match std::fs::metadata(&self.path) {
            Ok(now) if Stamp::of(&now) == self.stamp => Ok(()),
            _ => Err(IngestError::Changed {
                file: self.path.clone(),
            }),
        }
    }
}
