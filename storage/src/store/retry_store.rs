//! A store that waits: time limits, and new tries after failures that may pass, around a client that has neither.

use std::fmt::{Debug, Display, Formatter};
use std::future::Future;
use std::sync::{Arc, PoisonError, RwLock};
use std::time::Duration;

use async_trait::async_trait;
use futures::stream::{self, BoxStream, StreamExt as _, TryStreamExt as _};
use object_store::path::Path;
use object_store::{
    CopyOptions, Error, GetOptions, GetResult, GetResultPayload, ListResult, MultipartUpload,
    ObjectMeta, ObjectStore, PutMultipartOptions, PutOptions, PutPayload, PutResult, RenameOptions,
    Result,
};
use retry::Retryable as _;

use super::outage::{Outage, Waiting};
use super::settings::RetryLimits;
use crate::error::may_pass;

/// Answers up to this size are read whole within one try; longer ones are handed on piece by piece. Writes have one
/// time limit for each such share.
const WHOLE_BYTES: u64 = 64 << 20;

/// A store whose every call is bounded in time. Only for stores whose `put` creates whole objects or none, so that a
/// put can be tried again. Clones share it.
#[derive(Clone)]
pub(super) struct RetryStore {
    shared: Arc<Shared>,
}

struct Shared {
    /// What calls are made with; another after a silence, for a connection may be dead without saying so.
    client: RwLock<Client>,
    connect: Connect,
    retry_limits: RetryLimits,
    /// Gives an error of the client the kind that it has, where the client does not.
    classify: fn(Error) -> Error,
    /// Requests that are tried again.
    outage: Outage,
}

type Client = Arc<dyn ObjectStore>;

/// Makes a client with connections of its own.
pub(super) type Connect = Box<dyn Fn() -> Result<Client> + Send + Sync>;

impl RetryStore {
    pub(super) fn new(
        connect: Connect,
        retry_limits: RetryLimits,
        classify: fn(Error) -> Error,
    ) -> Result<Self> {
        Ok(Self {
            shared: Arc::new(Shared {
                client: RwLock::new(connect()?),
                connect,
                retry_limits,
                classify,
                outage: Outage::of("requests"),
            }),
        })
    }

    fn client(&self) -> Client {
        let client = self.shared.client.read();
        Arc::clone(&client.unwrap_or_else(PoisonError::into_inner))
    }

    /// Turns away from a client that was silent, unless another call has done so.
    fn leave(&self, silent: &Client) {
        let client = self.shared.client.write();
        let mut client = client.unwrap_or_else(PoisonError::into_inner);
        if Arc::ptr_eq(&client, silent) {
            match (self.shared.connect)() {
                Ok(other) => *client = other,
                Err(error) => tracing::warn!(%error, "no new client; the silent one is asked on"),
            }
        }
    }

    /// Calls until it succeeds, fails for good, or was tried for long enough.
    async fn tried<T, F>(&self, call: impl FnMut(Client) -> F) -> Result<T>
    where
        F: Future<Output = Result<T>>,
    {
        self.tried_within(self.shared.retry_limits.request, call)
            .await
    }

    async fn tried_within<T, F>(
        &self,
        limit: Duration,
        mut call: impl FnMut(Client) -> F,
    ) -> Result<T>
    where
        F: Future<Output = Result<T>>,
    {
        let once = || {
            let client = self.client();
            let answer = call(Arc::clone(&client));
            async move { self.bounded(limit, &client, answer).await }
        };
        let retries = self.shared.retry_limits.retries;
        let mut waiting: Option<Waiting<'_>> = None;
        let answer = once
            .retry(self.shared.retry_limits.backoff().pauses())
            .when(is_worth_a_try)
            .notify(|error, pause| {
                let is_new = waiting.is_none();
                let waiting = waiting.get_or_insert_with(|| self.shared.outage.wait());
                if is_new && waiting.is_first {
                    let retries_s = retries.as_secs_f64();
                    tracing::warn!(%error, "the store failed: tried again for at most {retries_s} s");
                } else {
                    tracing::info!(%error, pause_ms = pause.as_millis() as u64, "trying the store again");
                }
            })
            .await;
        if answer.is_ok()
            && let Some(waiting) = waiting
        {
            waiting.went_well();
        }
        answer
    }

