//! A store that waits: time limits, and new tries after failures that may pass, around a client that has neither.

use std::fmt::{Debug, Display, Formatter};
use std::future::Future;
use std::sync::Arc;
use std::time::{Duration, Instant};

use async_trait::async_trait;
use backon::{ExponentialBuilder, Retryable as _};
use futures::stream::{self, BoxStream, StreamExt as _, TryStreamExt as _};
use object_store::path::Path;
use object_store::{
    CopyOptions, Error, GetOptions, GetResult, GetResultPayload, ListResult, MultipartUpload,
    ObjectMeta, ObjectStore, PutMultipartOptions, PutOptions, PutPayload, PutResult, RenameOptions,
    Result,
};

use super::settings::Patience;
use crate::error::may_pass;

/// Answers up to this size are read whole within one try; longer ones are handed on piece by piece. Writes have one
/// time limit for each such share.
const WHOLE_BYTES: u64 = 64 << 20;

/// A store whose every call is bounded in time. Only for stores whose `put` creates whole objects or none, so that a
/// put can be tried again.
pub(super) struct Patient {
    inner: Arc<dyn ObjectStore>,
    patience: Patience,
    /// Gives an error of the client the kind that it has, where the client does not.
    classify: fn(Error) -> Error,
}

impl Patient {
    pub(super) fn new(
        inner: Arc<dyn ObjectStore>,
        patience: Patience,
        classify: fn(Error) -> Error,
    ) -> Arc<Self> {
        Arc::new(Self {
            inner,
            patience,
            classify,
        })
    }

    fn share(&self) -> Self {
        Self {
            inner: Arc::clone(&self.inner),
            patience: self.patience,
            classify: self.classify,
        }
    }

    /// Calls until it succeeds, fails for good, or was tried for long enough.
    async fn tried<T, F>(&self, call: impl FnMut() -> F) -> Result<T>
    where
        F: Future<Output = Result<T>>,
    {
        self.tried_within(self.patience.request, call).await
    }

    async fn tried_within<T, F>(&self, limit: Duration, mut call: impl FnMut() -> F) -> Result<T>
    where
        F: Future<Output = Result<T>>,
    {
        let begun = Instant::now();
        let pauses = ExponentialBuilder::default()
            .with_min_delay(Patience::FIRST_PAUSE)
            .with_max_delay(Patience::LONGEST_PAUSE)
            .with_jitter()
            .without_max_times();
        let once = || {
            let answer = call();
            async move { self.bounded(limit, answer).await }
        };
        once.retry(pauses)
            .when(|error| is_worth_a_try(error) && begun.elapsed() < self.patience.retries)
            .notify(|error, pause| {
                tracing::info!(%error, pause_ms = pause.as_millis() as u64, "trying the store again");
            })
            .await
    }

    async fn bounded<T>(
        &self,
        limit: Duration,
        answer: impl Future<Output = Result<T>>,
    ) -> Result<T> {
        match tokio::time::timeout(limit, answer).await {
            Ok(answer) => answer.map_err(self.classify),
            Err(_elapsed) => Err(silent(limit)),
        }
    }

    /// Reads short answers whole, so that a failure in the middle is a failure of this try.
    async fn read(&self, location: &Path, options: GetOptions) -> Result<GetResult> {
        let found = self.inner.get_opts(location, options).await?;
        let length_bytes = found.range.end - found.range.start;
        if length_bytes > WHOLE_BYTES {
            return Ok(found);
        }
        let (meta, range, attributes) = (
            found.meta.clone(),
            found.range.clone(),
            found.attributes.clone(),
        );
        let content = found.bytes().await?;
        if content.len() as u64 != length_bytes {
            let reason = format!("{} of {length_bytes} bytes came", content.len());
            return Err(generic(reason));
        }
        Ok(GetResult {
            payload: GetResultPayload::Stream(stream::once(async { Ok(content) }).boxed()),
            meta,
            range,
            attributes,
        })
    }
}

