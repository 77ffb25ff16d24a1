//! Jobs that nobody waits for: read from the log, drawn when nothing more urgent is, told of once they are stored.

use std::sync::Arc;
use std::time::{Duration, Instant};

use ::service::{Outcome as Ended, Stop};
use contract::event::{Body, Event, RejectReason};
use contract::job::RenderJob;
use contract::topic::Topic;
use futures::FutureExt as _;
use futures::stream::{FuturesUnordered, StreamExt as _};
use render::RenderError;
use retry::Backoff;
use storage::StorageError;
use storage::log::{EventLog, Finished, Message};
use tracing::Instrument as _;

use crate::desk::{Desk, DeskError, Drawn, Order};
use crate::error::DrawError;

/// Group of readers that share the jobs.
pub const GROUP: &str = "render";
/// How long a reader with nothing to do waits for a message.
const IDLE_WAIT: Duration = Duration::from_millis(500);
/// How long one waits that has jobs under way, which may end meanwhile.
const BUSY_WAIT: Duration = Duration::from_millis(10);
/// Longest text of a failure in an event, bytes.
const MOST_FAILURE_BYTES: usize = 2000;

/// Reads `render.job`, writes `render.done`.
pub struct BatchService {
    desk: Desk,
    log: Arc<dyn EventLog>,
    drain: Duration,
}

impl BatchService {
    /// A reader that draws at `desk`; jobs under way have `drain` to end when it is asked to stop.
    pub fn new(desk: Desk, log: Arc<dyn EventLog>, drain: Duration) -> Self {
        Self { desk, log, drain }
    }

    /// Draws until asked to stop. A log that goes away is waited for; what was not finished comes again.
    ///
    /// # Errors
    /// The log is not set up as it must be.
    pub async fn run(self, stop: Stop) -> Result<(), StorageError> {
        let mut pauses = Backoff::default().pauses();
        while !stop.is_said() {
            let begun = Instant::now();
            let error = match self.read(&stop).await {
                Ok(()) => return Ok(()),
                Err(error) if error.is_retryable() => error,
                Err(error) => return Err(error),
            };
            tracing::warn!(%error, "render jobs cannot be read; trying again");
            if begun.elapsed() > Duration::from_mins(1) {
                pauses = Backoff::default().pauses();
            }
            let pause = pauses.next().unwrap_or(IDLE_WAIT);
            tokio::select! {
                () = stop.said() => {}
                () = tokio::time::sleep(pause) => {}
            }
        }
        Ok(())
    }

    /// Can jobs be read now?
    pub async fn ready(&self) -> Result<(), StorageError> {
        self.log.ready().await
    }

    async fn read(&self, stop: &Stop) -> Result<(), StorageError> {
        let at_once = self.desk.draws_at_once().get();
        let mut reader = self.log.join(Topic::RenderJob, GROUP).await?;
        let mut work = FuturesUnordered::new();
        while !stop.is_said() {
            let free = at_once - work.len();
            let wait = if work.is_empty() {
                IDLE_WAIT
            } else {
                BUSY_WAIT
            };
            if free > 0 {
                for message in reader.next(free, wait).await? {
                    work.push(self.deal_with(message));
                }
            }
            if let Ok(Some(first)) = tokio::time::timeout(BUSY_WAIT, work.next()).await {
                let mut done = vec![first];
                while let Some(Some(next)) = work.next().now_or_never() {
                    done.push(next);
                }
                reader.finish(done).await?;
            }
        }
        let until = tokio::time::Instant::now() + self.drain;
        while let Ok(Some(done)) = tokio::time::timeout_at(until, work.next()).await {
            reader.finish(vec![done]).await?;
        }
        reader.leave().await
    }

    async fn deal_with(&self, message: Message) -> Finished {
        let Message { origin, .. } = message;
        let follows = match message.event() {
            Ok(event) => match event.body {
                Body::RenderJob { ref job } => {
                    let span = tracing::info_span!("render.job", trace = event.trace, %origin);
                    self.drawn(&event, job).instrument(span).await
                }
                _ => event.followed_by(rejected(&message, "it is no render job".to_owned())),
            },
            Err(error) => Event::new(String::new(), rejected(&message, error.to_string())),
        };
        Finished {
            origin,
            follows: vec![follows],
        }
    }

    /// Draws and stores until it is done or it is known that it cannot be.
    async fn drawn(&self, event: &Event, job: &RenderJob) -> Event {
        let begun = Instant::now();
        let running = self.desk.red().start("job");
        let mut failure = None;
        for pause in Backoff::default().pauses() {
            match self.draw_and_keep(job).await {
                Ok(()) => break,
                Err(error) if error.is_final() => {
                    tracing::warn!(error = error.in_full(), "a job cannot be drawn");
                    failure = Some(shortened(error.to_string()));
                    break;
                }
                Err(error) => {
                    tracing::warn!(error = error.in_full(), "not drawn yet; trying again");
                    tokio::time::sleep(pause).await;
                }
            }
        }
        running.done(if failure.is_none() {
            Ended::Ok
        } else {
            Ended::Failed
        });
        event.followed_by(Body::RenderDone {
            key: job.key(),
            duration_ms: begun.elapsed().as_millis() as u64,
            failure,
        })
    }

    async fn draw_and_keep(&self, job: &RenderJob) -> Result<(), Arc<DrawError>> {
        let Drawn { bytes, kept, .. } = match self.desk.draw(job, Order::batch()).await {
            Ok(drawn) => drawn,
            Err(DeskError::Render(error)) => return Err(error),
            // The batch is not counted, and it stops by itself: both are passing.
            Err(DeskError::Full { .. } | DeskError::Stopping) => {
                return Err(Arc::new(RenderError::NotWanted.into()));
            }
        };
        if !kept {
            self.desk.keep(job, bytes).await?;
        }
        Ok(())
    }
}

fn rejected(message: &Message, detail: String) -> Body {
    tracing::warn!(origin = %message.origin, detail, "a message is no render job");
    Body::GranuleRejected {
        path: message.origin.to_string(),
        reason: RejectReason::Message,
        detail: shortened(detail),
        attempt: 1,
        origin: Some(message.origin),
    }
}

fn shortened(mut text: String) -> String {
    let end = (0..=MOST_FAILURE_BYTES.min(text.len())).rev();
    let end = end.into_iter().find(|end| text.is_char_boundary(*end));
    text.truncate(end.unwrap_or(0));
    text
}
