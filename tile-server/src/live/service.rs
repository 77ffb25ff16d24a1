//! Follows the event log for one server.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use contract::event::{Body, Event};
use contract::manifest::ManifestId;
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::time::Period;
use contract::topic::Topic;
use retry::Backoff;
use service::Stop;
use storage::StorageError;
use storage::log::{EventLog, Follower, Message, Start};
use tokio::sync::mpsc;

use crate::catalogue::Layer;
use crate::live::seen::{Seen, Version};
use crate::live::touched;
use crate::request;
use crate::state::AppState;

/// Hot tiles drawn anew for one version.
const MOST_JOBS: usize = 64;
/// Messages taken at a time, and how long one waits for the first.
const MESSAGES: usize = 64;
const WAIT: Duration = Duration::from_millis(250);

/// Keeps one server up with what lands.
pub struct LiveService {
    state: AppState,
    log: Arc<dyn EventLog>,
    /// Products as viewers were told of them.
    seen: BTreeMap<ProductId, Seen>,
    /// Versions after which tiles were ordered, or which were there before anything was heard. A version that viewers are
    /// told of when the log is back may have its event still to come.
    ordered: BTreeMap<ProductId, Version>,
    /// What there was before anything was heard was looked at once: what is new in an empty list is new.
    has_begun: bool,
}

impl LiveService {
    pub(crate) fn new(state: AppState, log: Arc<dyn EventLog>) -> Self {
        Self {
            state,
            log,
            seen: BTreeMap::new(),
            ordered: BTreeMap::new(),
            has_begun: false,
        }
    }

    /// Follows until asked to stop. A log that goes away is waited for; of what was appended meanwhile viewers are told,
    /// but no tiles are ordered before the product's next event is heard.
    ///
    /// # Errors
    /// The log is not set up as it must be.
    pub async fn run(mut self, stop: Stop) -> Result<(), StorageError> {
        let mut pauses = Backoff::default().pauses();
        while !stop.is_said() {
            let ended = tokio::select! {
                () = stop.said() => break,
                ended = self.follow() => ended,
            };
            match ended {
                Ok(()) => {}
                Err(error) if error.is_retryable() => {
                    tracing::warn!(%error, "the event log cannot be followed; trying again");
                }
                Err(error) => return Err(error),
            }
            tokio::select! {
                () = stop.said() => break,
                () = tokio::time::sleep(pauses.next().unwrap_or(WAIT)) => {}
            }
        }
        Ok(())
    }

    async fn follow(&mut self) -> Result<(), StorageError> {
        if !self.has_begun {
            self.has_begun = true;
            self.remember_all().await;
        }
        let topics = [
            Topic::GranuleLanded,
            Topic::ProductDerived,
            Topic::RenderDone,
        ];
        let (sender, mut heard) = mpsc::channel(MESSAGES);
        let mut pumps = vec![];
        for topic in topics {
            pumps.push(pump(
                self.log.follow(topic, Start::Now).await?,
                sender.clone(),
            ));
        }
        drop(sender);
        self.catch_up().await;
        let hearing = async {
            while let Some(message) = heard.recv().await {
                match message.event() {
                    Ok(event) => self.hear(&event).await?,
                    Err(error) => {
                        tracing::warn!(origin = %message.origin, %error, "a message is passed over");
                    }
                }
            }
            Ok(())
        };
        tokio::try_join!(futures::future::try_join_all(pumps), hearing).map(|_ended| ())
    }

