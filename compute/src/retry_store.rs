//! An object store whose reads are tried again when they fail for a passing reason.
//!
//! Ballista gives a job up at the first error of an object store, but runs a task again, perhaps elsewhere, after an I/O
//! error. So what still fails after the tries here is handed on as one.

use std::fmt::{Display, Formatter};
use std::future::Future;
use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

use async_trait::async_trait;
use bytes::Bytes;
use datafusion::error::DataFusionError;
use futures::StreamExt as _;
use futures::stream::{self, BoxStream};
use object_store::path::Path;
use object_store::{
    CopyOptions, Error, GetOptions, GetResult, GetResultPayload, ListResult, MultipartUpload,
    ObjectMeta, ObjectStore, PutMultipartOptions, PutOptions, PutPayload, PutResult, Result,
};
use retry::{Backoff, Retryable as _};

use crate::failure::may_pass;

/// How long one read is tried here; stores behind a network have tried for long before.
const RETRY_LIMIT: Duration = Duration::from_secs(5);
/// The largest part of an object that is fetched as one: more is handed on as it comes.
const WHOLE_BYTES: u64 = 64 << 20;

/// The decorator. Writes pass through: nothing is written on the way of a query.
#[derive(Debug)]
pub(crate) struct RetryStore {
    inner: Arc<dyn ObjectStore>,
    /// How long one read is tried.
    retry_limit: Duration,
}

impl RetryStore {
    pub(crate) fn new(inner: Arc<dyn ObjectStore>) -> Self {
        let retry_limit = RETRY_LIMIT;
        Self { inner, retry_limit }
    }

    /// Reads until it succeeds, fails for good, or was tried for long enough.
    async fn read<T, F>(&self, what: &Path, attempt: impl FnMut() -> F) -> Result<T>
    where
        F: Future<Output = Result<T>>,
    {
        attempt
            .retry(Backoff::within(self.retry_limit).pauses())
            .when(may_pass)
            .notify(|error, _pause| tracing::debug!(object = %what, %error, "reading again"))
            .await
            .map_err(as_io)
    }
}

impl Display for RetryStore {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "store {}", self.inner)
    }
}

/// The same failure; whoever looks for the root of one that may pass finds an I/O error.
fn as_io(error: Error) -> Error {
    if !may_pass(&error) {
        return error;
    }
    let root = DataFusionError::IoError(std::io::Error::other(error));
    Error::Generic {
        store: "object store",
        source: Box::new(root),
    }
}

#[async_trait]
impl ObjectStore for RetryStore {
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
        self.read(location, || async {
            let found = self.inner.get_opts(location, options.clone()).await?;
            let length_bytes = found.range.end.saturating_sub(found.range.start);
            if length_bytes <= WHOLE_BYTES && !options.head {
                whole(found).await
            } else {
                Ok(found)
            }
        })
        .await
    }

    async fn get_ranges(&self, location: &Path, ranges: &[Range<u64>]) -> Result<Vec<Bytes>> {
        self.read(location, || self.inner.get_ranges(location, ranges))
            .await
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
        let what = prefix.cloned().unwrap_or_default();
        self.read(&what, || self.inner.list_with_delimiter(prefix))
            .await
    }

    async fn copy_opts(&self, from: &Path, to: &Path, options: CopyOptions) -> Result<()> {
        self.inner.copy_opts(from, to, options).await
    }
}

/// An answer with its content fetched, so that a connection lost half way is noticed while it can be tried again.
async fn whole(found: GetResult) -> Result<GetResult> {
    let (meta, range, attributes) = (
        found.meta.clone(),
        found.range.clone(),
        found.attributes.clone(),
    );
    let content = found.bytes().await?;
    let payload = stream::once(std::future::ready(Ok(content))).boxed();
    Ok(GetResult {
        payload: GetResultPayload::Stream(payload),
        meta,
        range,
        attributes,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use object_store::ObjectStoreExt as _;
    use object_store::memory::InMemory;
    use std::sync::atomic::{AtomicU32, Ordering};
    use std::time::Instant;
    use storage::attached::{Cause, Failure};

    /// Fails the first reads.
    #[derive(Debug)]
    struct Failing {
        inner: InMemory,
        left: AtomicU32,
        with: fn() -> Box<dyn std::error::Error + Send + Sync>,
    }

    impl Display for Failing {
        fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
            f.write_str("failing")
        }
    }

    #[async_trait]
    impl ObjectStore for Failing {
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
            let left = self
                .left
                .fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| {
                    left.checked_sub(1)
                });
            if left.is_ok() {
                return Err(Error::Generic {
                    store: "failing",
                    source: (self.with)(),
                });
            }
            self.inner.get_opts(at, o).await
        }
        fn delete_stream(
            &self,
            at: BoxStream<'static, Result<Path>>,
        ) -> BoxStream<'static, Result<Path>> {
            self.inner.delete_stream(at)
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

    async fn failing(times: u32) -> (Arc<Failing>, RetryStore) {
        failing_with(times, || "500 Internal Server Error".into()).await
    }

    async fn failing_with(
        times: u32,
        with: fn() -> Box<dyn std::error::Error + Send + Sync>,
    ) -> (Arc<Failing>, RetryStore) {
        let inner = InMemory::new();
        inner.put(&Path::from("a"), "content".into()).await.unwrap();
        let failing = Arc::new(Failing {
            inner,
            left: AtomicU32::new(times),
            with,
        });
        let mut store = RetryStore::new(Arc::clone(&failing) as Arc<dyn ObjectStore>);
        store.retry_limit = Duration::from_secs(2);
        (failing, store)
    }

    fn changed() -> Box<dyn std::error::Error + Send + Sync> {
        let failure = Failure {
            place: "s3://b/x array sst".to_owned(),
            reason: "the store has changed since it was attached".to_owned(),
            cause: Cause::Content,
            folder: None,
        };
        failure.into()
    }

    #[tokio::test]
    async fn a_read_that_fails_for_a_while_is_tried_until_it_succeeds() {
        let (failing, store) = failing(3).await;
        let part = store.get_range(&Path::from("a"), 0..3).await.unwrap();
        assert_eq!(part, "con");
        assert_eq!(
            failing.left.load(Ordering::Relaxed),
            0,
            "the fault never fired"
        );
    }

    #[tokio::test]
    async fn what_fails_for_long_is_an_io_error_at_its_root() {
        let (failing, store) = failing(u32::MAX).await;
        let begun = Instant::now();
        let error = store.head(&Path::from("a")).await.unwrap_err();
        let tries = u32::MAX - failing.left.load(Ordering::Relaxed);
        assert!(tries > 1, "it was tried {tries} times");
        assert!(begun.elapsed() <= 2 * store.retry_limit);
        assert!(error.to_string().contains("500"), "{error}");
        let error = DataFusionError::from(error);
        assert!(
            matches!(error.find_root(), DataFusionError::IoError(_)),
            "{error:?}"
        );
    }

    #[tokio::test]
    async fn a_store_of_others_that_has_changed_is_not_waited_for() {
        let (failing, store) = failing_with(u32::MAX, changed).await;
        let error = store.head(&Path::from("a")).await.unwrap_err();
        let tries = u32::MAX - failing.left.load(Ordering::Relaxed);
        assert_eq!(tries, 1, "{error}");
        assert!(Failure::behind(&error).is_some(), "{error:?}");
    }

    #[tokio::test]
    async fn an_object_that_is_not_there_is_not_waited_for() {
        let (_failing, store) = failing(0).await;
        let missing = store.head(&Path::from("b")).await.unwrap_err();
        assert!(matches!(missing, Error::NotFound { .. }));
    }
}
