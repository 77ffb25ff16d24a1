//! The whole way of one file, verb by verb: to where its objects are durable, and with others of its product into a manifest.

pub(crate) mod grids;
pub(crate) mod metrics;
mod observing;
pub(crate) mod progress;

use std::path::Path;
use std::sync::Arc;

use contract::event::RejectReason;
use contract::manifest::Manifest;
use contract::masked::MaskedCells;
use contract::notice::NoticeOrder;
use contract::quantity::Quantity;
use contract::time::Period;
use storage::{StorageError, Store, manifests};

use crate::commit::{self, Claim, Unchanged, is_later_or_same};
use crate::error::{IngestError, Rejection, Stop, blame, boundary};
use crate::fetch::{self, RawGranule};
use crate::inspect;
use crate::limits::gates::{Gates, Seat};
use crate::limits::memory;
use crate::notice::{Answer, Order, PendingNotice, Versioned};
use crate::observation::{self, ObservationSink};
use crate::pipeline::grids::FoundInAll;
use crate::plan::{self, PlannedGranule, Wish};
use crate::put::{self, StoredGranule};
use crate::settings::Settings;
use metrics::Metrics;
pub(crate) use observing::ObservedFile;
use progress::{Progress, Stage};

/// Times a file that changes under our hands is read again.
const MAX_READS: u32 = 3;
/// Bytes of the beginning of a file from which a text is recognised.
const TEXT_HEAD_BYTES: usize = 256 << 10;

/// A file whose own way is done.
#[derive(Debug)]
pub(crate) enum Prepared {
    /// To publish, with others of its product.
    ToCommit(StoredGranule),
    /// It holds observations, which are to be stored.
    ToStore(ObservedFile),
    /// It is refused.
    Answered(Answer),
    /// It is there, as far as no later files have its time. Files that were offered before it may still be on their way.
    There(Claim, Answer),
}

/// What every file's way needs.
#[derive(Clone, Copy)]
pub(crate) struct Pipeline<'a> {
    pub(crate) store: &'a Store,
    pub(crate) settings: &'a Settings,
    pub(crate) gates: &'a Gates,
    /// Where observations go; files of them are refused if there is none.
    pub(crate) observations: Option<&'a dyn ObservationSink>,
    pub(crate) metrics: &'a Metrics,
    pub(crate) progress: &'a dyn Progress,
}

/// A file on its way: its notice, what is to be done, and the name that people know it by.
#[derive(Clone, Copy)]
struct Way<'a> {
    notice: &'a Arc<PendingNotice>,
    order: &'a Order,
    shown: &'a Path,
}

