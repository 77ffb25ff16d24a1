//! Keeps derived products up with what lands: reads `granule.landed`, derives, and lets `product.derived` follow.
//!
//! What lands together in one product is derived once; each message is followed by an event of its own, with its own
//! trace. A derivation begins at the first step that changed, and one that was done already is found done, so that a
//! message that is delivered again costs and changes nothing.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use ::service::{Outcome, Part, Readiness, Red, Stop, until_there};
use async_trait::async_trait;
use contract::event::{Body, Event, RejectReason};
use contract::manifest::{Manifest, ManifestId};
use contract::product::ProductId;
use contract::topic::{Origin, Topic};
use futures::future::BoxFuture;
use prometheus::Registry;
use storage::StorageError;
use storage::log::{EventLog, Finished, Message, Reader};

use super::named_sums::NamedSums;
use crate::dependents::follow;
use crate::derive::derived;
use crate::{ComputeError, Engine, ErrorClass};

/// Derivers of this group share the products among them.
pub const GROUP: &str = "derive";
/// Most messages that are read at once.
const BATCH: usize = 64;
/// How long a read waits for a message.
const WAIT: Duration = Duration::from_millis(500);

/// Reads what landed and derives from it.
#[derive(Clone)]
pub struct Deriver {
    engine: Engine,
    log: Arc<dyn EventLog>,
    red: Red,
    sums: NamedSums,
}

/// How reading ended.
enum Ended {
    Stopped,
    /// The log was lost; whatever was not finished comes again.
    Lost(StorageError),
}

impl Deriver {
    /// Derives on this engine what is told of in this log.
    pub fn new(
        engine: Engine,
        log: Arc<dyn EventLog>,
        registry: &Registry,
    ) -> Result<Self, ComputeError> {
        let red = Red::register(registry, "deriver")?;
        let sums = NamedSums::new(engine.clone(), red.clone());
        Ok(Self {
            engine,
            log,
            red,
            sums,
        })
    }

