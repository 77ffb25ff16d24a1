//! One state of a cube as Zarr's keys: metadata and encoded chunks, as whoever reads Zarr asks for them.

use std::ops::Range;
use std::sync::Arc;

use bytes::Bytes;
use futures::future::BoxFuture;
use icechunk::Store as ZarrStore;
use icechunk::format::{ByteRange, ChunkIndices, Path};
use icechunk::session::{Session, SessionErrorKind};
use icechunk::store::StoreErrorKind;
use serde_json::{Map, Value, json};
use tokio::sync::RwLock;

use crate::zarr_2::Group2;
use crate::{At, CubeError, Description, Repository};

/// Metadata of the group, or of an array in its folder.
const METADATA: &str = "zarr.json";
/// The same of an array, below its name.
const ARRAY_METADATA: &str = "/zarr.json";

/// One state of a cube, by keys. It does not change.
pub struct Keys {
    description: Description,
    session: Arc<RwLock<Session>>,
    store: ZarrStore,
    snapshot: String,
    /// Of the group, with those of all arrays in it: who reads over HTTP can list nothing.
    consolidated: Bytes,
    /// The same of version 2, or why there are none.
    zarr_2: Result<Group2, String>,
    place: String,
}

impl Repository {
    /// Opens a state by its keys.
    ///
    /// # Errors
    /// As [`Repository::at`].
    pub fn keys<'a>(&'a self, at: &'a At) -> BoxFuture<'a, Result<Keys, CubeError>> {
        Box::pin(async move {
            let cube = self.at(at).await?;
            let session = cube.session();
            let failed = |e: &dyn std::fmt::Display| self.failed("describing the arrays", e);
            let own = session.read().await;
            let nodes = own
                .list_nodes(&Path::root())
                .await
                .map_err(|e| failed(&e))?;
            let nodes: Result<Vec<_>, _> = nodes.collect();
            let nodes = nodes.map_err(|e| failed(&e))?;
            let (mut group, mut arrays) = (Value::Null, Map::new());
            for node in nodes {
                let metadata: Value =
                    serde_json::from_slice(&node.user_data).map_err(|e| failed(&e))?;
                match node.path.to_string().trim_start_matches('/') {
                    "" => group = metadata,
                    name => drop(arrays.insert(name.to_owned(), metadata)),
                }
            }
            let snapshot = own.snapshot_id().to_string();
            drop(own);
            let zarr_2 = Group2::new(&group["attributes"], &arrays);
            group["consolidated_metadata"] =
                json!({ "kind": "inline", "must_understand": false, "metadata": arrays });
            Ok(Keys {
                description: cube.description().clone(),
                store: ZarrStore::from_session(Arc::clone(&session)).await,
                session,
                snapshot,
                consolidated: group.to_string().into(),
                zarr_2,
                place: self.place().to_owned(),
            })
        })
    }
}

impl Keys {
    /// What it is of.
    pub fn description(&self) -> &Description {
        &self.description
    }

    /// Names the state: the same name, the same values of all keys.
    pub fn snapshot(&self) -> &str {
        &self.snapshot
    }

    /// The same arrays by the keys of version 2.
    pub(crate) fn zarr_2(&self) -> Result<&Group2, CubeError> {
        let own = self.zarr_2.as_ref();
        own.map_err(|e| {
            CubeError::library(&self.place, "describing the arrays by Zarr version 2", e)
        })
    }

    /// Where the cube is.
    pub(crate) fn place(&self) -> &str {
        &self.place
    }

    /// Length of the value of a key; none if there is no such key, or a chunk without data.
    pub fn length<'a>(&'a self, key: &'a str) -> BoxFuture<'a, Result<Option<u64>, CubeError>> {
        Box::pin(async move {
            let Some((path, index)) = chunk_of(key) else {
                let whole = self.read(key, &ByteRange::ALL).await?;
                return Ok(whole.map(|whole| whole.len() as u64));
            };
            let session = self.session.read().await;
            match session.get_chunk_ref(&path, &index).await {
                Ok(payload) => Ok(payload.map(|payload| payload.length())),
                // Only what is not there is none: to who reads Zarr that is no data.
                Err(e) if is_no_array(&e.kind) => Ok(None),
                Err(e) => Err(CubeError::library(&self.place, "looking for a chunk", e)),
            }
        })
    }

