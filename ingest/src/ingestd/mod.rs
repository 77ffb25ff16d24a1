//! The ingest service: notices from the event log in, landed products and their events out; for as long as they come, or
//! for a command until there are none left.
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
use contract::digest::Digest;
use contract::event::Event;
use contract::key::ObjectKey;
use contract::product::ProductId;
use contract::time::TimeMs;
use contract::topic::Topic;
use futures::FutureExt as _;
use futures::future::Shared;
use service::{Part, Readiness, Report};
use storage::Store;
use storage::log::EventLog;

use crate::error::IngestError;
use crate::limits::gates::Gates;
use crate::notice::{Outcome, Wishes, notice_body};
use crate::observation::ObservationSink;
use crate::pipeline::Pipeline;
use crate::pipeline::metrics::Metrics;
use crate::pipeline::progress::Progress;
use crate::settings::Settings;
use health::Health;
use retry::Caller;

pub use settings::ServiceSettings;

const TOPIC: Topic = Topic::GranuleNotice;
const GROUP: &str = "ingest";
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
            parallel_notices: shift::GROUP_MESSAGES,
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

    /// Appends a notice for each file, with the name of a profile and a product to land in, if they are to be these.
    pub async fn notify(
        &self,
        files: &[PathBuf],
        profile: Option<&str>,
        product: Option<&ProductId>,
    ) -> Result<(), IngestError> {
        let wishes = Wishes {
            profile: profile.map(str::to_owned),
            product: product.cloned(),
            variable: None,
            indexes: vec![],
        };
        self.notify_of(files, &wishes).await
    }

    /// Appends a notice for each file, to be landed as is wished.
    pub async fn notify_of(&self, files: &[PathBuf], wishes: &Wishes) -> Result<(), IngestError> {
        let noticed = now();
        let event = |file: &PathBuf| {
            let body = notice_body(&file.display().to_string(), wishes);
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
        let mut told = Vec::new();
        let never = std::future::pending::<()>().shared();
        self.work(Caller::Command, progress, never, &mut told)
            .await?;
        Ok(told)
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
        let mut untold = Vec::new();
        tokio::select! {
            ended = self.work(Caller::Service, progress, stop.shared(), &mut untold) => ended,
            never = self.watch_lag() => match never {},
        }
    }

    /// Works on notices, from the beginning again after what may pass; `told` takes what a command is told.
    async fn work(
        &self,
        caller: Caller,
        progress: &dyn Progress,
        stop: Shared<impl Future<Output = ()> + Send>,
        told: &mut Vec<Outcome>,
    ) -> Result<(), IngestError> {
        let (mut pauses, mut times) = (Backoff::default().pauses(), 0);
        loop {
            let (begun, told_before) = (Instant::now(), told.len());
            let ended = shift::run(self, caller, progress, stop.clone(), told).await;
            let Err(error) = ended else {
                return Ok(());
            };
            if begun.elapsed() > SOUND_SESSION || told.len() > told_before {
                (pauses, times) = (Backoff::default().pauses(), 0);
            }
            times += 1;
            if !caller.begins_again(&error, times) {
                return Err(error);
            }
            let _held_up = self.health.held_up(&error);
            if error.is_disk_full() {
                tracing::warn!(%error, "the disk is full; ingest waits until there is room");
            } else {
                tracing::warn!(%error, "ingest begins again with what is not finished");
            }
            tokio::select! {
                () = stop.clone() => return Ok(()),
                () = tokio::time::sleep(pauses.next().unwrap_or(LAG_PAUSE)) => {}
            }
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
    let path = Digest::of(file.as_os_str().as_encoded_bytes());
    format!("{name}-file-{}-{:x}", path.short(), noticed.ms())
}
