//! Where the shards of blocks are, and parts of them: of a folder's they are read when somebody goes through them, of other stores'
//! objects now, by all questions together.

use std::ops::Range;
use std::path::PathBuf;

use bytes::Bytes;
use futures::stream::{self, StreamExt as _, TryStreamExt as _};
use icechunk::format::manifest::ChunkPayload;
use icechunk::format::{ChunkIndices, Path};
use zarrs::array::Array;
use zarrs::storage::AsyncReadableStorageTraits as _;
use zarrs::storage::byte_range::ByteRange;
use zarrs_icechunk::AsyncIcechunkStore;

use crate::error::first_lines;
use crate::object_storage::ObjectStorage;
use crate::stored_chunks::Source;

/// Parts of a shard that is no object of its own, which are read at a time.
const READS_AT_ONCE: usize = 8;
const NO_SHARD: &str = "its shard is not there";

/// Where the bytes of a shard are.
pub(crate) enum Shard {
    /// A part of a file of this machine.
    File(PathBuf, Range<u64>),
    /// The same of an object of the store, by its name.
    Object(String, Range<u64>),
    /// In what the repository says of it, or not there.
    Within,
}

/// Shards of an array.
#[derive(Clone, Copy)]
pub(crate) struct Shards<'a> {
    pub(crate) array: &'a Array<AsyncIcechunkStore>,
    pub(crate) path: &'a Path,
    /// Where their objects are.
    pub(crate) objects: &'a ObjectStorage,
}

impl Shards<'_> {
    /// Where the bytes of a shard are.
    pub(crate) async fn at(&self, shard: [u64; 3]) -> Result<Shard, String> {
        let index = ChunkIndices(shard.iter().map(|at| *at as u32).collect());
        let session = self.array.storage().session();
        let payload = session.read().await.get_chunk_ref(self.path, &index).await;
        let Some(ChunkPayload::Ref(chunk)) = payload.map_err(|e| first_lines(&e))? else {
            return Ok(Shard::Within);
        };
        let own = chunk.offset..chunk.offset.saturating_add(chunk.length);
        let name = chunk.id.to_string();
        Ok(match self.objects.file(&name) {
            Some(file) => Shard::File(file, own),
            None => Shard::Object(name, own),
        })
    }

    /// Where parts of a shard are read, in the order of their ranges. They are asked for at once where the store can: a region has many.
    pub(crate) async fn sources(
        &self,
        key: [u64; 3],
        shard: Shard,
        ranges: &[Range<u64>],
    ) -> Result<Vec<Source>, String> {
        let moved = |own: &Range<u64>, range: &Range<u64>| {
            let at = |place: u64| own.start.saturating_add(place).min(own.end);
            at(range.start)..at(range.end)
        };
        match shard {
            Shard::File(file, own) => {
                let part = |range| Source::File(file.clone(), moved(&own, range));
                Ok(ranges.iter().map(part).collect())
            }
            Shard::Object(name, own) => {
                let ranges: Vec<Range<u64>> = ranges.iter().map(|it| moved(&own, it)).collect();
                let parts = self.objects.parts(&name, &ranges).await?;
                Ok(parts.into_iter().map(Source::Held).collect())
            }
            Shard::Within => {
                let read = |range: Range<u64>| async move {
                    let range = ByteRange::FromStart(range.start, Some(range.end - range.start));
                    let content = self.part(key, range).await?.ok_or(NO_SHARD)?;
                    Ok::<_, String>(Source::Held(Bytes::from(content)))
                };
                let reads = stream::iter(ranges.iter().cloned()).map(read);
                reads.buffered(READS_AT_ONCE).try_collect().await
            }
        }
    }

    /// Some bytes of a shard; none if it is not there.
    pub(crate) async fn part(
        &self,
        shard: [u64; 3],
        range: ByteRange,
    ) -> Result<Option<Vec<u8>>, String> {
        let key = self.array.chunk_key(&shard);
        match self.array.storage().get_partial(&key, range).await {
            Ok(found) => Ok(found.map(Vec::from)),
            // Of an array without any chunk the library says that one is gone.
            Err(_) if !self.is_named(shard).await? => Ok(None),
            Err(error) => Err(first_lines(&error)),
        }
    }

    /// Does the repository name a shard? None without data is.
    pub(crate) async fn is_named(&self, shard: [u64; 3]) -> Result<bool, String> {
        is_named(self.array, self.path, shard).await
    }
}

/// Does the repository name an object of an array? None without data is.
pub(crate) async fn is_named(
    array: &Array<AsyncIcechunkStore>,
    path: &Path,
    object: [u64; 3],
) -> Result<bool, String> {
    let index = ChunkIndices(object.iter().map(|at| *at as u32).collect());
    let session = array.storage().session();
    let payload = session.read().await.get_chunk_ref(path, &index).await;
    Ok(payload.map_err(|e| first_lines(&e))?.is_some())
}
