//! An object store with troubles: slow for ever, failing for a while after the first read, or never to be written.

use std::fmt::{Display, Formatter};
use std::ops::Range;
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use async_trait::async_trait;
use bytes::Bytes;
use futures::stream::BoxStream;
use object_store::path::Path;
use object_store::{
    CopyOptions, Error, GetOptions, GetResult, ListResult, MultipartUpload, ObjectMeta,
    ObjectStore, PutMultipartOptions, PutOptions, PutPayload, PutResult, Result,
};

#[derive(Debug)]
pub(crate) struct Troubled {
    inner: Arc<dyn ObjectStore>,
    delay: Duration,
    fails_for: Duration,
    begun: OnceLock<Instant>,
    takes_writes: bool,
}

impl Troubled {
    pub(crate) fn new(inner: Arc<dyn ObjectStore>, delay: Duration, fails_for: Duration) -> Self {
        Self {
            inner,
            delay,
            fails_for,
            begun: OnceLock::new(),
            takes_writes: true,
        }
    }

    /// One that may be read and not written.
    pub(crate) fn read_only(inner: Arc<dyn ObjectStore>) -> Self {
        Self {
            takes_writes: false,
            ..Self::new(inner, Duration::ZERO, Duration::ZERO)
        }
    }

    fn take(&self, at: &Path) -> Result<()> {
        if self.takes_writes {
            return Ok(());
        }
        Err(Error::PermissionDenied {
            path: at.to_string(),
            source: "Read-only file system".into(),
        })
    }

    async fn trouble(&self) -> Result<()> {
        tokio::time::sleep(self.delay).await;
        if self.begun.get_or_init(Instant::now).elapsed() < self.fails_for {
            println!("FAILED a read");
            return Err(Error::Generic {
                store: "troubled",
                source: "500 Internal Server Error".into(),
            });
        }
        Ok(())
    }
}

impl Display for Troubled {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str("troubled")
    }
}

#[async_trait]
impl ObjectStore for Troubled {
    async fn put_opts(&self, at: &Path, what: PutPayload, o: PutOptions) -> Result<PutResult> {
        self.take(at)?;
        self.inner.put_opts(at, what, o).await
    }

    async fn put_multipart_opts(
        &self,
        at: &Path,
        o: PutMultipartOptions,
    ) -> Result<Box<dyn MultipartUpload>> {
        self.take(at)?;
        self.inner.put_multipart_opts(at, o).await
    }

    async fn get_opts(&self, at: &Path, o: GetOptions) -> Result<GetResult> {
        self.trouble().await?;
        self.inner.get_opts(at, o).await
    }

    async fn get_ranges(&self, at: &Path, ranges: &[Range<u64>]) -> Result<Vec<Bytes>> {
        self.trouble().await?;
        self.inner.get_ranges(at, ranges).await
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
