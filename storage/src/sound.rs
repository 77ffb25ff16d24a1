//! Is a stored object what its name and its own seal say?
//!
//! Input files, domains and observations are named by the digest of their bytes. Frames and series are named by the
//! digest of their values and hold a seal over their bytes; so do documents, weights and exact sums, whose names say what
//! they were made from. Pictures hold a check of every part, as PNG has it. Whatever is read whole is checked each time;
//! what is read in parts is checked row by row ([`crate::row_check`]).

pub mod damage;
mod png;
pub mod seal;

use bytes::Bytes;
use contract::digest::Digest;
use contract::key::ObjectKey;
use contract::kind::{Kind, Vouched};
use parquet::file::metadata::ParquetMetaDataReader;
use serde::Deserialize;

use crate::{StorageError, contributed, frames, series};
use seal::Seal;

/// Version of a document's schema from which it is sealed.
const SEALED_SCHEMA: u32 = 2;
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
        (Vouched::Values(_), _) => (seal::of_parquet(content), true),
        (Vouched::Nothing, Some(Kind::Weights | Kind::Accumulating)) => {
            (seal::of_parquet(content), false)
        }
        (
            Vouched::Nothing,
            Some(
                Kind::Manifest
                | Kind::Sums
                | Kind::ObservationIndex
                | Kind::ObservationFile
                | Kind::Reading
                | Kind::Check
                | Kind::Protocol,
            ),
        ) => (seal::of_json(content), false),
        (Vouched::Nothing, Some(Kind::Tile)) => {
            return png::check(content).map_or_else(damaged, |()| Ok(Soundness::Sound));
        }
        (Vouched::Nothing, _) => (Seal::Absent, false),
    };
    match seal {
        Seal::Whole => Ok(Soundness::Sound),
        Seal::Broken => damaged("its bytes are not those that were sealed"),
        Seal::Absent if must_be_sealed => damaged("its seal is gone"),
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

/// All that can be known of an object from itself: its bytes, and its values where these name it.
pub fn of_object(key: &ObjectKey, content: &Bytes) -> Result<Soundness, StorageError> {
    let found = of_bytes(key, content)?;
    match (key.vouches(), Kind::of(key)) {
        (Vouched::Values(_), Some(Kind::Series)) => {
            series::decode(key, content.clone())?;
        }
        (Vouched::Values(_), Some(Kind::Contributed)) => {
            contributed::check(key, content.clone())?;
        }
        (Vouched::Values(_), _) => frames::check_values(key, content.clone())?,
        (
            Vouched::Nothing,
            Some(
                Kind::Manifest
                | Kind::Sums
                | Kind::ObservationIndex
                | Kind::ObservationFile
                | Kind::Reading
                | Kind::Check
                | Kind::Protocol,
            ),
        ) => {
            check_document(key, content, found)?;
        }
        (Vouched::Nothing, Some(Kind::Weights | Kind::Accumulating)) => {
            // Where the end of a file is damaged, no seal is found either.
            ParquetMetaDataReader::new()
                .parse_and_finish(content)
                .map_err(|e| damage::found(key, e))?;
        }
        (Vouched::Nothing, Some(Kind::Landing)) => {
            // The name of a note ends in the place that it holds.
            let told = std::str::from_utf8(content)
                .ok()
                .and_then(|text| text.parse::<contract::topic::Origin>().ok())
                .map(|origin| format!("-{}-{}", origin.partition, origin.offset));
            if !told.is_some_and(|told| key.as_str().ends_with(&told)) {
                return Err(damage::found(key, "it is not of the notice in its name"));
            }
            return Ok(Soundness::Sound);
        }
        _ => {}
    }
    Ok(found)
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
        return Err(damage::found(key, "its seal is gone"));
    }
    Ok(())
}

/// Work that takes long, where nobody waits for the thread.
pub(crate) async fn off_thread<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, StorageError> + Send + 'static,
) -> Result<T, StorageError> {
    match tokio::task::spawn_blocking(work).await {
        Ok(done) => done,
        Err(ended) => match ended.try_into_panic() {
            Ok(panic) => std::panic::resume_unwind(panic),
            Err(cancelled) => Err(StorageError::Object {
                key: "a thread".to_owned(),
                source: cancelled.into(),
            }),
        },
    }
}

#[cfg(test)]
mod tests;