    async fn hear(&mut self, event: &Event) -> Result<(), StorageError> {
        match &event.body {
            Body::GranuleLanded { manifest, .. } => {
                let Some(touched) = self.new_version(event, manifest).await? else {
                    return Ok(());
                };
                self.drift(event, manifest, &touched).await
            }
            Body::ProductDerived {
                manifest,
                derived_from,
            } => {
                // The particles of the source are lifted by what was derived: its pictures are new too, at least where
                // what was derived is, which reaches from the first changed step of the source to the end.
                let Some(touched) = self.new_version(event, manifest).await? else {
                    return Ok(());
                };
                self.redraw(event, derived_from, &touched).await?;
                // A northward part that was computed drifts the particles of its eastward one.
                self.drift(event, manifest, &touched).await
            }
            Body::RenderDone {
                key, failure: None, ..
            } => {
                self.state.freshness.drawn(key);
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// What there is before anything new comes.
    async fn remember_all(&mut self) {
        match self.state.catalogue.layers().await {
            Ok(layers) => {
                for layer in layers {
                    let product = &layer.manifest.product;
                    self.seen.insert(product.clone(), Seen::of(&layer));
                    self.ordered.insert(product.clone(), version(&layer));
                }
            }
            Err(error) => {
                tracing::warn!(%error, "products are not known yet; all that comes is new");
            }
        }
    }

    /// Tells of what landed while nobody followed: of what lifts or drifts the particles of a product too.
    async fn catch_up(&mut self) {
        self.renew().await;
        let Ok(layers) = self.state.catalogue.layers().await else {
            return;
        };
        for layer in layers {
            self.tell(&layer);
        }
    }

    /// Reads the list of products anew. A store that is away is waited for: what landed is told of later, not never.
    async fn renew(&self) {
        for pause in Backoff::default().pauses() {
            match self.state.catalogue.renew().await {
                Err(error) if error.is_retryable() => tokio::time::sleep(pause).await,
                Ok(()) | Err(_) => return,
            }
        }
    }

    /// Tells viewers what is new of a product since they were told of it.
    fn tell(&mut self, layer: &Layer) {
        let product = &layer.manifest.product;
        let now = Seen::of(layer);
        now.tell(self.seen.get(product), &self.state.news);
        self.seen.insert(product.clone(), now);
    }

    /// The times that a version touches since tiles were ordered; none if that was after this version.
    fn begin_order(&mut self, layer: &Layer) -> Option<Vec<Period>> {
        let product = layer.manifest.product.clone();
        let before = self.ordered.insert(product, version(layer));
        if before.as_ref().is_some_and(|(id, _)| *id == layer.id) {
            return None;
        }
        let before = before.as_ref().map(|(_, old)| &**old);
        Some(touched(before, &layer.manifest))
    }

    /// Shows a version: the times that it touches, none if its event was heard before or it cannot be shown.
    async fn new_version(
        &mut self,
        event: &Event,
        manifest: &ManifestId,
    ) -> Result<Option<Vec<Period>>, StorageError> {
        self.renew().await;
        let layer = match self.state.catalogue.layer(manifest.product.as_str()).await {
            Ok(layer) => layer,
            Err(error) => {
                tracing::warn!(trace = event.trace, %manifest, %error, "a version cannot be shown");
                return Ok(None);
            }
        };
        self.tell(&layer);
        let Some(touched) = self.begin_order(&layer) else {
            return Ok(None);
        };
        tracing::info!(trace = event.trace, %manifest, periods = touched.len(), "a new version is shown");
        // Pictures of a flux wait for what lifts their particles.
        let waits = layer.manifest.quantity == Quantity::CarbonFlux;
        if !waits {
            if let Some(noticed) = event.noticed {
                self.state.freshness.expect_version(&layer.id, noticed);
            }
            self.order(event, &layer, &touched).await?;
        }
        Ok(Some(touched))
    }

    /// Draws anew what the derivation from `source` touches.
    async fn redraw(
        &mut self,
        event: &Event,
        source: &ManifestId,
        touched: &[Period],
    ) -> Result<(), StorageError> {
        let Ok(layer) = self.state.catalogue.layer(source.product.as_str()).await else {
            return Ok(());
        };
        if let Some(noticed) = event.noticed {
            self.state.freshness.expect_version(&layer.id, noticed);
        }
        self.tell(&layer);
        self.order(event, &layer, touched).await
    }

    /// Draws anew what drifts with this northward part of a vector, if it is one.
    async fn drift(
        &mut self,
        event: &Event,
        northward: &ManifestId,
        touched: &[Period],
    ) -> Result<(), StorageError> {
        let Some(eastward) = northward.product.eastward() else {
            return Ok(());
        };
        let Ok(layer) = self.state.catalogue.layer(eastward.as_str()).await else {
            return Ok(());
        };
        if layer.northward.is_none() {
            return Ok(());
        }
        self.tell(&layer);
        self.order(event, &layer, touched).await
    }

    async fn order(
        &self,
        event: &Event,
        layer: &Layer,
        touched: &[Period],
    ) -> Result<(), StorageError> {
        // Whoever asks for no instant sees the newest step, which may be one that has just landed.
        let is_touched = |time| {
            let time = request::shown_time(layer, time);
            touched
                .iter()
                .any(|period| period.start <= time && time <= period.end)
        };
        let hot = self
            .state
            .hot
            .of(&layer.manifest.product, MOST_JOBS, is_touched);
        let jobs: Vec<_> = hot
            .iter()
            .filter_map(|tile| request::job(layer, tile.mode, tile.view, tile.time).ok())
            .collect();
        if jobs.is_empty() {
            return Ok(());
        }
        if let Some(noticed) = event.noticed {
            for job in &jobs {
                self.state.freshness.expect_picture(job.key(), noticed);
            }
        }
        let events: Vec<Event> = jobs
            .into_iter()
            .map(|job| event.followed_by(Body::RenderJob { job: job.into() }))
            .collect();
        self.log.append(&events).await
    }
}

fn version(layer: &Layer) -> Version {
    (layer.id.clone(), Arc::clone(&layer.manifest))
}

/// Hands on what a follower brings, for as long as somebody takes it.
async fn pump(
    mut follower: Box<dyn Follower>,
    sender: mpsc::Sender<Message>,
) -> Result<(), StorageError> {
    loop {
        for message in follower.next(MESSAGES, WAIT).await? {
            if sender.send(message).await.is_err() {
                return Ok(());
            }
        }
        if sender.is_closed() {
            return Ok(());
        }
    }
}
