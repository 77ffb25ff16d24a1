//! What is kept of a file of observations beside them: how many it held, and which of its values are none.
//!
//! It lies in `observation-files/{dataset}/{digest of the file}`, whatever kind of store the observations are in: the
//! same file again is the same note, so that nothing is counted twice.

use contract::digest::Digest;
use contract::key::ObjectKey;
use contract::masked::MaskedCells;
use contract::product::ProductId;
use futures::{StreamExt as _, TryStreamExt as _};
use serde::{Deserialize, Serialize};
use storage::{StorageError, Store, document};

use crate::error::IngestError;

/// Version of the note's JSON; the first that is sealed.
const SCHEMA: u32 = 2;
/// Folder of the notes.
const FOLDER: &str = "observation-files";
/// Notes that are read at the same time.
const NOTES_AT_ONCE: usize = 16;

/// What is kept of a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FileNote {
    schema: u32,
    /// Name that it came with.
    pub file: String,
    /// Observations that it holds.
    pub observations: u64,
    /// Values that it gives and that are no observations.
    #[serde(default, skip_serializing_if = "MaskedCells::is_none")]
    pub masked: MaskedCells,
}

/// Notes what a file holds, once its observations are durable; as it is read now, if it was read otherwise before.
pub(crate) async fn put(
    store: &Store,
    dataset: &ProductId,
    raw_sha256: Digest,
    (file, observations, masked): (&str, u64, MaskedCells),
) -> Result<(), IngestError> {
    let key: ObjectKey = format!("{FOLDER}/{dataset}/{raw_sha256}").parse()?;
    let note = FileNote {
        schema: SCHEMA,
        file: file.to_owned(),
        observations,
        masked,
    };
    let noted = match document::put_new(store, &key, &note).await {
        Err(StorageError::Conflict { .. }) => document::put_over(store, &key, &note).await,
        noted => noted.map(|_new| ()),
    };
    noted.map_err(IngestError::storage("note a file of observations"))
}

/// Every dataset that files were noted of, with its notes, sorted by name.
///
/// # Errors
/// The store does not answer, or a note is damaged.
pub async fn notes(store: &Store) -> Result<Vec<(ProductId, Vec<FileNote>)>, StorageError> {
    let mut all = vec![];
    for name in store.folders(FOLDER).await? {
        // Names that are none of ours are not ours to read.
        let Ok(dataset) = name.parse::<ProductId>() else {
            continue;
        };
        let keys = store.list(&format!("{FOLDER}/{dataset}")).await?;
        let reads = keys
            .into_iter()
            .map(|key| async move { document::get::<FileNote>(store, &key).await });
        let notes: Vec<Option<FileNote>> = futures::stream::iter(reads)
            .buffered(NOTES_AT_ONCE)
            .try_collect()
            .await?;
        all.push((dataset, notes.into_iter().flatten().collect()));
    }
    Ok(all)
}
