//! The executor's way to its scheduler: requests are carried again while nobody answers.
//!
//! Ballista's executor reports what it finished once, with its next request for work, and forgets it; a report that is
//! lost on the way would leave its query waiting for ever. So a request is kept until it is answered. An answer that was
//! lost may have held tasks that nobody will work on: the scheduler is then told that this executor is gone before the
//! request is carried again, whereupon it gives away all that it had given to it.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::task::{Context, Poll};
use std::time::Duration;

use axum::body::to_bytes;
use ballista_core::serde::protobuf::ExecutorStoppedParams;
use ballista_core::serde::protobuf::scheduler_grpc_client::SchedulerGrpcClient;
use futures::future::BoxFuture;
use retry::{Backoff, Retryable as _};
use tokio::time::Instant;
use tonic::body::Body;
use tonic::codegen::{Service, StdError, http};
use tonic::transport::Channel;
use tower::ServiceExt;

use crate::state::MESSAGE_BYTES;

/// How long one request is carried: longer than a scheduler may take to be started again.
const CARRY: Backoff = Backoff {
    first_pause: Duration::from_millis(100),
    longest_pause: Duration::from_millis(500),
    attempts: None,
    limit: Some(Duration::from_mins(1)),
};
/// One attempt.
const ATTEMPT_LIMIT: Duration = Duration::from_secs(10);

/// A way to a scheduler; clones share it.
#[derive(Debug, Clone)]
pub(super) struct RetryChannel {
    channel: Channel,
    executor_id: Arc<str>,
    state: Arc<State>,
}

#[derive(Debug)]
struct State {
    begun: Instant,
    /// When the scheduler was last seen, milliseconds after `begun`, plus one; 0 before that.
    answered_ms: AtomicU64,
    /// How many requests were answered.
    answer_count: AtomicU64,
    /// Was an answer lost?
    is_doubtful: AtomicBool,
}

impl RetryChannel {
    pub(super) fn new(channel: Channel, executor_id: &str) -> Self {
        Self {
            channel,
            executor_id: executor_id.into(),
            state: Arc::new(State {
                begun: Instant::now(),
                answered_ms: AtomicU64::new(0),
                answer_count: AtomicU64::new(0),
                is_doubtful: AtomicBool::new(false),
            }),
        }
    }

    /// How long ago the scheduler was last seen, if it ever was.
    pub(super) fn silence(&self) -> Option<Duration> {
        let answered_ms = self
            .state
            .answered_ms
            .load(Ordering::Relaxed)
            .checked_sub(1)?;
        Some(
            self.state
                .begun
                .elapsed()
                .saturating_sub(Duration::from_millis(answered_ms)),
        )
    }

    /// How many requests were answered.
    pub(super) fn answer_count(&self) -> u64 {
        self.state.answer_count.load(Ordering::Relaxed)
    }

    /// Notes that the scheduler is there.
    pub(super) fn is_there(&self) {
        let now_ms = self.state.begun.elapsed().as_millis() as u64;
        self.state.answered_ms.store(now_ms + 1, Ordering::Relaxed);
    }

    /// Tells the scheduler that an executor is gone.
    pub(super) async fn tell_gone(
        &self,
        executor_id: &str,
        reason: &str,
    ) -> Result<(), tonic::Status> {
        let mut scheduler = SchedulerGrpcClient::new(self.channel.clone());
        let told = scheduler.executor_stopped(ExecutorStoppedParams {
            executor_id: executor_id.to_owned(),
            reason: reason.to_owned(),
        });
        match tokio::time::timeout(ATTEMPT_LIMIT, told).await {
            Ok(answer) => answer.map(|_told| ()),
            Err(_elapsed) => Err(tonic::Status::deadline_exceeded("no answer")),
        }
    }

    async fn carry(self, request: http::Request<Body>) -> Result<http::Response<Body>, StdError> {
        let (parts, body) = request.into_parts();
        let content = to_bytes(axum::body::Body::new(body), MESSAGE_BYTES).await?;
        let attempt = || {
            let again = Body::new(axum::body::Body::from(content.clone()));
            self.carry_once(http::Request::from_parts(parts.clone(), again))
        };
        attempt
            .retry(CARRY.pauses())
            .notify(|error, _pause| tracing::debug!(%error, "the scheduler does not answer"))
            .await
    }

    async fn carry_once(
        &self,
        request: http::Request<Body>,
    ) -> Result<http::Response<Body>, StdError> {
        if self.state.is_doubtful.load(Ordering::Relaxed) {
            self.tell_gone(&self.executor_id, "an answer of the scheduler was lost")
                .await?;
            self.state.is_doubtful.store(false, Ordering::Relaxed);
        }
        let mut channel = self.channel.clone();
        let channel = ServiceExt::<http::Request<Body>>::ready(&mut channel).await?;
        let carried = tokio::time::timeout(ATTEMPT_LIMIT, channel.call(request)).await;
        match carried {
            Ok(Ok(answer)) => {
                self.is_there();
                self.state.answer_count.fetch_add(1, Ordering::Relaxed);
                Ok(answer)
            }
            Ok(Err(error)) => {
                self.state.is_doubtful.store(true, Ordering::Relaxed);
                Err(error.into())
            }
            Err(elapsed) => {
                self.state.is_doubtful.store(true, Ordering::Relaxed);
                Err(elapsed.into())
            }
        }
    }
}

impl Service<http::Request<Body>> for RetryChannel {
    type Response = http::Response<Body>;
    type Error = StdError;
    type Future = BoxFuture<'static, Result<Self::Response, Self::Error>>;

    fn poll_ready(&mut self, _context: &mut Context<'_>) -> Poll<Result<(), Self::Error>> {
        Poll::Ready(Ok(()))
    }

    fn call(&mut self, request: http::Request<Body>) -> Self::Future {
        Box::pin(self.clone().carry(request))
    }
}
