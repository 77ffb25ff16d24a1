//! What is kept of a file of observations beside them: how many it held, and which of its values are none.
//!
//! It lies in `observation-files/{dataset}/{digest of the file}`, whatever kind of store the observations are in: the
//! same file again is the same note, so that nothing is counted twice.

use contract::digest::Digest;
use contract::key::ObjectKey;
use contract::kind::Kind;
use contract::masked::MaskedCells;
use contract::product::ProductId;
use futures::{StreamExt as _, TryStreamExt as _};
use serde::{Deserialize, Serialize};
use storage::{StorageError, Store, document};

use crate::error::IngestError;

/// Version of the note's JSON; the first that is sealed.
const SCHEMA: u32 = 2;
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

fn key(dataset: &ProductId, raw_sha256: Digest) -> Result<ObjectKey, IngestError> {
    let folder = Kind::ObservationFile.folder();
    Ok(format!("{folder}/{dataset}/{raw_sha256}").parse()?)
}

/// Notes what a file holds, once its observations are durable; as it is read now, if it was read otherwise before.
pub(crate) async fn put(
    store: &Store,
    dataset: &ProductId,
    raw_sha256: Digest,
    (file, observations, masked): (&str, u64, MaskedCells),
) -> Result<(), IngestError> {
    let key = key(dataset, raw_sha256)?;
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
    for name in store.folders(Kind::ObservationFile.folder()).await? {
        // Names that are none of ours are not ours to read.
        let Ok(dataset) = name.parse::<ProductId>() else {
            continue;
        };
        let keys = store
            .list(&format!("{}/{dataset}", Kind::ObservationFile.folder()))
            .await?;
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

#[cfg(test)]
mod tests {
    use test_data::frozen;

    use super::*;

    #[tokio::test]
    async fn frozen_notes_of_files_of_observations_say_what_they_said() {
        let dataset: ProductId = "buoys".parse().unwrap();
        let raw = Digest::of(b"a file of observations that nobody keeps");
        let masked: MaskedCells =
            serde_json::from_value(serde_json::json!({"implausible": 2})).unwrap();
        if let Some(folder) = frozen::to_freeze() {
            let objects = folder.join("objects");
            let store = Store::open(objects.to_str().unwrap()).unwrap();
            put(&store, &dataset, raw, ("buoys.csv", 17, masked))
                .await
                .unwrap();
        }
        let folder = tempfile::tempdir().unwrap();
        let notes_of_2 = "observation-files";
        frozen::copy(
            2,
            &format!("objects/{notes_of_2}"),
            &folder.path().join(notes_of_2),
        );
        let store = Store::open(folder.path().to_str().unwrap()).unwrap();
        let expected = FileNote {
            schema: 2,
            file: "buoys.csv".to_owned(),
            observations: 17,
            masked,
        };
        assert_eq!(notes(&store).await.unwrap(), [(dataset, vec![expected])]);
    }
}