/// An object that is there already may be the one of the try before: that is for the caller to find out, at once.
fn is_worth_a_try(error: &Error) -> bool {
    let is_answer = matches!(
        error,
        Error::AlreadyExists { .. } | Error::Precondition { .. } | Error::NotModified { .. }
    );
    may_pass(error) && !is_answer
}

fn silent(limit: Duration) -> Error {
    generic(format!("no answer within {} s", limit.as_secs_f64()))
}

fn generic(reason: String) -> Error {
    Error::Generic {
        store: "remote",
        source: reason.into(),
    }
}

impl Debug for Patient {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        Display::fmt(self, f)
    }
}

impl Display for Patient {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        Display::fmt(&self.inner, f)
    }
}

#[async_trait]
impl ObjectStore for Patient {
    async fn put_opts(
        &self,
        location: &Path,
        payload: PutPayload,
        options: PutOptions,
    ) -> Result<PutResult> {
        let shares = 1 + payload.content_length() as u64 / WHOLE_BYTES;
        let limit = self.patience.request * u32::try_from(shares).unwrap_or(u32::MAX);
        self.tried_within(limit, || {
            self.inner
                .put_opts(location, payload.clone(), options.clone())
        })
        .await
    }

    async fn put_multipart_opts(
        &self,
        location: &Path,
        options: PutMultipartOptions,
    ) -> Result<Box<dyn MultipartUpload>> {
        self.tried(|| self.inner.put_multipart_opts(location, options.clone()))
            .await
    }

    async fn get_opts(&self, location: &Path, options: GetOptions) -> Result<GetResult> {
        let mut found = self.tried(|| self.read(location, options.clone())).await?;
        if found.range.end - found.range.start > WHOLE_BYTES
            && let GetResultPayload::Stream(pieces) = found.payload
        {
            let me = self.share();
            let bounded = stream::try_unfold((me, pieces), |(me, mut pieces)| async move {
                let limit = me.patience.request;
                let piece = me.bounded(limit, pieces.try_next()).await?;
                Ok(piece.map(|piece| (piece, (me, pieces))))
            });
            found.payload = GetResultPayload::Stream(bounded.boxed());
        }
        Ok(found)
    }

    fn delete_stream(
        &self,
        locations: BoxStream<'static, Result<Path>>,
    ) -> BoxStream<'static, Result<Path>> {
        let me = self.share();
        locations
            .and_then(move |location| {
                let me = me.share();
                async move {
                    me.tried(|| async {
                        let only = location.clone();
                        let mut gone = me
                            .inner
                            .delete_stream(stream::once(async { Ok(only) }).boxed());
                        gone.try_next().await
                    })
                    .await?;
                    Ok(location)
                }
            })
            .boxed()
    }

    fn list(&self, prefix: Option<&Path>) -> BoxStream<'static, Result<ObjectMeta>> {
        let (me, prefix) = (self.share(), prefix.cloned());
        stream::once(async move {
            let found: Vec<ObjectMeta> = me
                .tried(|| me.inner.list(prefix.as_ref()).try_collect())
                .await?;
            Ok::<_, Error>(stream::iter(found.into_iter().map(Ok)))
        })
        .try_flatten()
        .boxed()
    }

    async fn list_with_delimiter(&self, prefix: Option<&Path>) -> Result<ListResult> {
        self.tried(|| self.inner.list_with_delimiter(prefix)).await
    }

    async fn copy_opts(&self, from: &Path, to: &Path, options: CopyOptions) -> Result<()> {
        let copied = self.inner.copy_opts(from, to, options);
        self.bounded(self.patience.request, copied).await
    }

    async fn rename_opts(&self, from: &Path, to: &Path, options: RenameOptions) -> Result<()> {
        let renamed = self.inner.rename_opts(from, to, options);
        self.bounded(self.patience.request, renamed).await
    }
}

#[cfg(test)]
mod tests;
