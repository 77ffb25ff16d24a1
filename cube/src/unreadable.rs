//! A chunk that cannot be read in, the error that names it by its array, its place there and its object out.

use icechunk::format::manifest::ChunkPayload;
use icechunk::format::{ChunkIndices, Path};
use zarrs::array::Array;
use zarrs_icechunk::AsyncIcechunkStore;

use crate::{CubeError, arrays};

/// Which object of an array a chunk is, or is a part of.
pub(crate) struct Object<'a> {
    pub(crate) array: &'a Array<AsyncIcechunkStore>,
    /// Where the repository is, for people.
    pub(crate) place: &'a str,
    /// Its index in the array's grid of objects.
    pub(crate) index: [u64; 3],
}

impl Object<'_> {
    /// The error of a chunk with this index.
    pub(crate) async fn unreadable(&self, chunk: [u64; 3], reason: &str) -> CubeError {
        let reason = match self.name().await {
            Some(name) => format!("{reason} (in {name})"),
            None => reason.to_owned(),
        };
        CubeError::chunk(arrays::name(self.array), chunk.to_vec(), reason)
    }

    /// None if it cannot be told, or the chunk lies in what names it.
    async fn name(&self) -> Option<String> {
        let path = Path::new(self.array.path().as_str()).ok()?;
        let index = ChunkIndices(self.index.iter().map(|at| *at as u32).collect());
        let session = self.array.storage().session();
        let session = session.read().await;
        match session.get_chunk_ref(&path, &index).await.ok()?? {
            ChunkPayload::Ref(reference) => {
                let place = self.place.trim_end_matches('/');
                Some(format!("{place}/chunks/{}", reference.id))
            }
            _ => None,
        }
    }
}