    /// The value of a key, or those bytes of it; none if there is no such key, or a chunk without data.
    ///
    /// Chunks are as they are stored, with their checksums: who decodes them compares those.
    pub fn get<'a>(
        &'a self,
        key: &'a str,
        range: Option<Range<u64>>,
    ) -> BoxFuture<'a, Result<Option<Bytes>, CubeError>> {
        Box::pin(async move {
            let range = range.map_or(ByteRange::ALL, ByteRange::Bounded);
            self.read(key, &range).await
        })
    }

    async fn read(&self, key: &str, range: &ByteRange) -> Result<Option<Bytes>, CubeError> {
        if key == METADATA {
            let whole = &self.consolidated;
            return Ok(Some(match range {
                ByteRange::Bounded(range) => {
                    let end = range.end.min(whole.len() as u64) as usize;
                    whole.slice((range.start as usize).min(end)..end)
                }
                _ => whole.clone(),
            }));
        }
        // The library finds a chunk at `timec/0` too, and takes `c/0` for a chunk of the group, which is an error.
        let is_metadata = key.ends_with(ARRAY_METADATA) && is_one_spelling(key);
        if !is_metadata && chunk_of(key).is_none() {
            return Ok(None);
        }
        match self.store.get(key, range).await {
            Ok(content) => Ok(Some(content)),
            Err(e) if is_absent(&e.kind) => Ok(None),
            Err(e) => Err(CubeError::library(&self.place, "reading a key", e)),
        }
    }
}

/// Is there no array of this name?
fn is_no_array(error: &SessionErrorKind) -> bool {
    matches!(
        error,
        SessionErrorKind::NodeNotFound { .. } | SessionErrorKind::NotAnArray { .. }
    )
}

/// Is there no such key, or none that could be?
fn is_absent(error: &StoreErrorKind) -> bool {
    matches!(
        error,
        StoreErrorKind::NotFound(_) | StoreErrorKind::InvalidKey { .. }
    )
}

/// The array and the place of a chunk, if that is what a key names.
fn chunk_of(key: &str) -> Option<(Path, ChunkIndices)> {
    if !is_one_spelling(key) {
        return None;
    }
    let (array, index) = match key.strip_suffix("/c") {
        // The one chunk of a number.
        Some(array) => (array, ""),
        None => key.split_once("/c/")?,
    };
    let index: Option<Vec<u32>> = match index {
        "" => Some(vec![]),
        index => index.split('/').map(place).collect(),
    };
    if array.is_empty() {
        return None;
    }
    let path = Path::new(&format!("/{array}")).ok()?;
    Some((path, ChunkIndices(index?)))
}

/// Is it a key as it is written? The library passes over empty parts and dots between slashes, so that many spellings would be one key.
fn is_one_spelling(key: &str) -> bool {
    key.split('/').all(|part| !matches!(part, "" | "." | ".."))
}

/// A place along an axis, as it is written: another spelling of it is another key, which is not there.
fn place(text: &str) -> Option<u32> {
    let place: u32 = text.parse().ok()?;
    (place.to_string() == text).then_some(place)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_of_chunks_name_array_and_place() {
        let of = |key| chunk_of(key).map(|(path, index)| (path.to_string(), index.0));
        assert_eq!(
            of("flux/c/3/0/1"),
            Some(("/flux".to_owned(), vec![3, 0, 1]))
        );
        assert_eq!(of("crs/c"), Some(("/crs".to_owned(), vec![])));
        for none in [
            "zarr.json",
            "flux/zarr.json",
            "flux/c/a",
            "flux/c/1/-1",
            "flux/c/+1",
            "flux/c/01",
            "fluxc/0",
            "c",
            "c/0",
            "c/c/c/0",
            "/c/0",
            "/c",
            ".zgroup",
            "flux/./c/0",
            "flux//c/0",
            "./flux/c/0",
            "/flux/c/0",
            "levels/../flux/c/0",
        ] {
            assert_eq!(of(none), None, "{none}");
        }
        assert!(is_one_spelling("levels/1/flux/zarr.json"));
        for other in ["flux/./zarr.json", "/flux/zarr.json", "flux//zarr.json"] {
            assert!(!is_one_spelling(other), "{other}");
        }
    }
}
