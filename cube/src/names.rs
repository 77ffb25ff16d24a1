//! Digests along an axis, in chunks of an array: what runs, or levels of steps, were made of, and none where there is nothing.

use std::sync::Arc;

use contract::digest::Digest;
use futures::future::{self, FutureExt as _};
use futures::stream::{self, StreamExt as _, TryStreamExt as _};
use zarrs::storage::{AsyncReadableStorageTraits, AsyncWritableStorageTraits};

use crate::arrays::{self, DIGEST_BYTES, DIGEST_CHUNK, Definition};
use crate::axis::CHUNKS_AT_ONCE;
use crate::{CubeError, axis};

/// Reads all of them, several chunks at a time, but for the chunks that `known` has the bytes of.
pub(crate) async fn read<S>(
    store: &Arc<S>,
    definition: &Definition,
    place: &str,
    known: &(dyn Fn(u64) -> Option<Vec<u8>> + Send + Sync),
) -> Result<Vec<Option<Digest>>, CubeError>
where
    S: AsyncReadableStorageTraits + 'static,
{
    let array = axis::open(store, definition, place).await?;
    let count = array.shape()[0];
    let chunk_bytes = (DIGEST_CHUNK * DIGEST_BYTES) as usize;
    let mut chunks = stream::iter(0..count.div_ceil(DIGEST_CHUNK))
        .map(|chunk| match known(chunk) {
            Some(bytes) => future::ready(Ok::<_, CubeError>(Some(bytes))).boxed(),
            None => axis::read_chunk::<S, u8>(&array, chunk).boxed(),
        })
        .buffered(CHUNKS_AT_ONCE);
    let mut bytes: Vec<u8> = vec![];
    while let Some(found) = chunks.try_next().await? {
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

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use async_trait::async_trait;
    use storage::Store;
    use zarrs::storage::byte_range::ByteRangeIterator;
    use zarrs::storage::{AsyncMaybeBytesIterator, MaybeBytes, StorageError, StoreKey};
    use zarrs_icechunk::AsyncIcechunkStore;

    use super::*;
    use crate::Repository;
    use crate::description::tests::description;
    use crate::group::write_group;

    /// A store that answers a moment later, and knows how many wait for it at most.
    struct Later {
        inner: Arc<AsyncIcechunkStore>,
        waiting: AtomicUsize,
        most: AtomicUsize,
    }

    #[async_trait]
    impl AsyncReadableStorageTraits for Later {
        async fn get(&self, key: &StoreKey) -> Result<MaybeBytes, StorageError> {
            let waiting = self.waiting.fetch_add(1, Ordering::SeqCst) + 1;
            self.most.fetch_max(waiting, Ordering::SeqCst);
            tokio::task::yield_now().await;
            self.waiting.fetch_sub(1, Ordering::SeqCst);
            self.inner.get(key).await
        }

        async fn get_partial_many<'a>(
            &'a self,
            key: &StoreKey,
            byte_ranges: ByteRangeIterator<'a>,
        ) -> Result<AsyncMaybeBytesIterator<'a>, StorageError> {
            self.inner.get_partial_many(key, byte_ranges).await
        }

        async fn size_key(&self, key: &StoreKey) -> Result<Option<u64>, StorageError> {
            self.inner.size_key(key).await
        }

        fn supports_get_partial(&self) -> bool {
            false
        }
    }

    #[tokio::test]
    async fn chunks_of_digests_are_read_side_by_side_and_stay_in_their_order() {
        let description = description();
        let made = Repository::create(&Store::memory(), "p", &description).await;
        let session = made.unwrap().session().await.unwrap();
        let inner = Arc::new(AsyncIcechunkStore::from(session));
        let root = serde_json::Map::new();
        write_group(&inner, arrays::LEVELS, root).await.unwrap();
        // Four chunks, of which the second is of zeros alone.
        let in_chunk = DIGEST_CHUNK as usize;
        let count = 3 * in_chunk + 5;
        let name = |at: usize| {
            let is_there = !(in_chunk..2 * in_chunk).contains(&at);
            is_there.then(|| Digest::of(&at.to_le_bytes()))
        };
        let all: Vec<Option<Digest>> = (0..count).map(name).collect();
        let definition = arrays::level_names(count).unwrap();
        let written = write(&inner, definition, (&all, 0), &|_chunk| false);
        written.await.unwrap();
        let later = Arc::new(Later {
            inner,
            waiting: AtomicUsize::new(0),
            most: AtomicUsize::new(0),
        });
        let asked = arrays::level_names(1).unwrap();
        let found = read(&later, &asked, "p", &|_chunk| None).await.unwrap();
        assert!(found == all, "{} digests", found.len());
        assert_eq!(later.most.load(Ordering::SeqCst), 4);
        // One that is known is not read.
        let bytes = vec![7; in_chunk * DIGEST_BYTES as usize];
        let known = |chunk: u64| (chunk == 2).then(|| bytes.clone());
        let found = read(&later, &asked, "p", &known).await.unwrap();
        let own = 2 * in_chunk..3 * in_chunk;
        let seven = Some(Digest::from_bytes([7; DIGEST_BYTES as usize]));
        assert!(found[own.clone()].iter().all(|digest| *digest == seven));
        assert!(found[..own.start] == all[..own.start] && found[own.end..] == all[own.end..]);
    }
}