impl Pipeline<'_> {
    /// Takes the file of a notice as far as to the manifest.
    pub(crate) async fn prepare(
        &self,
        notice: &Arc<PendingNotice>,
    ) -> Result<Prepared, IngestError> {
        let refused = |rejection| Ok(Prepared::Answered(notice.refused(rejection)));
        let order = match &notice.order {
            Ok(order) => order,
            Err(rejection) => return refused(rejection.clone()),
        };
        let shown = &notice.path();
        let way = Way {
            notice,
            order,
            shown,
        };
        let mut was_killed = false;
        for _ in 0..MAX_READS {
            let stages = boundary::contained(Box::pin(self.stages(way))).await;
            match stages.unwrap_or_else(|panic| Err(panic.into())) {
                Ok(prepared) => return Ok(prepared),
                Err(Stop::Rejected(rejection)) => return refused(rejection),
                Err(Stop::Failed(IngestError::Changed { .. })) => {
                    tracing::info!(file = %shown.display(), "changed while it was read");
                }
                Err(Stop::Failed(IngestError::Killed)) => {
                    tracing::warn!(file = %shown.display(), "its reader was killed");
                    was_killed = true;
                }
                Err(Stop::Failed(error)) if error.is_panic() => {
                    tracing::error!(%error, file = %shown.display(), "a fault of the program");
                    return refused(blame(&error));
                }
                Err(Stop::Failed(error)) => return Err(error),
            }
        }
        let (reason, detail) = if was_killed {
            let detail = "had its reader killed again and again, as happens where memory is short; give it in smaller pieces";
            (RejectReason::TooLarge, detail)
        } else {
            let detail = "kept changing while it was read; give it when it is complete";
            (RejectReason::Unreadable, detail)
        };
        refused(Rejection::new(reason, "file", detail))
    }

    async fn stages(&self, way: Way<'_>) -> Result<Prepared, Stop> {
        let Self {
            settings, metrics, ..
        } = self;
        // Files that the user names are here: each is read while the system has at hand what its digest was taken of.
        let seat = if settings.sources.is_guarded() {
            None
        } else {
            Some(self.gates.seat().await)
        };
        self.progress.stage(way.shown, Stage::Fetch, 0, 0);
        let fetched = fetch::run(&way.order.location, &way.order.expected, settings);
        let fetched = way.notice.source_wait.during(fetched);
        let raw = metrics.timed("fetch", fetched).await?;
        metrics.fetched(raw.size_bytes);
        let seat = match seat {
            Some(seat) => seat,
            None => self.gates.seat().await,
        };
        match self.read(way, raw.clone(), seat).await {
            // Whatever is wrong with a file that changed meanwhile may be right the next time.
            Err(Stop::Rejected(rejection)) => {
                raw.check_unchanged()?;
                Err(rejection.into())
            }
            other => other,
        }
    }

    async fn read(&self, way: Way<'_>, raw: RawGranule, seat: Seat<'_>) -> Result<Prepared, Stop> {
        let (metrics, wish) = (self.metrics, way.order.wish());
        if let Some(format) = observation::recognise_text(&raw.head(TEXT_HEAD_BYTES).await?) {
            no_index_of_observations(wish)?;
            let _pass = seat.with_memory(memory::of_text(raw.size_bytes)).await;
            return self.observe_text(format, raw, way).await;
        }
        self.progress.stage(way.shown, Stage::Inspect, 0, 0);
        let inspected = inspect::run(raw, self.settings);
        let inspected = metrics.timed("inspect", inspected).await?;
        if wish.profile.is_none() && observation::recognise(&inspected.description).is_some() {
            no_index_of_observations(wish)?;
            let needed = memory::of_observations(&inspected.description);
            let _pass = seat.with_memory(needed).await;
            return self.observe(inspected, way).await;
        }
        self.progress.stage(way.shown, Stage::Plan, 0, 0);
        let planned = plan::run(inspected, wish, self.settings);
        let planned = metrics.timed("plan", planned).await?;
        let product = planned.plan.target.product.clone();
        let newest = self.newest(&planned).await?;
        if let Some(newest) = &newest {
            self.check_is_here(newest).await?;
        }
        let unchanged = newest
            .as_ref()
            .and_then(|newest| unchanged(newest, &planned, wish, way.notice.place));
        let raw = planned.raw.clone();
        let raw = put::raw(self.store, &product, &raw);
        if let Some(unchanged) = unchanged {
            // What is stored of it is compared, and replaced if it is damaged.
            raw.await?;
            let claim = Claim::of(&unchanged.0, way.notice.place);
            let answer = commit::answer_unchanged(self.store, way.notice, unchanged, None);
            return Ok(Prepared::There(claim, answer.await?));
        }
        let _pass = seat
            .with_memory(memory::of_grids(&planned, &self.settings.limits))
            .await;
        // Whatever becomes of its values, the file is stored whole, beside them.
        let values = self.grids(way.shown, planned, newest.as_ref());
        let (stored, values) = tokio::join!(raw, values);
        stored?;
        let (reading, FoundInAll { masked, valued }) = values?;
        match reading.put(self.store, &product).await {
            // A program that reads otherwise under the same version noted it: the file lands all the same.
            Err(error @ StorageError::Conflict { .. }) => {
                tracing::warn!(%error, file = %way.shown.display(), "was read as something else before");
            }
            noted => noted.map_err(IngestError::storage("note a reading"))?,
        }
        Ok(Prepared::ToCommit(StoredGranule {
            notice: Arc::clone(way.notice),
            product,
            reading,
            masked,
            valued: valued.map(Arc::new),
        }))
    }

    /// The newest version of the product that a file is of.
    pub(crate) async fn newest(
        &self,
        planned: &PlannedGranule,
    ) -> Result<Option<Manifest>, IngestError> {
        let newest = manifests::latest(self.store, &planned.plan.target.product).await;
        newest.map_err(IngestError::storage("read the newest manifest"))
    }

    /// Does a file that was there still change nothing?
    pub(crate) async fn is_still_there(&self, claim: &Claim) -> Result<bool, IngestError> {
        let newest = manifests::latest(self.store, &claim.product).await;
        let newest = newest.map_err(IngestError::storage("read the newest manifest"))?;
        Ok(newest.is_some_and(|newest| claim.holds(&newest)))
    }

    /// Refuses a file of a product whose values lie elsewhere, or are made of others' here.
    async fn check_is_here(&self, newest: &Manifest) -> Result<(), Stop> {
        if let Some(source) = &newest.derived_from {
            let detail = format!(
                "{} is made of {source} by this program; land the file in a product of its own",
                newest.product
            );
            return Err(Rejection::new(RejectReason::Conflict, "product", detail).into());
        }
        let attached = self.store.attached_to(newest).await;
        let attached = attached.map_err(IngestError::storage("read what it is attached to"))?;
        let Some(attachment) = attached else {
            return Ok(());
        };
        let detail = format!(
            "{} is attached to {}; land the file in a product of its own",
            newest.product,
            attachment.place()
        );
        Err(Rejection::new(RejectReason::Conflict, "product", detail).into())
    }

    /// Publishes files of one product, in their order, beside what files that were offered later claim.
    pub(crate) async fn commit(
        &self,
        granules: &[StoredGranule],
        claims: &[Claim],
    ) -> Result<Vec<Answer>, IngestError> {
        let running = self.metrics.start("commit");
        let needed = granules
            .iter()
            .map(|it| memory::of_fields(&it.reading.grid));
        let _memory = self.gates.memory(needed.max().unwrap_or(0)).await;
        let work = async {
            for granule in granules {
                let shown = granule.notice.path();
                self.progress.stage(&shown, Stage::Commit, 0, 0);
            }
            commit::run(self.store, granules, claims).await
        };
        let committed = boundary::contained(work).await.flatten();
        running.done(ended(&committed));
        committed
    }
}

