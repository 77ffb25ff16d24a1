//! A store in memory that fails as it is told to, for the tests of this folder.

use std::collections::VecDeque;
use std::fmt::{Display, Formatter};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use async_trait::async_trait;
use futures::stream::{BoxStream, StreamExt as _};
use object_store::memory::InMemory;
use object_store::path::Path;
use object_store::{
    CopyOptions, Error, GetOptions, GetResult, ListResult, MultipartUpload, ObjectMeta,
    ObjectStore, PutMode, PutMultipartOptions, PutOptions, PutPayload, PutResult, Result,
};

/// What befalls a call.
#[derive(Clone, Copy)]
pub(super) enum Fault {
    /// It does nothing and fails.
    Fail(fn() -> Error),
    /// It is done, and the answer is lost.
    LoseAnswer,
    /// No answer ever comes, and nothing is done.
    Hang,
}

/// Memory with a list of faults: puts and gets each take the next one from their own list.
#[derive(Default)]
pub(super) struct Faulty {
    pub(super) inner: InMemory,
    pub(super) puts: Mutex<VecDeque<Fault>>,
    pub(super) gets: Mutex<VecDeque<Fault>>,
    /// Befalls every put after the list.
    pub(super) always: Mutex<Option<Fault>>,
    /// What every removal ends with, and nothing is removed.
    pub(super) removals: Option<fn() -> Error>,
    /// Conditional creation replaces what is there.
    pub(super) overwrites: bool,
    pub(super) put_count: AtomicUsize,
    pub(super) multipart_count: AtomicUsize,
}

impl Faulty {
    pub(super) fn new(puts: impl IntoIterator<Item = Fault>) -> Arc<Self> {
        Arc::new(Self {
            puts: Mutex::new(puts.into_iter().collect()),
            ..Self::default()
        })
    }

    pub(super) fn always(fault: Fault) -> Arc<Self> {
        let me = Self::new([]);
        *me.always.lock().unwrap() = Some(fault);
        me
    }

    pub(super) fn put_count(&self) -> usize {
        self.put_count.load(Ordering::Relaxed)
    }
}

/// An error of a server that may be gone a moment later.
pub(super) fn broken() -> Error {
    Error::Generic {
        store: "faulty",
        source: "Server returned non-2xx status code: 500 Internal Server Error: ".into(),
    }
}

/// The disk has no room; it may have some later.
pub(super) fn full() -> Error {
    Error::Generic {
        store: "faulty",
        source: std::io::Error::from(std::io::ErrorKind::StorageFull).into(),
    }
}

/// "Already exists", as stores say it whether or not it is true.
pub(super) fn exists() -> Error {
    Error::AlreadyExists {
        path: "somewhere".to_owned(),
        source: "conflict".into(),
    }
}

/// Not allowed.
pub(super) fn denied() -> Error {
    Error::PermissionDenied {
        path: "somewhere".to_owned(),
        source: "read only".into(),
    }
}

/// Not there: of a put, the bucket.
pub(super) fn absent() -> Error {
    Error::NotFound {
        path: "somewhere".to_owned(),
        source: "NoSuchBucket".into(),
    }
}

async fn befall<T>(fault: Option<Fault>, call: impl Future<Output = Result<T>>) -> Result<T> {
    match fault {
        None => call.await,
        Some(Fault::Fail(error)) => Err(error()),
        Some(Fault::LoseAnswer) => match call.await {
            Ok(_lost) => Err(broken()),
            Err(e) => Err(e),
        },
        Some(Fault::Hang) => std::future::pending().await,
    }
}

impl std::fmt::Debug for Faulty {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str("Faulty")
    }
}

impl Display for Faulty {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str("Faulty")
    }
}

#[async_trait]
impl ObjectStore for Faulty {
    async fn put_opts(
        &self,
        location: &Path,
        payload: PutPayload,
        mut options: PutOptions,
    ) -> Result<PutResult> {
        self.put_count.fetch_add(1, Ordering::Relaxed);
        if self.overwrites {
            options.mode = PutMode::Overwrite;
        }
        let listed = self.puts.lock().unwrap().pop_front();
        let fault = listed.or(*self.always.lock().unwrap());
        befall(fault, self.inner.put_opts(location, payload, options)).await
    }

    async fn put_multipart_opts(
        &self,
        location: &Path,
        options: PutMultipartOptions,
    ) -> Result<Box<dyn MultipartUpload>> {
        self.multipart_count.fetch_add(1, Ordering::Relaxed);
        self.inner.put_multipart_opts(location, options).await
    }

    async fn get_opts(&self, location: &Path, options: GetOptions) -> Result<GetResult> {
        let fault = self.gets.lock().unwrap().pop_front();
        befall(fault, self.inner.get_opts(location, options)).await
    }

    fn delete_stream(
        &self,
        locations: BoxStream<'static, Result<Path>>,
    ) -> BoxStream<'static, Result<Path>> {
        match self.removals {
            None => self.inner.delete_stream(locations),
            Some(error) => locations.map(move |_location| Err(error())).boxed(),
        }
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
