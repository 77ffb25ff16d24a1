//! An object store that remembers the ends of objects: what was read of a Parquet file with its footer is not asked for a
//! second time.
//!
//! The engine reads a footer first, keeps what it says, and asks then for the index of the pages, which lies before it.
//! A read up to the end always goes to the store, and renews what is remembered: an object that was put in the place of a
//! damaged one has other times, and the engine reads its footer anew.

use std::fmt::{Display, Formatter};
use std::ops::Range;
use std::sync::Arc;

use async_trait::async_trait;
use bytes::Bytes;
use futures::StreamExt as _;
use futures::stream::{self, BoxStream};
use object_store::path::Path;
use object_store::{
    CopyOptions, GetOptions, GetRange, GetResult, GetResultPayload, ListResult, MultipartUpload,
    ObjectMeta, ObjectStore, PutMultipartOptions, PutOptions, PutPayload, PutResult, Result,
};
use quick_cache::Weighter;
use quick_cache::sync::Cache;

/// What is read of a file's end at once: the footer of a field of up to 16 groups of chunks, and of a few groups also
/// the index of their pages.
pub(crate) const TAIL_BYTES: u64 = 16 << 10;
/// Ends remembered: a thousand. Who reads more files than that at the same time reads the index of some twice.
const HELD_BYTES: u64 = 16 << 20;

/// The decorator. Writes pass through.
#[derive(Debug)]
pub(crate) struct TailStore {
    inner: Arc<dyn ObjectStore>,
    tails: Cache<Path, Tail, ByBytes>,
}

/// The end of an object.
#[derive(Debug, Clone)]
struct Tail {
    content: Bytes,
    meta: ObjectMeta,
}

#[derive(Debug, Clone)]
struct ByBytes;

impl Weighter<Path, Tail> for ByBytes {
    fn weight(&self, _at: &Path, tail: &Tail) -> u64 {
        tail.content.len() as u64
    }
}

impl Tail {
    /// A part of it that ends before the object does.
    fn part(&self, range: &Range<u64>) -> Option<Bytes> {
        if range.end >= self.meta.size {
            return None;
        }
        let start = self.meta.size - self.content.len() as u64;
        let first = range.start.checked_sub(start)? as usize;
        let length = range.end.checked_sub(range.start)? as usize;
        Some(self.content.slice(first..first + length))
    }
}

impl TailStore {
    pub(crate) fn new(inner: Arc<dyn ObjectStore>) -> Self {
        let typical_count = (HELD_BYTES / TAIL_BYTES) as usize;
        Self {
            inner,
            tails: Cache::with_weighter(typical_count, HELD_BYTES, ByBytes),
        }
    }

    /// Parts of an object that are all remembered.
    fn remembered(&self, at: &Path, ranges: &[Range<u64>]) -> Option<(Vec<Bytes>, ObjectMeta)> {
        let tail = self.tails.get(at)?;
        let parts: Option<Vec<Bytes>> = ranges.iter().map(|range| tail.part(range)).collect();
        Some((parts?, tail.meta))
    }
}

/// The range of a request that asks for nothing else.
fn plain_range(options: &GetOptions) -> Option<Range<u64>> {
    let GetOptions {
        if_match: None,
        if_none_match: None,
        if_modified_since: None,
        if_unmodified_since: None,
        range: Some(GetRange::Bounded(range)),
        version: None,
        head: false,
        ..
    } = options
    else {
        return None;
    };
    Some(range.clone())
}

/// An answer that is there.
fn given(content: Bytes, range: Range<u64>, meta: ObjectMeta) -> GetResult {
    let payload = stream::once(std::future::ready(Ok(content))).boxed();
    GetResult {
        payload: GetResultPayload::Stream(payload),
        meta,
        range,
        attributes: object_store::Attributes::default(),
    }
}

impl Display for TailStore {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}", self.inner)
    }
}

#[async_trait]
impl ObjectStore for TailStore {
    async fn put_opts(
        &self,
        location: &Path,
        payload: PutPayload,
        options: PutOptions,
    ) -> Result<PutResult> {
        self.inner.put_opts(location, payload, options).await
    }

    async fn put_multipart_opts(
        &self,
        location: &Path,
        options: PutMultipartOptions,
    ) -> Result<Box<dyn MultipartUpload>> {
        self.inner.put_multipart_opts(location, options).await
    }

