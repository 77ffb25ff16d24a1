//! What is asked of a store: requests and bytes, counted for who measures or tests them.

use std::fmt::{Debug, Display, Formatter};
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use async_trait::async_trait;
use bytes::Bytes;
use futures::StreamExt as _;
use futures::stream::BoxStream;
use object_store::path::Path;
use object_store::{
    CopyOptions, GetOptions, GetResult, ListResult, MultipartUpload, ObjectMeta, ObjectStore,
    PutMultipartOptions, PutOptions, PutPayload, PutResult, Result,
};

use super::Store;

/// What was asked of a store since it is counted.
#[derive(Debug, Default)]
pub struct Traffic {
    reads: AtomicU64,
    read_bytes: AtomicU64,
    heads: AtomicU64,
    lists: AtomicU64,
    listed: AtomicU64,
    writes: AtomicU64,
    written_bytes: AtomicU64,
}

/// [`Traffic`] at one moment.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counts {
    /// Requests for content.
    pub reads: u64,
    /// Content that came, bytes. Of a request whose reader goes away half-way it is all that was asked for.
    pub read_bytes: u64,
    /// Requests whether an object is there, or how large it is.
    pub heads: u64,
    /// Requests for names.
    pub lists: u64,
    /// Names that came of these.
    pub listed: u64,
    /// Objects that were written.
    pub writes: u64,
    /// Their content, bytes.
    pub written_bytes: u64,
}

impl Counts {
    /// What came since an earlier moment.
    #[must_use]
    pub fn since(self, earlier: Self) -> Self {
        Self {
            reads: self.reads - earlier.reads,
            read_bytes: self.read_bytes - earlier.read_bytes,
            heads: self.heads - earlier.heads,
            lists: self.lists - earlier.lists,
            listed: self.listed - earlier.listed,
            writes: self.writes - earlier.writes,
            written_bytes: self.written_bytes - earlier.written_bytes,
        }
    }
}

fn add(counter: &AtomicU64, more: u64) {
    counter.fetch_add(more, Ordering::Relaxed);
}

impl Traffic {
    /// So far.
    pub fn counts(&self) -> Counts {
        let of = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        Counts {
            reads: of(&self.reads),
            read_bytes: of(&self.read_bytes),
            heads: of(&self.heads),
            lists: of(&self.lists),
            listed: of(&self.listed),
            writes: of(&self.writes),
            written_bytes: of(&self.written_bytes),
        }
    }

    /// An object was written past the layer that counts.
    pub(super) fn wrote(&self, bytes: u64) {
        add(&self.writes, 1);
        add(&self.written_bytes, bytes);
    }
}

impl Store {
    /// The same store, as one that another process opens, whose requests are counted from now on.
    pub fn counted(&self) -> (Self, Arc<Traffic>) {
        let traffic = Arc::new(Traffic::default());
        let layer = |inner: &Arc<dyn ObjectStore>| -> Arc<dyn ObjectStore> {
            Arc::new(Counted {
                inner: Arc::clone(inner),
                traffic: Arc::clone(&traffic),
            })
        };
        let counted = Self {
            objects: layer(&self.objects),
            root: layer(&self.root),
            traffic: Some(Arc::clone(&traffic)),
            is_layered: true,
            checked: Arc::default(),
            pages: Arc::default(),
            parts: Arc::default(),
            newest: Arc::default(),
            ..self.clone()
        };
        (counted, traffic)
    }

    /// An object was written without a request: a folder's file.
    pub(super) fn wrote(&self, bytes: u64) {
        if let Some(traffic) = &self.traffic {
            traffic.wrote(bytes);
        }
    }
}

/// The layer over what answers.
struct Counted {
    inner: Arc<dyn ObjectStore>,
    traffic: Arc<Traffic>,
}

impl Debug for Counted {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        Display::fmt(self, f)
    }
}

impl Display for Counted {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}, counted", self.inner)
    }
}

#[async_trait]
impl ObjectStore for Counted {
    async fn put_opts(&self, at: &Path, what: PutPayload, o: PutOptions) -> Result<PutResult> {
        let bytes = what.content_length();
        let put = self.inner.put_opts(at, what, o).await?;
        self.traffic.wrote(bytes as u64);
        Ok(put)
    }

    async fn put_multipart_opts(
        &self,
        at: &Path,
        o: PutMultipartOptions,
    ) -> Result<Box<dyn MultipartUpload>> {
        self.inner.put_multipart_opts(at, o).await
    }

    async fn get_opts(&self, at: &Path, o: GetOptions) -> Result<GetResult> {
        add(
            if o.head {
                &self.traffic.heads
            } else {
                &self.traffic.reads
            },
            1,
        );
        let is_head = o.head;
        let found = self.inner.get_opts(at, o).await?;
        if !is_head {
            add(
                &self.traffic.read_bytes,
                found.range.end - found.range.start,
            );
        }
        Ok(found)
    }

    async fn get_ranges(&self, at: &Path, ranges: &[Range<u64>]) -> Result<Vec<Bytes>> {
        let bytes = ranges.iter().map(|range| range.end - range.start).sum();
        add(&self.traffic.reads, 1);
        add(&self.traffic.read_bytes, bytes);
        self.inner.get_ranges(at, ranges).await
    }

    fn delete_stream(
        &self,
        at: BoxStream<'static, Result<Path>>,
    ) -> BoxStream<'static, Result<Path>> {
        self.inner.delete_stream(at)
    }

    fn list(&self, prefix: Option<&Path>) -> BoxStream<'static, Result<ObjectMeta>> {
        add(&self.traffic.lists, 1);
        let traffic = Arc::clone(&self.traffic);
        let found = self.inner.list(prefix);
        found.inspect(move |_name| add(&traffic.listed, 1)).boxed()
    }

    async fn list_with_delimiter(&self, prefix: Option<&Path>) -> Result<ListResult> {
        add(&self.traffic.lists, 1);
        let found = self.inner.list_with_delimiter(prefix).await?;
        let names = found.objects.len() + found.common_prefixes.len();
        add(&self.traffic.listed, names as u64);
        Ok(found)
    }

    async fn copy_opts(&self, from: &Path, to: &Path, o: CopyOptions) -> Result<()> {
        self.inner.copy_opts(from, to, o).await
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::key::ObjectKey;

    #[tokio::test]
    async fn what_is_asked_of_a_store_is_counted() {
        let folder = tempfile::tempdir().unwrap();
        for store in [
            Store::memory(),
            Store::open(folder.path().to_str().unwrap()).unwrap(),
        ] {
            let key: ObjectKey = "readings/p/a".parse().unwrap();
            store
                .put_over(&key, Bytes::from_static(b"before"))
                .await
                .unwrap();
            let (counted, traffic) = store.counted();
            assert_eq!(traffic.counts(), Counts::default());
            assert!(counted.exists(&key).await.unwrap());
            counted.fetch(&key).await.unwrap();
            counted.list("readings").await.unwrap();
            let before = traffic.counts();
            assert_eq!((before.heads, before.reads, before.read_bytes), (1, 1, 6));
            assert_eq!((before.lists, before.listed, before.writes), (1, 1, 0));
            for name in ["readings/p/b", "cubes/p/repo"] {
                let key: ObjectKey = name.parse().unwrap();
                let seven = Bytes::from_static(b"7 bytes");
                if name.ends_with("repo") {
                    counted.swap(&key, None, seven).await.unwrap();
                } else {
                    counted.put_new(&key, seven).await.unwrap();
                }
            }
            let own = traffic.counts().since(before);
            assert_eq!((own.writes, own.written_bytes, own.lists), (2, 14, 0));
        }
    }
}
