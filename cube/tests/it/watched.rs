//! A store in front of which something happens when objects are read, that knows in which order they were removed, and whose clock may be wrong.

use std::fmt::{Debug, Display, Formatter};
use std::ops::Range;
use std::sync::{Arc, Mutex};

use async_trait::async_trait;
use bytes::Bytes;
use chrono::TimeDelta;
use futures::FutureExt as _;
use futures::future::BoxFuture;
use futures::stream::{BoxStream, StreamExt as _, TryStreamExt as _};
use object_store::path::Path;
use object_store::{
    CopyOptions, Error, GetOptions, GetResult, ListResult, MultipartUpload, ObjectMeta,
    ObjectStore, PutMultipartOptions, PutOptions, PutPayload, PutResult, Result,
};
use storage::Store;

/// What happens before an object is read, by its key.
type Before = Arc<dyn Fn(&str) -> BoxFuture<'static, Result<()>> + Send + Sync>;

/// See the module.
pub(crate) struct Watched {
    inner: Arc<dyn ObjectStore>,
    before: Before,
    removed: Arc<Mutex<Vec<String>>>,
    /// How far the store's clock is ahead.
    ahead: TimeDelta,
}

/// The same store, where this happens before each object is read, and the keys of objects that are removed from it.
pub(crate) fn watched(
    store: &Store,
    before: impl Fn(&str) -> BoxFuture<'static, Result<()>> + Send + Sync + 'static,
) -> (Store, Arc<Mutex<Vec<String>>>) {
    let before: Before = Arc::new(before);
    layered(store, &before, TimeDelta::zero())
}

/// The same store with a clock that is ahead of this machine's, or behind it.
pub(crate) fn ahead(store: &Store, ahead: TimeDelta) -> (Store, Arc<Mutex<Vec<String>>>) {
    let before: Before = Arc::new(|_key: &str| async { Ok(()) }.boxed());
    layered(store, &before, ahead)
}

fn layered(store: &Store, before: &Before, ahead: TimeDelta) -> (Store, Arc<Mutex<Vec<String>>>) {
    let removed = Arc::<Mutex<Vec<String>>>::default();
    let layer = |inner| -> Arc<dyn ObjectStore> {
        Arc::new(Watched {
            inner,
            before: Arc::clone(before),
            removed: Arc::clone(&removed),
            ahead,
        })
    };
    (store.through(layer), removed)
}

/// An answer of a server that may be well a moment later.
pub(crate) fn broken() -> Error {
    Error::Generic {
        store: "watched",
        source: "Server returned non-2xx status code: 503 Service Unavailable: ".into(),
    }
}

impl Debug for Watched {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        Display::fmt(self, f)
    }
}

impl Display for Watched {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str("watched")
    }
}

#[async_trait]
impl ObjectStore for Watched {
    async fn put_opts(&self, at: &Path, what: PutPayload, o: PutOptions) -> Result<PutResult> {
        self.inner.put_opts(at, what, o).await
    }

    async fn put_multipart_opts(
        &self,
        at: &Path,
        o: PutMultipartOptions,
    ) -> Result<Box<dyn MultipartUpload>> {
        self.inner.put_multipart_opts(at, o).await
    }

    async fn get_opts(&self, at: &Path, o: GetOptions) -> Result<GetResult> {
        (self.before)(at.as_ref()).await?;
        let mut found = self.inner.get_opts(at, o).await?;
        found.meta.last_modified += self.ahead;
        Ok(found)
    }

    async fn get_ranges(&self, at: &Path, ranges: &[Range<u64>]) -> Result<Vec<Bytes>> {
        (self.before)(at.as_ref()).await?;
        self.inner.get_ranges(at, ranges).await
    }

    fn delete_stream(
        &self,
        at: BoxStream<'static, Result<Path>>,
    ) -> BoxStream<'static, Result<Path>> {
        let removed = Arc::clone(&self.removed);
        let noted = at.inspect_ok(move |path| removed.lock().unwrap().push(path.to_string()));
        self.inner.delete_stream(noted.boxed())
    }

    fn list(&self, prefix: Option<&Path>) -> BoxStream<'static, Result<ObjectMeta>> {
        self.inner.list(prefix)
    }

    async fn list_with_delimiter(&self, prefix: Option<&Path>) -> Result<ListResult> {
        self.inner.list_with_delimiter(prefix).await
    }

    async fn copy_opts(&self, from: &Path, to: &Path, o: CopyOptions) -> Result<()> {
        self.inner.copy_opts(from, to, o).await
    }
}