    async fn get_opts(&self, location: &Path, options: GetOptions) -> Result<GetResult> {
        let Some(asked) = plain_range(&options) else {
            return self.inner.get_opts(location, options).await;
        };
        if let Some((mut parts, meta)) = self.remembered(location, std::slice::from_ref(&asked)) {
            return Ok(given(parts.remove(0), asked, meta));
        }
        let found = self.inner.get_opts(location, options).await?;
        let (range, meta) = (found.range.clone(), found.meta.clone());
        if range.end != meta.size || range.end - range.start > TAIL_BYTES {
            return Ok(found);
        }
        let content = found.bytes().await?;
        let tail = Tail {
            content: content.clone(),
            meta: meta.clone(),
        };
        self.tails.insert(location.clone(), tail);
        Ok(given(content, range, meta))
    }

    async fn get_ranges(&self, location: &Path, ranges: &[Range<u64>]) -> Result<Vec<Bytes>> {
        if let [range] = ranges
            && range.end.saturating_sub(range.start) <= TAIL_BYTES
        {
            // Perhaps an end: the answer says so, as that to several ranges does not.
            let options = GetOptions::default().with_range(Some(range.clone()));
            let found = self.get_opts(location, options).await?;
            return Ok(vec![found.bytes().await?]);
        }
        match self.remembered(location, ranges) {
            Some((parts, _meta)) => Ok(parts),
            None => self.inner.get_ranges(location, ranges).await,
        }
    }

    fn delete_stream(
        &self,
        locations: BoxStream<'static, Result<Path>>,
    ) -> BoxStream<'static, Result<Path>> {
        self.inner.delete_stream(locations)
    }

    fn list(&self, prefix: Option<&Path>) -> BoxStream<'static, Result<ObjectMeta>> {
        self.inner.list(prefix)
    }

    async fn list_with_delimiter(&self, prefix: Option<&Path>) -> Result<ListResult> {
        self.inner.list_with_delimiter(prefix).await
    }

    async fn copy_opts(&self, from: &Path, to: &Path, options: CopyOptions) -> Result<()> {
        self.inner.copy_opts(from, to, options).await
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use object_store::ObjectStoreExt as _;
    use object_store::memory::InMemory;

    /// The last bytes of the content were read once; the object is then gone, so that what is there still is remembered.
    async fn read_to_the_end(content: &str, from: u64) -> (TailStore, Path) {
        let (inner, at) = (Arc::new(InMemory::new()), Path::from("a"));
        inner.put(&at, content.to_owned().into()).await.unwrap();
        let store = TailStore::new(Arc::clone(&inner) as Arc<dyn ObjectStore>);
        let end = from..content.len() as u64;
        let read = store.get_ranges(&at, &[end]).await.unwrap();
        assert_eq!(read, [&content[from as usize..]]);
        inner.delete(&at).await.unwrap();
        (store, at)
    }

    #[tokio::test]
    async fn what_lies_in_an_end_that_was_read_is_not_asked_for_again() {
        let (store, at) = read_to_the_end("data index footer", 5).await;
        assert_eq!(store.get_range(&at, 5..10).await.unwrap(), "index");
        let parts = store.get_ranges(&at, &[5..7, 8..10]).await.unwrap();
        assert_eq!(parts, ["in", "ex"]);
        // What lies before it, or ends where the object ends, is.
        for range in [4..10, 0..4, 5..17, 11..17] {
            assert!(store.get_range(&at, range).await.is_err());
        }
        assert!(store.get_ranges(&at, &[0..4, 5..7]).await.is_err());
        assert!(store.get(&at).await.is_err());
        assert!(store.head(&at).await.is_err());
    }

    #[tokio::test]
    async fn a_read_to_the_end_renews_what_is_remembered() {
        let (inner, at) = (InMemory::new(), Path::from("a"));
        let store = TailStore::new(Arc::new(inner));
        for content in ["old index end", "new index end"] {
            store.put(&at, content.into()).await.unwrap();
            assert_eq!(store.get_range(&at, 0..13).await.unwrap(), content);
            assert_eq!(store.get_range(&at, 0..3).await.unwrap(), content[..3]);
        }
    }

    #[tokio::test]
    async fn only_ends_of_bounded_size_are_remembered() {
        let long = "x".repeat(TAIL_BYTES as usize + 1);
        let (store, at) = read_to_the_end(&long, 0).await;
        assert!(store.get_range(&at, 0..3).await.is_err());
        let (store, at) = read_to_the_end(&long, 1).await;
        assert!(store.get_range(&at, 1..3).await.is_ok());
    }
}
