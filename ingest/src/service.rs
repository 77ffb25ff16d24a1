//! The ingest service: notices from the event log in, landed products and their events out.
//!
//! The offset follows the events, which follow the durable objects. After a crash the notices of the last group are
//! read again: files that had landed are found in their manifests and only their events are told again.

use std::future::Future;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use contract::event::{Body, Event, RejectReason};
use contract::product::ProductId;
use storage::Store;
use storage::log::EventLog;

use crate::error::IngestError;
use crate::land::{self, Order};
use crate::outcome::Outcome;
use crate::plan::Wish;
use crate::profile::Profile;
use crate::progress::Progress;
use crate::rejection::Rejection;
use crate::settings::Settings;

const TOPIC: &str = "granule.notice";
const GROUP: &str = "ingest";
/// Notices taken at a time.
const NOTICES: usize = 64;
/// Tries of a group whose failure may pass, and the pause before the second; it doubles from try to try.
const MAX_TRIES: u32 = 5;
const FIRST_PAUSE: Duration = Duration::from_millis(100);

/// The ingest service over a store and an event log.
#[derive(Clone)]
pub struct IngestService {
    store: Store,
    log: Arc<dyn EventLog>,
    settings: Settings,
}

/// A notice as it came, or why it cannot be followed.
struct Notice {
    path: PathBuf,
    profile: Result<Option<Profile>, Rejection>,
    product: Option<ProductId>,
    trace: String,
}

impl IngestService {
    /// A service that has not started.
    pub fn new(store: Store, log: Arc<dyn EventLog>, settings: Settings) -> Self {
        Self {
            store,
            log,
            settings,
        }
    }

    /// Appends a notice for each file.
    pub async fn notify(
        &self,
        files: &[PathBuf],
        profile: Option<&str>,
        product: Option<&ProductId>,
    ) -> Result<(), IngestError> {
        for file in files {
            let body = Body::GranuleNotice {
                path: file.display().to_string(),
                profile: profile.map(str::to_owned),
                product: product.cloned(),
            };
            let event = Event::new(land::trace(file), body);
            self.log
                .append(&event)
                .await
                .map_err(IngestError::storage("append a notice"))?;
        }
        Ok(())
    }

    /// Lands every file that there is a notice for, and returns.
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

    /// Lands files as notices come, until `stop` is ready; a group that was begun is finished.
    pub async fn run(
        &self,
        poll: Duration,
        progress: &dyn Progress,
        stop: impl Future<Output = ()>,
    ) -> Result<(), IngestError> {
        tokio::pin!(stop);
        loop {
            self.drain(progress).await?;
            tokio::select! {
                () = &mut stop => return Ok(()),
                () = tokio::time::sleep(poll) => {}
            }
        }
    }

    async fn next_group(&self, progress: &dyn Progress) -> Result<Vec<Outcome>, IngestError> {
        let mut pause = FIRST_PAUSE;
        for attempt in 1.. {
            match self.try_group(progress).await {
                Err(error) if error.is_retryable() && attempt < MAX_TRIES => {
                    tracing::warn!(%error, attempt, "ingest will try again");
                    tokio::time::sleep(pause).await;
                    pause *= 2;
                }
                other => return other,
            }
        }
        unreachable!("the last try returns")
    }

    async fn try_group(&self, progress: &dyn Progress) -> Result<Vec<Outcome>, IngestError> {
        let read = IngestError::storage("read notices");
        let from = self
            .log
            .committed(TOPIC, GROUP)
            .await
            .map_err(IngestError::storage("read the offset"))?;
        let events = self.log.read(TOPIC, from, NOTICES).await.map_err(read)?;
        let Some((last, _)) = events.last() else {
            return Ok(Vec::new());
        };
        let next = last + 1;
        let notices: Vec<Notice> = events
            .into_iter()
            .filter_map(|(_, event)| notice(event))
            .collect();
        let mut outcomes = Vec::with_capacity(notices.len());
        // Orders in a row whose profile is known land together.
        for run in notices.chunk_by(|a, b| a.profile.is_ok() && b.profile.is_ok()) {
            outcomes.extend(self.follow(run, progress).await?);
        }
        self.log
            .commit(TOPIC, GROUP, next)
            .await
            .map_err(IngestError::storage("commit the offset"))?;
        Ok(outcomes)
    }

    async fn follow(
        &self,
        notices: &[Notice],
        progress: &dyn Progress,
    ) -> Result<Vec<Outcome>, IngestError> {
        if let [
            Notice {
                path,
                profile: Err(rejection),
                trace,
                ..
            },
        ] = notices
        {
            let outcome = Outcome::rejected(path.clone(), rejection.clone());
            let event = Event::new(trace.clone(), outcome.event(None, 1));
            self.log
                .append(&event)
                .await
                .map_err(IngestError::storage("append an event"))?;
            progress.done(&outcome);
            return Ok(vec![outcome]);
        }
        let orders: Vec<Order<'_>> = notices.iter().map(Notice::order).collect();
        land::land_orders(
            &self.store,
            self.log.as_ref(),
            &self.settings,
            &orders,
            progress,
        )
        .await
    }
}

impl Notice {
    fn order(&self) -> Order<'_> {
        let profile = self.profile.as_ref().ok().and_then(Option::as_ref);
        let wish = Wish {
            profile,
            product: self.product.as_ref(),
        };
        Order {
            path: self.path.clone(),
            wish,
            trace: self.trace.clone(),
        }
    }
}

fn notice(event: Event) -> Option<Notice> {
    let Body::GranuleNotice {
        path,
        profile,
        product,
    } = event.body
    else {
        return None;
    };
    let profile = profile.map(|name| Profile::find(&name)).transpose();
    let refused =
        |e: IngestError| Rejection::new(RejectReason::NoVariable, "profile", e.to_string());
    Some(Notice {
        path: PathBuf::from(path),
        profile: profile.map_err(refused),
        product,
        trace: event.trace,
    })
}