    /// Reads until asked to stop. What fails for a reason that passes is tried again for ever.
    pub fn run(&self, stop: Stop) -> BoxFuture<'_, Result<(), ComputeError>> {
        Box::pin(async move {
            // On the heap: both are large, and whoever waits for this would carry them along.
            tokio::select! {
                ended = Box::pin(self.follow_log(&stop)) => ended,
                never = Box::pin(self.sums.run()) => match never {},
            }
        })
    }

    async fn follow_log(&self, stop: &Stop) -> Result<(), ComputeError> {
        loop {
            let join = || self.log.join(Topic::GranuleLanded, GROUP);
            let joined = until_there("event log", stop, StorageError::is_retryable, join).await?;
            let Some(reader) = joined else { return Ok(()) };
            match self.read(reader, stop).await {
                Ended::Stopped => return Ok(()),
                Ended::Lost(error) if error.is_retryable() => {
                    tracing::warn!(%error, "event log lost; joining again");
                }
                Ended::Lost(error) => return Err(error.into()),
            }
        }
    }

    /// Whether it can do its work.
    pub fn readiness(&self) -> Arc<dyn Readiness> {
        Arc::new(self.clone())
    }

    async fn read(&self, mut reader: Box<dyn Reader>, stop: &Stop) -> Ended {
        loop {
            let messages = tokio::select! {
                () = stop.said() => return leave(reader).await,
                messages = reader.next(BATCH, WAIT) => messages,
            };
            let messages = match messages {
                Ok(messages) => messages,
                Err(error) => return Ended::Lost(error),
            };
            if messages.is_empty() {
                continue;
            }
            let Some(done) = self.follow(&messages, stop).await else {
                return leave(reader).await;
            };
            let touched = touched(&done);
            if let Err(error) = reader.finish(done).await {
                return Ended::Lost(error);
            }
            for source in touched {
                self.sums.add(source);
            }
        }
    }

    /// What follows from some messages; none if it was asked to stop before that was known.
    async fn follow(&self, messages: &[Message], stop: &Stop) -> Option<Vec<Finished>> {
        let mut done = vec![];
        let mut landed: BTreeMap<ProductId, Vec<(Origin, Event)>> = BTreeMap::new();
        for message in messages {
            match message.event() {
                Ok(event) => match landed_in(&event) {
                    Some(product) => landed
                        .entry(product)
                        .or_default()
                        .push((message.origin, event)),
                    None => done.push(finished(message.origin, vec![])),
                },
                Err(error) => done.push(refused(message.origin, &error.to_string())),
            }
        }
        for (product, events) in landed {
            let manifests = self.derive(&product, &events, stop).await?;
            for (origin, event) in events {
                let bodies = manifests.iter().filter_map(derived);
                let follows = bodies.map(|body| event.followed_by(body));
                done.push(finished(origin, follows.collect()));
            }
        }
        Some(done)
    }

    /// The products that are derived from what landed in another, up to date; inner none if there are none to derive.
    async fn derive(
        &self,
        product: &ProductId,
        events: &[(Origin, Event)],
        stop: &Stop,
    ) -> Option<Vec<Manifest>> {
        let running = self.red.start("derive");
        let _sums_wait = self.sums.hold().await;
        let attempt = || follow(&self.engine, product);
        let derived = until_there("derivation", stop, ComputeError::is_retryable, attempt).await;
        for (_, event) in events {
            match &derived {
                Ok(Some(manifests)) if !manifests.is_empty() => {
                    for manifest in manifests {
                        tracing::info!(trace = event.trace, manifest = %manifest.id(), "derived");
                    }
                }
                Ok(_) => tracing::debug!(trace = event.trace, %product, "nothing to derive"),
                Err(error) => {
                    tracing::error!(trace = event.trace, %product, %error, "cannot be derived");
                }
            }
        }
        match derived {
            Ok(Some(manifests)) => {
                running.done(Outcome::Ok);
                Some(manifests)
            }
            // The guard counts it as dropped.
            Ok(None) => None,
            // It would fail again: the next granule that lands, or the operator, must mend it.
            Err(error) => {
                running.done(match error.class() {
                    ErrorClass::NotFound | ErrorClass::BadRequest => Outcome::Refused,
                    ErrorClass::Retryable => Outcome::Retryable,
                    ErrorClass::Internal => Outcome::Failed,
                });
                Some(vec![])
            }
        }
    }
}

#[async_trait]
impl Readiness for Deriver {
    async fn parts(&self) -> Vec<Part> {
        let log = async { self.log.ready().await.map(|()| "it answers".to_owned()) };
        vec![Part::required("event log", log).await]
    }
}

fn landed_in(event: &Event) -> Option<ProductId> {
    match &event.body {
        Body::GranuleLanded { manifest, .. } => Some(manifest.product.clone()),
        _ => None,
    }
}

/// Versions of fluxes whose carbon was accumulated: those that budgets are of.
fn touched(done: &[Finished]) -> BTreeSet<ManifestId> {
    let follows = done.iter().flat_map(|finished| &finished.follows);
    let flux = |event: &Event| match &event.body {
        Body::ProductDerived {
            manifest,
            derived_from,
        } => {
            let accumulated = derived_from.product.accumulated().ok()?;
            (accumulated == manifest.product).then(|| derived_from.clone())
        }
        _ => None,
    };
    follows.filter_map(flux).collect()
}

fn finished(origin: Origin, follows: Vec<Event>) -> Finished {
    Finished { origin, follows }
}

/// A message that nobody understands is told of and passed by.
fn refused(origin: Origin, detail: &str) -> Finished {
    tracing::error!(%origin, detail, "a message cannot be understood");
    let body = Body::GranuleRejected {
        path: origin.to_string(),
        reason: RejectReason::Message,
        detail: detail.chars().take(MAX_DETAIL_CHARS).collect(),
        attempt: 1,
        origin: Some(origin),
    };
    finished(origin, vec![Event::new(origin.to_string(), body)])
}

/// A refused message is not repeated whole.
const MAX_DETAIL_CHARS: usize = 500;

async fn leave(reader: Box<dyn Reader>) -> Ended {
    match reader.leave().await {
        Ok(()) => Ended::Stopped,
        Err(error) => {
            tracing::warn!(%error, "left the group without a word");
            Ended::Stopped
        }
    }
}
