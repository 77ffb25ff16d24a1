//! Calls of one worker: checked, brought to the desk, answered with a picture or with a code that says what to do.

use std::time::{Duration, Instant};

use ::service::Outcome as Ended;
use contract::event::MAX_TRACE_BYTES;
use contract::job::RenderJob;
use tonic::{Request, Response, Status};
use tracing::Instrument as _;

use crate::desk::{Desk, DeskError, Drawn, Order, Origin};
use crate::wire::proto::renderer_server::Renderer;
use crate::wire::proto::{
    DrawReply, DrawRequest, Origin as OriginCode, StatusReply, StatusRequest,
};
use crate::wire::{self, Version};

/// A caller is answered this much before his own clock runs out, so that he reads why.
const ANSWER_AHEAD: Duration = Duration::from_millis(5);

/// Answers calls.
pub(super) struct Answers {
    pub(super) desk: Desk,
    pub(super) version: Version,
}

#[tonic::async_trait]
impl Renderer for Answers {
    async fn draw(&self, request: Request<DrawRequest>) -> Result<Response<DrawReply>, Status> {
        let begun = Instant::now();
        let running = self.desk.red().start("call");
        let timeout = wire::read_timeout(request.metadata());
        let answered = self.answer(request.into_inner(), timeout).await;
        running.done(answered.as_ref().map_or_else(ended, |_drawn| Ended::Ok));
        let drawn = answered?;
        let origin = match drawn.origin {
            Origin::Drawn => OriginCode::Drawn,
            Origin::Stored => OriginCode::Stored,
        };
        Ok(Response::new(DrawReply {
            picture: drawn.bytes,
            origin: origin.into(),
            duration_ms: begun.elapsed().as_millis() as u64,
            up_kg_m2: drawn.lifted.up_kg_m2,
            down_kg_m2: drawn.lifted.down_kg_m2,
        }))
    }

    async fn status(
        &self,
        _request: Request<StatusRequest>,
    ) -> Result<Response<StatusReply>, Status> {
        let condition = self.desk.condition();
        let kept = self.desk.pipeline().kept();
        Ok(Response::new(StatusReply {
            version: Some(self.version.clone().into()),
            adapter: self.desk.pipeline().name().to_owned(),
            queue_length: condition.waiting_on_demand as u32,
            in_flight: condition.in_flight as u32,
            stopping: condition.stopping,
            draws_at_once: self.desk.draws_at_once().get() as u32,
            resident_products: kept.products.into_iter().collect(),
        }))
    }
}

impl Answers {
    async fn answer(
        &self,
        request: DrawRequest,
        timeout: Option<Duration>,
    ) -> Result<Drawn, Status> {
        if let Some(quarrel) = self.version.quarrel(request.version.as_ref()) {
            tracing::warn!(quarrel, "a caller has another version");
            let text = format!("the caller does not fit this render worker: {quarrel}");
            return Err(Status::failed_precondition(text));
        }
        let encoding = wire::read_encoding(request.jpeg_quality)
            .map_err(|e| Status::invalid_argument(e.to_string()))?;
        let order = Order::on_demand(request.storing().into())
            .encoded(encoding)
            .of_part(request.part.map(Into::into));
        let trace = request.trace;
        if trace.len() > MAX_TRACE_BYTES || trace.chars().any(char::is_control) {
            return Err(Status::invalid_argument(
                "the trace is too long or not printable",
            ));
        }
        let job: RenderJob = serde_json::from_str(&request.job_json)
            .map_err(|e| Status::invalid_argument(format!("the job cannot be read: {e}")))?;
        let span = tracing::info_span!("draw", trace, job = job.digest().short());
        let drawing = self.desk.draw(&job, order).instrument(span);
        let drawn = match timeout {
            None => drawing.await,
            Some(timeout) => {
                let left = timeout.saturating_sub(ANSWER_AHEAD);
                // Nothing is begun for a caller whose time is up; what is under way ends with its last caller.
                let in_time = tokio::time::timeout(left, drawing).await;
                in_time.map_err(|_late| {
                    let text = format!("no picture within {} ms", timeout.as_millis());
                    Status::deadline_exceeded(text)
                })?
            }
        };
        drawn.map_err(|error| refusal(&error))
    }
}

/// The code of an error: what a caller does next follows from it.
fn refusal(error: &DeskError) -> Status {
    let text = error.to_string();
    let error = match error {
        DeskError::Full { retry_after, .. } => {
            let metadata = wire::retry_after(*retry_after);
            return Status::with_metadata(tonic::Code::ResourceExhausted, text, metadata);
        }
        DeskError::Stopping => return Status::unavailable(text),
        DeskError::Render(error) => error,
    };
    if error.is_bad_request() {
        // In full: it speaks of the caller's own job. Other errors may name servers and folders, the log has those.
        return Status::invalid_argument(error.in_full());
    }
    if error.is_not_found() {
        return Status::not_found(text);
    }
    if error.is_not_wanted() {
        return Status::cancelled(text);
    }
    tracing::warn!(error = error.in_full(), "a job cannot be drawn");
    if error.is_final() {
        Status::internal(text)
    } else {
        Status::aborted(text)
    }
}

fn ended(status: &Status) -> Ended {
    use tonic::Code;
    match status.code() {
        Code::ResourceExhausted => Ended::Busy,
        Code::InvalidArgument | Code::NotFound | Code::FailedPrecondition => Ended::Refused,
        Code::Cancelled | Code::DeadlineExceeded => Ended::Dropped,
        Code::Unavailable | Code::Aborted => Ended::Retryable,
        _ => Ended::Failed,
    }
}
