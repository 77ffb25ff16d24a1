//! Is a stored object what its name and its own seal say?
//!
//! Input files, domains and observations are named by the digest of their bytes. Fields and series are named by the
//! digest of their values and hold a seal over their bytes; so do documents, weights and exact sums, whose names say what
//! they were made from, and what names the parts of a cube; its chunks end in a checksum. Pictures hold a check of every part, as PNG has it. Whatever is read whole is checked each time;
//! what is read in parts is checked row by row ([`crate::row_check`]).

pub mod cube;
pub mod damage;
pub(crate) mod large;
mod object;
mod png;
pub mod seal;

use bytes::Bytes;
use contract::digest::Digest;
use contract::key::ObjectKey;
use contract::kind::{Kind, Vouched};
use serde::Deserialize;

use crate::StorageError;
use crate::attached_mark::is_attached;
use crate::content::{Content, PIECE_BYTES};
use crate::off_thread::off_thread;
use seal::{PARQUET_END_BYTES, Seal, SealCheck};
use sha2::{Digest as _, Sha256};

pub use object::of_object;

/// Kinds that are JSON documents, sealed or of before that.
const DOCUMENTS: [Kind; 10] = [
    Kind::Manifest,
    Kind::ManifestPage,
    Kind::Newest,
    Kind::Pin,
    Kind::Sums,
    Kind::ObservationIndex,
    Kind::ObservationFile,
    Kind::Reading,
    Kind::Check,
    Kind::Protocol,
];

/// Version of a document's schema from which it is sealed.
const SEALED_SCHEMA: u32 = 2;
const BROKEN: &str = "its bytes are not those that were sealed";
const UNSEALED: &str = "its seal is gone";
/// Content above this is hashed on a thread that may take its time.
const SMALL_BYTES: usize = 1 << 20;

/// What is known of an object that is not damaged.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Soundness {
    /// It is what its name or its seal says.
    Sound,
    /// Nothing says what it should be: it was stored before objects of its kind were sealed.
    Unsealed,
}

/// Compares the bytes of an object with its name, seal or parts, whichever it has.
pub(crate) fn of_bytes(key: &ObjectKey, content: &[u8]) -> Result<Soundness, StorageError> {
    let damaged = |reason: &str| Err(damage::found(key, reason));
    let (seal, must_be_sealed) = match (key.vouches(), Kind::of(key)) {
        (Vouched::Bytes(name), _) => {
            let found = Digest::of(content);
            return if found == name {
                Ok(Soundness::Sound)
            } else {
                damaged(&format!("its digest is {found}"))
            };
        }
        (Vouched::Values(_), _) if is_attached(content) => {
            return damaged(
                "it is attached to a store of others, and whoever reads it here does not read there",
            );
        }
        (Vouched::Values(_), _) => (seal::of_parquet(content), true),
        (Vouched::Nothing, Some(Kind::Weights | Kind::Accumulating)) => {
            (seal::of_parquet(content), false)
        }
        (Vouched::Nothing, Some(kind)) if DOCUMENTS.contains(&kind) => {
            (seal::of_json(content), false)
        }
        (Vouched::Nothing, Some(Kind::Tile)) => {
            return png::check(content).map_or_else(damaged, |()| Ok(Soundness::Sound));
        }
        (Vouched::Nothing, Some(Kind::Cube)) => {
            let checked = cube::check_own(cube::name_of(key), content);
            return checked.map_or_else(damaged, |()| Ok(Soundness::Sound));
        }
        (Vouched::Nothing, _) => (Seal::Absent, false),
    };
    match seal {
        Seal::Whole => Ok(Soundness::Sound),
        Seal::Broken => damaged(BROKEN),
        Seal::Absent if must_be_sealed => damaged(UNSEALED),
        Seal::Absent => Ok(Soundness::Unsealed),
    }
}

/// The same on a thread of its own where that takes long.
pub(crate) async fn of_large(key: &ObjectKey, content: &Bytes) -> Result<Soundness, StorageError> {
    if content.len() <= SMALL_BYTES {
        return of_bytes(key, content);
    }
    let (key, content) = (key.clone(), content.clone());
    off_thread(move || of_bytes(&key, &content)).await
}

/// Bytes that come piece by piece, compared with a name or a seal.
enum ByteCheck {
    Name(Sha256, Digest),
    Seal(SealCheck),
}

impl ByteCheck {
    fn of_name(name: Digest) -> Self {
        Self::Name(Sha256::new(), name)
    }

    fn of_seal(seal: SealCheck) -> Self {
        Self::Seal(seal)
    }

    fn update(&mut self, piece: &[u8]) {
        match self {
            Self::Name(hasher, _) => hasher.update(piece),
            Self::Seal(seal) => seal.update(piece),
        }
    }

    fn finish(self, key: &ObjectKey) -> Result<(), StorageError> {
        match self {
            Self::Name(hasher, name) => {
                let found = Digest::from_bytes(hasher.finalize().into());
                if found == name {
                    Ok(())
                } else {
                    Err(damage::found(key, format!("its digest is {found}")))
                }
            }
            Self::Seal(seal) => match seal.finish() {
                Seal::Whole => Ok(()),
                Seal::Broken => Err(damage::found(key, BROKEN)),
                Seal::Absent => Err(damage::found(key, UNSEALED)),
            },
        }
    }
}

/// Is what is to be stored what its key says? Of a file its bytes are compared, and of a field in one its seal: its values were
/// hashed as they were written.
pub(crate) async fn of_content(key: &ObjectKey, content: &Content) -> Result<(), StorageError> {
    let (key, content) = (key.clone(), content.clone());
    off_thread(move || {
        if let Content::Bytes(bytes) = &content {
            return of_object(&key, bytes).map(|_soundness| ());
        }
        let unreadable = |e| damage::found(&key, format!("its file cannot be read: {e}"));
        let mut check = match key.vouches() {
            Vouched::Bytes(name) => ByteCheck::of_name(name),
            Vouched::Values(_) => {
                let size_bytes = content.size_bytes();
                let end = size_bytes.saturating_sub(PARQUET_END_BYTES)..size_bytes;
                let end = content.part(end).map_err(unreadable)?;
                ByteCheck::of_seal(SealCheck::new(size_bytes, &end))
            }
            Vouched::Nothing => return Ok(()),
        };
        for piece in content.pieces(&key, PIECE_BYTES) {
            check.update(&piece.map_err(unreadable)?);
        }
        check.finish(&key)
    })
    .await
}

/// Is a document of a version that is sealed sealed?
pub(crate) fn check_document(
    key: &ObjectKey,
    content: &[u8],
    found: Soundness,
) -> Result<(), StorageError> {
    #[derive(Deserialize)]
    struct Version {
        schema: Option<u32>,
    }
    let version: Version =
        serde_json::from_slice(content).map_err(|e| damage::found(key, e.to_string()))?;
    if found == Soundness::Unsealed && version.schema.is_some_and(|it| it >= SEALED_SCHEMA) {
        return Err(damage::found(key, UNSEALED));
    }
    Ok(())
}

#[cfg(test)]
mod tests;
