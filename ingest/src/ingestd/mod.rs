//! The ingest service: notices from the event log in, landed products and their events out.
//!
//! The event of a notice is appended in the same step in which the notice's offset moves, after the file's objects are
//! durable. After a crash unfinished notices come again; files that had landed are found in their manifests, and only what
//! is untold is told ([`crate::commit::landing_note`]). Whatever fails around the service is waited for; no notice is refused
//! because a store, the log or a disk was away.

mod health;
mod publish_queue;
mod retry;
mod settings;
mod shift;
mod work;

use std::future::Future;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use ::retry::Backoff;
use contract::event::Event;
use contract::key::ObjectKey;
use contract::product::ProductId;
use contract::time::TimeMs;
use contract::topic::Topic;
use futures::FutureExt as _;
use service::{Part, Readiness, Report};
use storage::Store;
use storage::log::{EventLog, Finished};

use crate::notice::answer::Asked;
use crate::error::IngestError;
use crate::limits::gates::Gates;
use crate::land::{self, COMMIT_FILES};
use crate::pipeline::metrics::Metrics;
use crate::notice::notice_body;
use crate::observation::ObservationSink;
use crate::notice::Outcome;
use crate::pipeline::Pipeline;
use crate::pipeline::progress::Progress;
use crate::settings::Settings;
use health::Health;

pub use settings::ServiceSettings;

const TOPIC: Topic = Topic::GranuleNotice;
const GROUP: &str = "ingest";
/// Attempts of a command whose failure may pass.
const MAX_ATTEMPTS: usize = 5;
/// Between two looks at a disk that is full.
const FULL_PAUSE: Duration = Duration::from_secs(2);
/// A command has read all notices when none comes for so long.
const END_WAIT: Duration = Duration::from_millis(10);
/// A session that lasted so long was no failed start: the next one is begun soon.
const SOUND_SESSION: Duration = Duration::from_secs(30);
/// How often the lag is looked up.
const LAG_PAUSE: Duration = Duration::from_secs(10);
/// Notices that are appended in one step.
const NOTICES_AT_ONCE: usize = 500;
/// Most bytes of a file's name that a trace shows.
const TRACE_NAME_BYTES: usize = 40;

/// The ingest service over a store and an event log; clones share metrics and limits.
#[derive(Clone)]
pub struct IngestService {
    store: Store,
    log: Arc<dyn EventLog>,
    settings: Arc<Settings>,
    gates: Arc<Gates>,
    observations: Option<Arc<dyn ObservationSink>>,
    metrics: Metrics,
    health: Health,
    parallel_notices: usize,
    drain: Duration,
}

impl IngestService {
    /// A service that has not started, with metrics that nobody sees.
    pub fn new(store: Store, log: Arc<dyn EventLog>, settings: Settings) -> Self {
        Self {
            store,
            log,
            gates: Arc::new(Gates::new(&settings)),
            settings: Arc::new(settings),
            observations: None,
            metrics: Metrics::unseen(),
            health: Health::default(),
            parallel_notices: COMMIT_FILES,
            drain: Duration::from_secs(25),
        }
    }

    /// The same service with its metrics elsewhere.
    #[must_use]
    pub fn with_metrics(self, metrics: Metrics) -> Self {
        Self { metrics, ..self }
    }

    /// The same service with a place for files of observations, which are refused without.
    #[must_use]
    pub fn with_observations(self, observations: Arc<dyn ObservationSink>) -> Self {
        Self {
            observations: Some(observations),
            ..self
        }
    }

    /// The same service with another number of notices under way at the same time, and another time to end its work in.
    #[must_use]
    pub fn with_bounds(self, parallel_notices: usize, drain: Duration) -> Self {
        Self {
            parallel_notices: parallel_notices.max(1),
            drain,
            ..self
        }
    }

    /// Appends a notice for each file.
    pub async fn notify(
        &self,
        files: &[PathBuf],
        profile: Option<&str>,
        product: Option<&ProductId>,
    ) -> Result<(), IngestError> {
        let noticed = now();
        let event = |file: &PathBuf| {
            let body = notice_body(&file.display().to_string(), profile, product, 1);
            // When it was given is when it came into the log, whose times never go back as a clock may.
            Event::new(trace(file, noticed), body)
        };
        let events: Vec<Event> = files.iter().map(event).collect();
        for some in events.chunks(NOTICES_AT_ONCE) {
            self.log
                .append(some)
                .await
                .map_err(IngestError::storage("append notices"))?;
        }
        Ok(())
    }

    /// Lands every file that there is a notice for, and returns: for commands. The same notices give the same manifests,
    /// since files are published in groups that do not depend on how fast each was read.
    pub async fn drain(&self, progress: &dyn Progress) -> Result<Vec<Outcome>, IngestError> {
        let mut all = Vec::new();
        loop {
            let group = self.next_group(progress).await?;
            if group.is_empty() {
                return Ok(all);
            }
            all.extend(group);
        }
    }