    async fn bounded<T>(
        &self,
        limit: Duration,
        client: &Client,
        answer: impl Future<Output = Result<T>>,
    ) -> Result<T> {
        if let Ok(answer) = tokio::time::timeout(limit, answer).await {
            return answer.map_err(self.shared.classify);
        }
        self.leave(client);
        Err(silent(limit))
    }
}

/// Reads short answers whole, so that a failure in the middle is a failure of this try.
async fn read(client: Client, location: &Path, options: GetOptions) -> Result<GetResult> {
    let found = client.get_opts(location, options).await?;
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

impl Debug for RetryStore {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        Display::fmt(self, f)
    }
}

impl Display for RetryStore {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        Display::fmt(&self.client(), f)
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
        let shares = 1 + payload.content_length() as u64 / WHOLE_BYTES;
        let limit = self.shared.retry_limits.request * u32::try_from(shares).unwrap_or(u32::MAX);
        self.tried_within(limit, |client| {
            let (payload, options) = (payload.clone(), options.clone());
            async move { client.put_opts(location, payload, options).await }
        })
        .await
    }

    async fn put_multipart_opts(
        &self,
        location: &Path,
        options: PutMultipartOptions,
    ) -> Result<Box<dyn MultipartUpload>> {
        self.tried(|client| {
            let options = options.clone();
            async move { client.put_multipart_opts(location, options).await }
        })
        .await
    }

    async fn get_opts(&self, location: &Path, options: GetOptions) -> Result<GetResult> {
        let mut found = self
            .tried(|client| read(client, location, options.clone()))
            .await?;
        if found.range.end - found.range.start > WHOLE_BYTES
            && let GetResultPayload::Stream(pieces) = found.payload
        {
            let bounded =
                stream::try_unfold((self.clone(), pieces), |(me, mut pieces)| async move {
                    let (limit, client) = (me.shared.retry_limits.request, me.client());
                    let piece = me.bounded(limit, &client, pieces.try_next()).await?;
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
        let me = self.clone();
        locations
            .and_then(move |location| {
                let me = me.clone();
                async move {
                    me.tried(|client| delete(client, location.clone())).await?;
                    Ok(location)
                }
            })
            .boxed()
    }

    fn list(&self, prefix: Option<&Path>) -> BoxStream<'static, Result<ObjectMeta>> {
        let (me, prefix) = (self.clone(), prefix.cloned());
        stream::once(async move {
            let found: Vec<ObjectMeta> = me
                .tried(|client| client.list(prefix.as_ref()).try_collect())
                .await?;
            Ok::<_, Error>(stream::iter(found.into_iter().map(Ok)))
        })
        .try_flatten()
        .boxed()
    }

    async fn list_with_delimiter(&self, prefix: Option<&Path>) -> Result<ListResult> {
        self.tried(|client| async move { client.list_with_delimiter(prefix).await })
            .await
    }

    /// Not tried again: a copy that was half done is no copy.
    async fn copy_opts(&self, from: &Path, to: &Path, options: CopyOptions) -> Result<()> {
        let client = self.client();
        let copied = client.copy_opts(from, to, options);
        self.bounded(self.shared.retry_limits.request, &client, copied)
            .await
    }

    /// Not tried again: after a lost answer nothing would be left to rename.
    async fn rename_opts(&self, from: &Path, to: &Path, options: RenameOptions) -> Result<()> {
        let client = self.client();
        let renamed = client.rename_opts(from, to, options);
        self.bounded(self.shared.retry_limits.request, &client, renamed)
            .await
    }
}

async fn delete(client: Client, location: Path) -> Result<Option<Path>> {
    let mut gone = client.delete_stream(stream::once(async { Ok(location) }).boxed());
    gone.try_next().await
}

#[cfg(test)]
mod tests;
