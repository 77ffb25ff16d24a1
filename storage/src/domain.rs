//! The domain of a product: which cells hold data in some step. It is stored as a set of their numbers, compressed; what was
//! stored before as a byte a cell is read for ever.
//!
//! An object is 16 bytes, then the set in the portable form of Roaring bitmaps
//! (<https://github.com/RoaringBitmap/RoaringFormatSpec>), which libraries of many languages read: `FGDM`, the version of the
//! form (u32, 2) and how many cells the map has (u64), both with the lowest byte first. Equal sets have equal bytes.

mod cells;

use bytes::Bytes;
use contract::digest::Digest;
use contract::grid::MAX_CELLS;
use contract::key::ObjectKey;
use contract::kind::Vouched;
use contract::product::ProductId;
use futures::StreamExt as _;
use object_store::ObjectStoreExt as _;
use object_store::path::Path;
use roaring::RoaringBitmap;
use sha2::{Digest as _, Sha256};

use crate::off_thread::off_thread;
use crate::sound::damage;
use crate::store::failed;
use crate::{StorageError, Store};
pub use cells::Cells;

/// What an object of now begins with; one of before begins with a 0 or a 1.
const MAGIC: [u8; 4] = *b"FGDM";
/// The first form was a byte a cell, and said nothing of itself.
const VERSION: u32 = 2;
const HEAD_BYTES: usize = 16;

/// Numbers that a container of a Roaring bitmap is of, and the most bytes that one takes with what is said of it.
const CONTAINER_CELLS: u64 = 1 << 16;
const CONTAINER_BYTES: u64 = (8 << 10) + 16;
const SET_HEAD_BYTES: u64 = 16;

/// Stores a domain (`[row, col]`) under the digest of its bytes.
pub async fn write(
    store: &Store,
    product: &ProductId,
    cells: &[bool],
) -> Result<ObjectKey, StorageError> {
    write_cells(store, product, Cells::of(cells)).await
}

/// The same of cells that are held as a set.
pub async fn write_cells(
    store: &Store,
    product: &ProductId,
    cells: Cells,
) -> Result<ObjectKey, StorageError> {
    let made = off_thread(move || {
        let content = content(cells);
        Ok((Digest::of(&content), Bytes::from(content)))
    });
    let (digest, content) = made.await?;
    let key = ObjectKey::domain(product, &digest);
    store.put_new(&key, content).await?;
    Ok(key)
}

/// The bytes of a domain.
fn content(cells: Cells) -> Vec<u8> {
    let Cells { mut set, count } = cells;
    // Which form a container takes must not depend on the one that it had: from an array or bits, which its numbers decide,
    // it becomes runs where these are smaller.
    set.remove_run_compression();
    set.optimize();
    let mut content = Vec::with_capacity(HEAD_BYTES + set.serialized_size());
    content.extend(MAGIC);
    content.extend(VERSION.to_le_bytes());
    content.extend((count as u64).to_le_bytes());
    set.serialize_into(&mut content)
        .expect("memory takes all that is written");
    content
}

/// Reads a domain as a flag a cell: of a map that is small.
pub async fn read(store: &Store, key: &ObjectKey) -> Result<Vec<bool>, StorageError> {
    let cells = read_cells(store, key).await?;
    Ok(cells.flags(0..cells.map_count()))
}

/// Reads a domain, whose bytes must be those of its name, as it comes: one of before is no larger in memory than one of now.
pub async fn read_cells(store: &Store, key: &ObjectKey) -> Result<Cells, StorageError> {
    let found = store.object_store().get(&Path::from(key.as_str())).await;
    let found = found.map_err(|e| failed(key, e))?;
    let mut reading = Reading::Nothing;
    let mut hasher = Sha256::new();
    let mut pieces = found.into_stream();
    while let Some(piece) = pieces.next().await {
        let piece = piece.map_err(|e| failed(key, e))?;
        let taken = reading.take(&piece);
        taken.map_err(|reason| damage::found(key, reason))?;
        hasher.update(&piece);
    }
    let digest = Digest::from_bytes(hasher.finalize().into());
    if key.vouches() != Vouched::Bytes(digest) {
        return Err(damage::found(key, format!("its digest is {digest}")));
    }
    let read = reading.finish();
    read.map_err(|reason| damage::found(key, reason))
}