/// How an operation of the program ended.
fn ended<T>(done: &Result<T, IngestError>) -> service::Outcome {
    match done {
        Ok(_) => service::Outcome::Ok,
        Err(error) if error.is_retryable() => service::Outcome::Retryable,
        Err(_) => service::Outcome::Failed,
    }
}

/// Refuses observations of which an index of a dimension is asked for: all of them are read.
fn no_index_of_observations(wish: Wish<'_>) -> Result<(), Rejection> {
    let Some(first) = wish.indexes.first() else {
        return Ok(());
    };
    let detail =
        format!("holds observations, of which no index is chosen; give it without --index {first}");
    Err(Rejection::new(RejectReason::Grid, "file", detail))
}

/// Is this very file in the product, or are files of later notices in all of its places? With a profile of the caller's
/// own it is decoded all the same, since the same bytes may mean other values by it; so is one that says what codes mean where
/// the product says nothing.
fn unchanged(
    newest: &Manifest,
    planned: &PlannedGranule,
    wish: Wish<'_>,
    place: NoticeOrder,
) -> Option<(Versioned, Unchanged)> {
    let joined = newest.quantity.joined(planned.plan.target.quantity);
    let says_more =
        |joined: Quantity| newest.quantity.flags().is_empty() && !joined.flags().is_empty();
    if wish.profile.is_some()
        || planned.plan.steps.is_empty()
        || joined.is_none_or(says_more)
        || newest.grid != planned.plan.mapping.grid
        || newest.indexes != wish.indexes
    {
        return None;
    }
    let raw_sha256 = planned.raw.sha256;
    let periods: Vec<Period> = planned.plan.steps.iter().map(|s| s.period).collect();
    let orders = newest.notice_orders();
    let (mut is_superseded, mut masked) = (false, MaskedCells::default());
    for period in &periods {
        match newest.step_of(*period) {
            Some(index) if newest.steps[index].raw_sha256 == raw_sha256 => {
                masked = masked + newest.steps[index].masked.unwrap_or_default();
            }
            Some(index) if is_later_or_same(orders[index], place) => is_superseded = true,
            _ => return None,
        }
    }
    let why = if is_superseded {
        Unchanged::Superseded
    } else {
        Unchanged::Same(masked)
    };
    let version = Versioned {
        manifest: newest.id(),
        raw_sha256,
        periods,
    };
    Some((version, why))
}
