//! The whole way of one file, stage by stage, up to the manifest: its objects are durable when this returns.

pub(crate) mod metrics;
mod observing;
pub(crate) mod progress;

use std::path::Path;

use contract::digest::Digest;
use contract::event::RejectReason;
use contract::key::ObjectKey;
use contract::manifest::{Manifest, ManifestId};
use contract::masked::MaskedCells;
use contract::notice::NoticeOrder;
use contract::product::ProductId;
use contract::time::Period;
use storage::{StorageError, Store, manifests};

use crate::commit::is_later_or_same;
use crate::error::{IngestError, Rejection, Stop, blame, boundary};
use crate::fetch::RawGranule;
use crate::fetch::source_wait::SourceWait;
use crate::limits::gates::{Gates, Seat};
use crate::limits::memory;
use crate::notice::Order;
use crate::observation::{ObservationSink, Stored};
use crate::plan::{PlannedGranule, Wish};
use crate::put::reading::Reading;
use crate::put::{StoredGranule, StoredGrid};
use crate::settings::Settings;
use crate::{check, decode, encode, fetch, inspect, observation, plan, put};
use metrics::{Metrics, ended};
use progress::{Progress, Stage};

/// Times a file that changes under our hands is read again.
const MAX_READS: u32 = 3;
/// Bytes of the beginning of a file from which a text is recognised.
const TEXT_HEAD_BYTES: usize = 256 << 10;

