//! The service that stores observations as they come: messages of a topic in, stored observations out.
//!
//! A message is finished after its observations are durable. A store that is away is waited for; a message that cannot
//! be understood, or holds what cannot be stored, becomes a `granule.rejected` and holds up nobody.

use std::future::Future;
use std::sync::Arc;
use std::time::Duration;

use contract::event::{Body, Event, RejectReason};
use contract::observation::Observation;
use contract::topic::Topic;
use futures::FutureExt as _;
use retry::Backoff;
use service::{Outcome, Red};
use storage::StorageError;
use storage::log::{EventLog, Finished, Message};

use crate::error::{ErrorClass, ObservationError};
use crate::store::ObservationStore;

const GROUP: &str = "observations";
/// Messages taken at a time, each of at most a mebibyte and a thousand observations.
const MESSAGES: usize = 16;
/// Longest wait for a message; then whether to stop is looked at.
const WAIT: Duration = Duration::from_secs(1);
/// Longest detail of a refusal, characters.
const MAX_DETAIL_CHARS: usize = 300;

/// Stores the observations of the event log.
pub struct ObservationService {
    log: Arc<dyn EventLog>,
    store: Arc<dyn ObservationStore>,
    red: Red,
}

/// A message and what it holds.
struct Taken {
    message: Message,
    trace: String,
    /// The event it was, with its observations; or why it is refused.
    content: Result<(Event, Vec<Observation>), String>,
}

impl ObservationService {
    /// A service that has not started; it counts the operation `observation`.
    pub fn new(log: Arc<dyn EventLog>, store: Arc<dyn ObservationStore>, red: Red) -> Self {
        Self { log, store, red }
    }

    /// Can messages be read and observations be stored now?
    pub async fn ready(&self) -> Result<(), ObservationError> {
        let (log, store) = tokio::join!(self.log.ready(), self.store.ready());
        log?;
        store
    }

    /// Stores observations until `stop` is ready; what was begun is finished then, unless the store is away.
    ///
    /// # Errors
    /// The log is not set up as it must be. Everything that may pass is waited for.
    pub async fn run(&self, stop: impl Future<Output = ()>) -> Result<(), StorageError> {
        let stop = stop.shared();
        let mut pauses = Backoff::default().pauses();
        loop {
            let error = match self.read(stop.clone()).await {
                Ok(()) => return Ok(()),
                Err(error) if error.is_retryable() => error,
                Err(error) => return Err(error),
            };
            let pause = pauses.next().unwrap_or(WAIT);
            tracing::warn!(%error, "the log of observations broke off; joining again");
            tokio::select! {
                () = stop.clone() => return Ok(()),
                () = tokio::time::sleep(pause) => {}
            }
        }
    }

    /// Reads as one member of the group until `stop`, or until the log fails.
    async fn read(&self, stop: impl Future<Output = ()> + Clone) -> Result<(), StorageError> {
        let mut reader = tokio::select! {
            () = stop.clone() => return Ok(()),
            joined = self.log.join(Topic::Observation, GROUP) => joined?,
        };
        loop {
            let messages = tokio::select! {
                () = stop.clone() => break,
                messages = reader.next(MESSAGES, WAIT) => messages?,
            };
            if messages.is_empty() {
                continue;
            }
            let taken: Vec<Taken> = messages.into_iter().map(Taken::of).collect();
            let running = self.red.start("observation");
            tokio::select! {
                refusals = self.store_all(&taken) => {
                    let is_refused = refusals.iter().any(Option::is_some);
                    reader.finish(finished(&taken, refusals)).await?;
                    running.done(if is_refused { Outcome::Refused } else { Outcome::Ok });
                }
                // They come again to another member: storing twice changes nothing.
                () = waited_for_long(stop.clone()) => break,
            }
        }
        reader.leave().await
    }