    async fn next_group(&self, progress: &dyn Progress) -> Result<Vec<Outcome>, IngestError> {
        let attempts = Some(MAX_ATTEMPTS);
        let mut pauses = Backoff {
            attempts,
            ..Backoff::default()
        }
        .pauses();
        loop {
            match self.try_group(progress).await {
                // Whoever frees the disk need not come back here to start again what was under way.
                Err(error) if error.is_disk_full() => {
                    tracing::warn!(%error, "the disk is full; ingest waits until there is room");
                    tokio::time::sleep(FULL_PAUSE).await;
                }
                Err(error) if error.is_retryable() => {
                    let Some(pause) = pauses.next() else {
                        return Err(error);
                    };
                    tracing::warn!(%error, "ingest will try again");
                    tokio::time::sleep(pause).await;
                }
                other => return other,
            }
        }
    }

    async fn try_group(&self, progress: &dyn Progress) -> Result<Vec<Outcome>, IngestError> {
        let read = IngestError::storage("read notices");
        let mut reader = self
            .log
            .join(TOPIC, GROUP)
            .await
            .map_err(IngestError::storage("join the readers of notices"))?;
        let messages = reader.next(COMMIT_FILES, END_WAIT).await.map_err(read)?;
        let mut asked = Vec::with_capacity(messages.len());
        for message in &messages {
            asked.extend(Asked::of(message, &self.settings, now()));
        }
        let answers = land::land_group(&self.pipeline(progress), &asked).await?;
        let follows = |message: &storage::log::Message| {
            let own = asked.iter().zip(&answers);
            let own = own.filter(|(asked, _)| asked.origin == Some(message.origin));
            own.filter_map(|(_, answer)| answer.event.clone()).collect()
        };
        let finished = messages.iter().map(|message| Finished {
            origin: message.origin,
            follows: follows(message),
        });
        reader
            .finish(finished.collect())
            .await
            .map_err(IngestError::storage("finish notices"))?;
        reader
            .leave()
            .await
            .map_err(IngestError::storage("leave the readers of notices"))?;
        let outcomes = answers.into_iter().map(|answer| answer.outcome);
        Ok(outcomes.inspect(|outcome| progress.done(outcome)).collect())
    }

    /// Lands files as notices come, until `stop` is ready; then what is under way is finished, within the time to drain.
    ///
    /// # Errors
    /// The event log is not set up as it must be. Everything that may pass is waited for.
    pub async fn run(
        &self,
        progress: &dyn Progress,
        stop: impl Future<Output = ()> + Send,
    ) -> Result<(), IngestError> {
        let stop = stop.shared();
        let work = async {
            let mut pauses = Backoff::default().pauses();
            loop {
                let begun = Instant::now();
                let error = match shift::run(self, progress, stop.clone()).await {
                    Ok(()) => return Ok(()),
                    Err(error) if error.is_retryable() => error,
                    Err(error) => return Err(error),
                };
                let _held_up = self.health.held_up(&error);
                tracing::warn!(%error, "the event log is away; joining it again");
                if begun.elapsed() > SOUND_SESSION {
                    pauses = Backoff::default().pauses();
                }
                tokio::select! {
                    () = stop.clone() => return Ok(()),
                    () = tokio::time::sleep(pauses.next().unwrap_or(LAG_PAUSE)) => {}
                }
            }
        };
        tokio::select! {
            ended = work => ended,
            never = self.watch_lag() => match never {},
        }
    }

    async fn watch_lag(&self) -> std::convert::Infallible {
        loop {
            match self.log.lag(TOPIC, GROUP).await {
                Ok(messages) => self.metrics.lag(messages),
                Err(error) => tracing::debug!(%error, "the lag is unknown"),
            }
            tokio::time::sleep(LAG_PAUSE).await;
        }
    }

    /// Does everything work that the service needs? Asked now, at most two seconds for each part.
    pub async fn ready(&self) -> Report {
        Report::of(self.parts().await)
    }

    fn pipeline<'a>(&'a self, progress: &'a dyn Progress) -> Pipeline<'a> {
        Pipeline {
            store: &self.store,
            settings: &self.settings,
            gates: &self.gates,
            observations: self.observations.as_deref(),
            metrics: &self.metrics,
            progress,
        }
    }
}

#[async_trait::async_trait]
impl Readiness for IngestService {
    async fn parts(&self) -> Vec<Part> {
        let probe: ObjectKey = "manifests/probe".parse().expect("a key of letters");
        let store = async {
            self.store
                .exists(&probe)
                .await
                .map(|_| "it answers".to_owned())
        };
        let log = async { self.log.ready().await.map(|()| "it answers".to_owned()) };
        let sources = self.settings.sources.clone();
        let spool = async {
            let check = tokio::task::spawn_blocking(move || sources.check());
            check.await?.map(|()| "files can be kept".to_owned())
        };
        let work = async {
            self.health
                .check()
                .map(|()| "nothing is held up".to_owned())
        };
        let (store, log, spool, work) = tokio::join!(
            Part::required("object store", store),
            Part::required("event log", log),
            Part::required::<IngestError>("spool", spool),
            Part::required("work", work),
        );
        vec![store, log, spool, work]
    }
}

/// The instant now, as events have it.
pub(crate) fn now() -> TimeMs {
    TimeMs::new(chrono::Utc::now().timestamp_millis()).expect("the clock is in the years 1 to 9999")
}

/// A trace of one notice of a file: readable, and another one each time.
fn trace(file: &std::path::Path, noticed: TimeMs) -> String {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let name: String = name
        .chars()
        .filter(char::is_ascii_graphic)
        .take(TRACE_NAME_BYTES)
        .collect();
    format!("{name}-{}-{:x}", land::trace(file), noticed.ms())
}
