//! What is to be stored: bytes in memory, or a file of this process's own where all of it is too large to be held.

use std::fmt::{Debug, Formatter};
use std::fs::File;
use std::io::{self, Read};
use std::ops::Range;
use std::os::unix::fs::FileExt as _;
use std::sync::Arc;

use bytes::Bytes;
use contract::digest::Digest;
use contract::key::ObjectKey;
use contract::kind::Vouched;
use parquet::file::reader::{ChunkReader, Length};
use sha2::{Digest as _, Sha256};

/// Bytes of a file that are read at a time.
pub(crate) const PIECE_BYTES: u64 = 4 << 20;

/// What is to be stored.
#[derive(Clone)]
pub enum Content {
    /// All of it.
    Bytes(Bytes),
    /// A file, read piece by piece. Nobody may write to it meanwhile: what is named by its bytes is compared with its name as it
    /// is sent, and what is named by its values was hashed as it was written.
    File(Arc<File>, u64),
}

/// Shows what it is and how large, and none of it.
impl Debug for Content {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let kind = match self {
            Self::Bytes(_) => "Bytes",
            Self::File(..) => "File",
        };
        f.debug_tuple(kind).field(&self.size_bytes()).finish()
    }
}

impl Content {
    /// A file as it is now.
    ///
    /// # Errors
    /// It cannot be asked how large it is.
    pub fn of_file(file: File) -> io::Result<Self> {
        let size_bytes = file.metadata()?.len();
        Ok(Self::File(Arc::new(file), size_bytes))
    }

    /// Its size, bytes.
    pub fn size_bytes(&self) -> u64 {
        match self {
            Self::Bytes(bytes) => bytes.len() as u64,
            Self::File(_, size_bytes) => *size_bytes,
        }
    }

    /// Some of its bytes; an error if it has not so many.
    pub(crate) fn part(&self, range: Range<u64>) -> io::Result<Bytes> {
        let length = usize::try_from(range.end.saturating_sub(range.start));
        let length = length.map_err(|_too_long| io::Error::from(io::ErrorKind::OutOfMemory))?;
        match self {
            Self::Bytes(bytes) => {
                let start = usize::try_from(range.start).unwrap_or(usize::MAX);
                let end = start.saturating_add(length);
                if end > bytes.len() {
                    return Err(io::ErrorKind::UnexpectedEof.into());
                }
                Ok(bytes.slice(start..end))
            }
            Self::File(file, _) => {
                let mut part = vec![0; length];
                file.read_exact_at(&mut part, range.start)?;
                Ok(part.into())
            }
        }
    }

    /// All of it at once.
    pub(crate) fn whole(&self) -> io::Result<Bytes> {
        self.part(0..self.size_bytes())
    }

    /// Its pieces in their order, of at most so many bytes.
    pub(crate) fn pieces(&self, key: &ObjectKey, piece_bytes: u64) -> Pieces {
        let check = match (self, key.vouches()) {
            (Self::File(..), Vouched::Bytes(name)) => Some((Sha256::new(), name)),
            _ => None,
        };
        Pieces {
            content: self.clone(),
            piece_bytes,
            at: 0,
            check,
        }
    }
}

impl Length for Content {
    fn len(&self) -> u64 {
        self.size_bytes()
    }
}

/// So that a table is read from it piece by piece.
impl ChunkReader for Content {
    type T = Tail;

    fn get_read(&self, start: u64) -> parquet::errors::Result<Tail> {
        Ok(Tail {
            content: self.clone(),
            at: start,
        })
    }

    fn get_bytes(&self, start: u64, length: usize) -> parquet::errors::Result<Bytes> {
        Ok(self.part(start..start.saturating_add(length as u64))?)
    }
}

/// What comes from some place on.
pub struct Tail {
    content: Content,
    at: u64,
}

impl Read for Tail {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let left = self.content.size_bytes().saturating_sub(self.at);
        let count = left.min(into.len() as u64);
        let part = self.content.part(self.at..self.at + count)?;
        into[..part.len()].copy_from_slice(&part);
        self.at += count;
        Ok(part.len())
    }
}

impl From<Bytes> for Content {
    fn from(bytes: Bytes) -> Self {
        Self::Bytes(bytes)
    }
}

/// Content piece by piece. Of a file whose key names its bytes the last piece is given out only if all of them are those.
pub(crate) struct Pieces {
    content: Content,
    piece_bytes: u64,
    at: u64,
    check: Option<(Sha256, Digest)>,
}

impl Iterator for Pieces {
    type Item = io::Result<Bytes>;

    fn next(&mut self) -> Option<Self::Item> {
        let size_bytes = self.content.size_bytes();
        let end = size_bytes.min(self.at.saturating_add(self.piece_bytes.max(1)));
        if self.at == end {
            return None;
        }
        let piece = self.content.part(self.at..end);
        self.at = if piece.is_ok() { end } else { size_bytes };
        let (Ok(bytes), Some((hasher, name))) = (&piece, &mut self.check) else {
            return Some(piece);
        };
        hasher.update(bytes);
        if end == size_bytes && Digest::from_bytes(hasher.clone().finalize().into()) != *name {
            let reason = "the file changed while it was stored";
            return Some(Err(io::Error::new(io::ErrorKind::InvalidData, reason)));
        }
        Some(piece)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write as _;

    fn file(text: &[u8]) -> Content {
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(text).unwrap();
        Content::of_file(file).unwrap()
    }

    #[test]
    fn pieces_are_the_whole_and_a_file_of_other_bytes_than_its_name_has_no_last_one() {
        let text: Vec<u8> = (0..1000u32).map(|i| i as u8).collect();
        let product = "p".parse().unwrap();
        let key = ObjectKey::raw(&product, &Digest::of(&text));
        for content in [file(&text), Content::Bytes(text.clone().into())] {
            let pieces: Vec<Bytes> = content.pieces(&key, 300).map(Result::unwrap).collect();
            assert_eq!(pieces.len(), 4);
            assert_eq!(pieces.concat(), text);
            assert_eq!(content.whole().unwrap(), text);
            assert!(content.part(900..1001).is_err(), "it has not so many");
        }
        let mut other = text;
        other[500] ^= 1;
        let pieces: Vec<_> = file(&other).pieces(&key, 300).collect();
        assert!(pieces[..3].iter().all(Result::is_ok));
        assert!(
            pieces[3]
                .as_ref()
                .unwrap_err()
                .to_string()
                .contains("changed")
        );
    }
}