    /// Stores what messages hold, all at once if that is possible; for each the reason of its refusal, if it is refused.
    async fn store_all(&self, taken: &[Taken]) -> Vec<Option<String>> {
        let rows = |taken: &Taken| match &taken.content {
            Ok((_, rows)) => rows.clone(),
            Err(_) => vec![],
        };
        let together: Vec<Observation> = taken.iter().flat_map(rows).collect();
        let all = self.upsert(&together, taken).await;
        let mut refusals = vec![];
        for one in taken {
            let refusal = match (&one.content, &all) {
                (Err(reason), _) => Some(reason.clone()),
                (Ok(_), Ok(())) => None,
                // One of them cannot be stored: find out which.
                (Ok((_, rows)), Err(_)) => self.upsert(rows, std::slice::from_ref(one)).await.err(),
            };
            if let Some(reason) = &refusal {
                let origin = one.message.origin;
                tracing::warn!(trace = %one.trace, %origin, reason, "observations are refused");
            }
            refusals.push(refusal);
        }
        refusals
    }

    /// Stores rows, however long the store is away; or says why they cannot be stored.
    async fn upsert(&self, rows: &[Observation], taken: &[Taken]) -> Result<(), String> {
        let trace = taken.first().map_or("", |first| first.trace.as_str());
        for pause in Backoff::default().pauses() {
            match self.store.upsert(rows).await {
                Ok(counts) => {
                    let crate::Counts {
                        new,
                        replaced,
                        same,
                    } = counts;
                    tracing::debug!(
                        trace,
                        messages = taken.len(),
                        new,
                        replaced,
                        same,
                        "stored observations"
                    );
                    return Ok(());
                }
                Err(error) if error.class() == ErrorClass::BadRequest => {
                    return Err(error.to_string());
                }
                Err(error) => {
                    // A fault of ours is waited for too: refusing would lose what is sound.
                    tracing::warn!(trace, %error, "observations cannot be stored now; trying again");
                    tokio::time::sleep(pause).await;
                }
            }
        }
        unreachable!("pauses never end")
    }
}

/// How long messages that were begun may still take when the service is to stop.
const LAST_MESSAGES: Duration = Duration::from_secs(10);

async fn waited_for_long(stop: impl Future<Output = ()>) {
    stop.await;
    tokio::time::sleep(LAST_MESSAGES).await;
}

impl Taken {
    fn of(message: Message) -> Self {
        let content = match message.event() {
            Ok(Event {
                body: Body::Observations { observations },
                schema,
                trace,
                noticed,
            }) => {
                let event = Event {
                    body: Body::Observations {
                        observations: vec![],
                    },
                    schema,
                    trace,
                    noticed,
                };
                Ok((event, observations))
            }
            Ok(other) => Err(format!(
                "a {} where an observation belongs; send it to its own topic",
                other.body.topic()
            )),
            Err(error) => Err(error.to_string()),
        };
        let trace = match &content {
            Ok((event, _)) => event.trace.clone(),
            Err(_) => message.origin.to_string(),
        };
        Self {
            message,
            trace,
            content,
        }
    }
}

/// Messages with what follows from them: a refusal, or nothing.
fn finished(taken: &[Taken], refusals: Vec<Option<String>>) -> Vec<Finished> {
    let one = |(taken, refusal): (&Taken, Option<String>)| {
        let origin = taken.message.origin;
        let body = |reason: String| Body::GranuleRejected {
            path: origin.to_string(),
            reason: RejectReason::Message,
            detail: reason.chars().take(MAX_DETAIL_CHARS).collect(),
            attempt: 1,
            origin: Some(origin),
        };
        let follows = refusal.map(body).map(|body| match &taken.content {
            Ok((event, _)) => event.followed_by(body),
            Err(_) => Event::new(taken.trace.clone(), body),
        });
        Finished {
            origin,
            follows: follows.into_iter().collect(),
        }
    };
    taken.iter().zip(refusals).map(one).collect()
}