/// What is left to do for a file.
#[derive(Debug)]
pub(crate) enum Prepared {
    /// To commit.
    Stored(StoredGranule),
    /// Nothing: the product holds it.
    AlreadyLanded {
        raw_sha256: Digest,
        manifest: ManifestId,
        periods: Vec<Period>,
        masked: MaskedCells,
    },
    /// Nothing: files of later notices have its time.
    Superseded {
        raw_sha256: Digest,
        manifest: ManifestId,
        periods: Vec<Period>,
    },
    /// Nothing: it held observations, which are stored.
    Observed {
        dataset: ProductId,
        stored: Stored,
        masked: MaskedCells,
    },
    /// Nothing: it is refused.
    Rejected(Rejection),
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

impl Pipeline<'_> {
    /// Takes a file as far as to the manifest.
    pub(crate) async fn prepare(
        &self,
        shown: &Path,
        order: &Order,
        place: Option<NoticeOrder>,
        source_wait: &SourceWait,
    ) -> Result<Prepared, IngestError> {
        let mut was_killed = false;
        for _ in 0..MAX_READS {
            let stages =
                boundary::contained(Box::pin(self.stages(shown, order, place, source_wait)));
            let stages = stages.await;
            match stages.unwrap_or_else(|panic| Err(panic.into())) {
                Ok(prepared) => return Ok(prepared),
                Err(Stop::Rejected(rejection)) => return Ok(Prepared::Rejected(rejection)),
                Err(Stop::Failed(IngestError::Changed { .. })) => {
                    tracing::info!(file = %shown.display(), "changed while it was read");
                }
                Err(Stop::Failed(IngestError::Killed)) => {
                    tracing::warn!(file = %shown.display(), "its reader was killed");
                    was_killed = true;
                }
                Err(Stop::Failed(error)) if error.is_panic() => {
                    tracing::error!(%error, file = %shown.display(), "a fault of the program");
                    return Ok(Prepared::Rejected(blame(&error)));
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
        Ok(Prepared::Rejected(Rejection::new(reason, "file", detail)))
    }

    async fn stages(
        &self,
        shown: &Path,
        order: &Order,
        place: Option<NoticeOrder>,
        source_wait: &SourceWait,
    ) -> Result<Prepared, Stop> {
        let Self {
            settings, metrics, ..
        } = self;
        self.progress.stage(shown, Stage::Fetch, 0, 0);
        let fetched = fetch::run(&order.location, &order.expected, settings);
        let raw = metrics.timed("fetch", source_wait.during(fetched)).await?;
        metrics.fetched(raw.size_bytes);
        let seat = self.gates.seat().await;
        let read = self
            .read(shown, raw.clone(), order.wish(), (place, seat))
            .await;
        match read {
            // Whatever is wrong with a file that changed meanwhile may be right the next time.
            Err(Stop::Rejected(rejection)) => {
                raw.check_unchanged()?;
                Err(rejection.into())
            }
            other => other,
        }
    }

    async fn read(
        &self,
        path: &Path,
        raw: RawGranule,
        wish: Wish<'_>,
        (place, seat): (Option<NoticeOrder>, Seat<'_>),
    ) -> Result<Prepared, Stop> {
        let metrics = self.metrics;
        if let Some(format) = observation::recognise_text(&raw.head(TEXT_HEAD_BYTES).await?) {
            let _pass = seat.with_memory(memory::of_text(raw.size_bytes)).await;
            return self.observe_text(format, raw, wish).await;
        }
        self.progress.stage(path, Stage::Inspect, 0, 0);
        let inspected = metrics
            .timed("inspect", inspect::run(raw, self.settings))
            .await?;
        if wish.profile.is_none() && observation::recognise(&inspected.description).is_some() {
            let needed = memory::of_observations(&inspected.description);
            let _pass = seat.with_memory(needed).await;
            return self.observe(inspected, wish).await;
        }
        self.progress.stage(path, Stage::Plan, 0, 0);
        let planned = plan::run(inspected, wish, self.settings);
        let planned = metrics.timed("plan", planned).await?;
        let newest = self.newest(&planned).await?;
        let nothing_to_do = newest
            .as_ref()
            .and_then(|newest| nothing_to_do(newest, &planned, wish, place));
        // Also of a file that is there: what is stored of it is compared, and replaced if it is damaged.
        put::raw(self.store, &planned.target.product, &planned.raw).await?;
        if let Some(landed) = nothing_to_do {
            return Ok(landed);
        }
        let _pass = seat.with_memory(memory::of_grids(&planned)).await;
        let (granule, reading) = self.grids(path, planned, newest.as_ref()).await?;
        match reading.put(self.store, &granule.target.product).await {
            // A program that reads otherwise under the same version noted it: the file lands all the same.
            Err(error @ StorageError::Conflict { .. }) => {
                tracing::warn!(%error, file = %path.display(), "was read as something else before");
            }
            noted => noted.map_err(IngestError::storage("note a reading"))?,
        }
        Ok(Prepared::Stored(granule))
    }

    /// Reads a file that landed before as it would be read now: its frames become durable, and are noted.
    pub(crate) async fn reread(
        &self,
        shown: &Path,
        raw: RawGranule,
        wish: Wish<'_>,
    ) -> Result<Reading, Stop> {
        let reread = boundary::contained(Box::pin(self.reread_stages(shown, raw, wish))).await;
        match reread.unwrap_or_else(|panic| Err(panic.into())) {
            Err(Stop::Failed(error)) if error.is_panic() => Err(blame(&error).into()),
            other => other,
        }
    }

    async fn reread_stages(
        &self,
        shown: &Path,
        raw: RawGranule,
        wish: Wish<'_>,
    ) -> Result<Reading, Stop> {
        let seat = self.gates.seat().await;
        self.progress.stage(shown, Stage::Inspect, 0, 0);
        let inspected = inspect::run(raw, self.settings).await?;
        let planned = plan::run(inspected, wish, self.settings).await?;
        let newest = self.newest(&planned).await?;
        let _pass = seat.with_memory(memory::of_grids(&planned)).await;
        let (granule, reading) = self.grids(shown, planned, newest.as_ref()).await?;
        reading
            .put(self.store, &granule.target.product)
            .await
            .map_err(IngestError::storage("note a reading"))?;
        Ok(reading)
    }

    /// All steps of a file that hold a value, and what is noted of them.
    async fn grids(
        &self,
        path: &Path,
        mut planned: PlannedGranule,
        newest: Option<&Manifest>,
    ) -> Result<(StoredGranule, Reading), Stop> {
        let (mut grids, mut masked) = (Vec::new(), MaskedCells::default());
        for index in 0..planned.steps.len() {
            let (grid, own) = self.step(path, &mut planned, index, newest).await?;
            grids.extend(grid);
            masked = masked + own;
        }
        planned.raw.check_unchanged()?;
        if grids.is_empty() {
            let gap = if masked.is_none() { "" } else { " (" };
            let end = if masked.is_none() { "" } else { ")" };
            let detail = match &planned.quality {
                None => format!(
                    "holds no value in any step{gap}{masked}{end}; correct fill value or valid range in a profile"
                ),
                Some(quality) => format!(
                    "holds no value in any step that is good enough by {:?}{gap}{masked}{end}; correct fill value, valid range or [quality] in a profile",
                    quality.variable
                ),
            };
            return Err(
                Rejection::new(RejectReason::Values, &planned.variable.name, detail).into(),
            );
        }
        grids.sort_by_key(|grid| grid.step.period);
        let steps = grids.iter().map(|grid| grid.step.clone()).collect();
        let PlannedGranule {
            raw: RawGranule {
                sha256: raw_sha256, ..
            },
            target,
            mapping,
            recipe,
            assumptions,
            ..
        } = planned;
        let mut reading = Reading::new(recipe, &target, mapping.grid, steps);
        reading.assumptions.clone_from(&assumptions);
        let granule = StoredGranule {
            target,
            grid: mapping.grid,
            raw_sha256,
            grids,
            assumptions,
            masked,
            asked_by: None,
            order: None,
        };
        Ok((granule, reading))
    }

    /// One time step: decode, check, encode, put; and what was masked in it. None if it holds no value at all.
    async fn step(
        &self,
        path: &Path,
        planned: &mut PlannedGranule,
        index: usize,
        newest: Option<&Manifest>,
    ) -> Result<(Option<StoredGrid>, MaskedCells), Stop> {
        let (number, count) = (index + 1, planned.steps.len());
        let tell = |stage| self.progress.stage(path, stage, number, count);
        tell(Stage::Decode);
        let step = planned.steps[index];
        let decoded = self
            .metrics
            .timed("decode", decode::run(planned, step))
            .await?;
        tell(Stage::Check);
        let (quantity, product, grid) = (
            planned.target.quantity,
            planned.target.product.clone(),
            planned.mapping.grid,
        );
        let variable = planned.variable.name.clone();
        let metrics = self.metrics.clone();
        let (encoded, masked) = tokio::task::spawn_blocking(move || {
            let running = metrics.start("check");
            let checked = check::run(decoded, quantity, &variable).map_err(Stop::from);
            running.done(ended(&checked));
            let checked = checked?;
            if checked.valid_cells == 0 {
                return Ok::<_, Stop>((None, checked.masked));
            }
            let running = metrics.start("encode");
            let encoded = encode::run(&checked, &product, &grid).map_err(Stop::from);
            running.done(ended(&encoded));
            encoded.map(|encoded| (Some(encoded), checked.masked))
        })
        .await??;
        let Some(encoded) = encoded else {
            return Ok((None, masked));
        };
        tell(Stage::Put);
        let there = newest.and_then(|newest| frame_of(newest, encoded.period));
        let put = async { Ok(put::run(self.store, encoded, &planned.raw, &grid, there).await?) };
        let stored = self.metrics.timed("put", put).await?;
        Ok((Some(stored), masked))
    }

    /// The newest version of the product that a file is of.
    async fn newest(&self, planned: &PlannedGranule) -> Result<Option<Manifest>, IngestError> {
        let newest = manifests::latest(self.store, &planned.target.product).await;
        newest.map_err(IngestError::storage("read the newest manifest"))
    }
}

/// Is this very file in the product, or are files of later notices in all of its places? With a profile of the caller's
/// own it is decoded all the same, since the same bytes may mean other values by it.
fn nothing_to_do(
    newest: &Manifest,
    planned: &PlannedGranule,
    wish: Wish<'_>,
    place: Option<NoticeOrder>,
) -> Option<Prepared> {
    if wish.profile.is_some()
        || planned.steps.is_empty()
        || newest.quantity != planned.target.quantity
        || newest.grid != planned.mapping.grid
    {
        return None;
    }
    let raw_sha256 = planned.raw.sha256;
    let periods: Vec<Period> = planned.steps.iter().map(|s| s.period).collect();
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
    let manifest = newest.id();
    Some(if is_superseded {
        Prepared::Superseded {
            raw_sha256,
            manifest,
            periods,
        }
    } else {
        Prepared::AlreadyLanded {
            raw_sha256,
            manifest,
            periods,
            masked,
        }
    })
}

/// The frame that a version has for a period.
fn frame_of(manifest: &Manifest, period: Period) -> Option<&ObjectKey> {
    let index = manifest.step_of(period)?;
    Some(&manifest.steps[index].frame)
}
