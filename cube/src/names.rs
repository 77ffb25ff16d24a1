//! Digests along an axis, in chunks of an array: what runs, or levels of steps, were made of, and none where there is nothing.

use std::sync::Arc;

use contract::digest::Digest;
use zarrs::storage::{AsyncReadableStorageTraits, AsyncWritableStorageTraits};

use crate::arrays::{self, DIGEST_BYTES, DIGEST_CHUNK, Definition};
use crate::error::first_lines;
use crate::{CubeError, axis};

/// Reads all of them.
pub(crate) async fn read<S>(
    store: &Arc<S>,
    definition: &Definition,
    place: &str,
) -> Result<Vec<Option<Digest>>, CubeError>
where
    S: AsyncReadableStorageTraits + 'static,
{
    let array = axis::open(store, definition, place).await?;
    let count = array.shape()[0];
    let chunk_bytes = (DIGEST_CHUNK * DIGEST_BYTES) as usize;
    let mut bytes: Vec<u8> = vec![];
    for chunk in 0..count.div_ceil(DIGEST_CHUNK) {
        let index = [chunk, 0];
        let found = array.async_retrieve_chunk_if_exists::<Vec<u8>>(&index);
        let found = found
            .await
            .map_err(|e| CubeError::chunk(arrays::name(&array), index.to_vec(), first_lines(&e)))?;
        // One of zeros alone is not stored.
        bytes.extend(found.unwrap_or_else(|| vec![0; chunk_bytes]));
    }
    bytes.truncate((count * DIGEST_BYTES) as usize);
    let digest = |bytes: &[u8]| {
        let bytes: [u8; DIGEST_BYTES as usize] = bytes.try_into().unwrap_or_default();
        let is_there = bytes.iter().any(|byte| *byte != 0);
        is_there.then(|| Digest::from_bytes(bytes))
    };
    let chunks = bytes.chunks_exact(DIGEST_BYTES as usize);
    Ok(chunks.map(digest).collect())
}

/// Writes those from one on, and how many there are; no chunk of those that `is_elsewhere` says of that another array holds the same.
pub(crate) async fn write<S>(
    store: &Arc<S>,
    definition: Definition,
    (names, first): (&[Option<Digest>], usize),
    is_elsewhere: &(dyn Fn(usize) -> bool + Send + Sync),
) -> Result<(), CubeError>
where
    S: AsyncWritableStorageTraits + 'static,
{
    let array = definition.with_storage(Arc::clone(store));
    let failed = |e: String| CubeError::library(&arrays::name(&array), "writing", e);
    let stored = array.async_store_metadata().await;
    stored.map_err(|e| failed(e.to_string()))?;
    let in_chunk = DIGEST_CHUNK as usize;
    let chunks = names.chunks(in_chunk).enumerate().skip(first / in_chunk);
    for (chunk, names) in chunks.filter(|(chunk, _)| !is_elsewhere(*chunk)) {
        let bytes = names.iter().flat_map(|name| match name {
            Some(name) => *name.as_bytes(),
            None => [0; DIGEST_BYTES as usize],
        });
        let mut bytes: Vec<u8> = bytes.collect();
        bytes.resize((DIGEST_CHUNK * DIGEST_BYTES) as usize, 0);
        let stored = array.async_store_chunk(&[chunk as u64, 0], bytes).await;
        stored.map_err(|e| failed(e.to_string()))?;
    }
    Ok(())
}