/// Are these the bytes of a domain?
pub(crate) fn check(key: &ObjectKey, content: &[u8]) -> Result<(), StorageError> {
    let mut reading = Reading::Nothing;
    let read = reading.take(content).and_then(|()| reading.finish());
    read.map(|_cells| ())
        .map_err(|reason| damage::found(key, reason))
}

/// A domain that comes piece by piece; what is wrong with it is told as a reason.
enum Reading {
    Nothing,
    /// As it was stored before: a byte a cell, 0 or 1.
    Flags(Cells),
    /// What came of an object of now.
    Packed(Vec<u8>),
}

impl Reading {
    fn take(&mut self, piece: &[u8]) -> Result<(), String> {
        if let (Self::Nothing, Some(first)) = (&*self, piece.first()) {
            *self = match first {
                0 | 1 => Self::Flags(Cells::none(0)),
                _ => Self::Packed(vec![]),
            };
        }
        match self {
            Self::Nothing => Ok(()),
            Self::Flags(cells) => {
                if piece.iter().any(|&byte| byte > 1) {
                    return Err("a byte is not 0 or 1".to_owned());
                }
                let first = cells.map_count();
                check_count((first + piece.len()) as u64)?;
                cells.count += piece.len();
                cells.add_where(first, piece, |byte| *byte == 1);
                Ok(())
            }
            Self::Packed(content) => {
                content.extend_from_slice(piece);
                let Some((head, set)) = content.split_first_chunk() else {
                    return Ok(());
                };
                let most_bytes = most_bytes(cell_count(head)?);
                if set.len() as u64 > most_bytes {
                    return Err(format!("its set has more than {most_bytes} bytes"));
                }
                Ok(())
            }
        }
    }

    fn finish(self) -> Result<Cells, String> {
        let content = match self {
            Self::Nothing => return Ok(Cells::none(0)),
            Self::Flags(cells) => return Ok(cells),
            Self::Packed(content) => content,
        };
        let (head, bytes) = content
            .split_first_chunk()
            .ok_or_else(|| format!("it ends after {} bytes", content.len()))?;
        let count = cell_count(head)?;
        let set = RoaringBitmap::deserialize_from(bytes);
        let set = set.map_err(|e| format!("its set cannot be read: {e}"))?;
        if let Some(last) = set.max().filter(|last| u64::from(*last) >= count) {
            return Err(format!("it holds cell {last} of a map of {count}"));
        }
        // The library takes numbers of containers and their places on trust, where others go by them.
        let mut again = Vec::with_capacity(bytes.len());
        set.serialize_into(&mut again)
            .expect("memory takes all that is written");
        if again != bytes {
            return Err("its set is not what it says of its parts".to_owned());
        }
        Ok(Cells {
            set,
            count: count as usize,
        })
    }
}

/// How many cells the map has, by the head of an object.
fn cell_count(head: &[u8; HEAD_BYTES]) -> Result<u64, String> {
    let number = |bytes: &[u8]| {
        let bytes = bytes.iter().rev();
        bytes.fold(0, |number, byte| number << 8 | u64::from(*byte))
    };
    if head[..4] != MAGIC {
        return Err("it does not begin as a domain does".to_owned());
    }
    let (version, count) = (number(&head[4..8]), number(&head[8..]));
    if version != u64::from(VERSION) {
        return Err(format!(
            "its form is of version {version}, and 1 and {VERSION} are read"
        ));
    }
    check_count(count)?;
    Ok(count)
}

fn check_count(count: u64) -> Result<(), String> {
    if count > MAX_CELLS {
        return Err(format!(
            "it is of more than the {MAX_CELLS} cells that a map may have"
        ));
    }
    Ok(())
}

/// Most bytes of a set over so many cells, all of whose containers are bits.
fn most_bytes(count: u64) -> u64 {
    SET_HEAD_BYTES + count.div_ceil(CONTAINER_CELLS) * CONTAINER_BYTES
}

#[cfg(test)]
mod tests;
