//! The whole way of one file, stage by stage, up to the manifest: its objects are durable when this returns.

use std::path::Path;

use contract::digest::Digest;
use contract::event::RejectReason;
use contract::manifest::{Manifest, ManifestId};
use contract::time::Period;
use storage::{Store, manifests};

use crate::error::{IngestError, Stop};
use crate::fetch::RawGranule;
use crate::plan::{PlannedGranule, Wish};
use crate::progress::{Progress, Stage};
use crate::put::{StoredGranule, StoredGrid};
use crate::rejection::Rejection;
use crate::settings::Settings;
use crate::{check, decode, encode, fetch, inspect, plan, put};

/// Times a file that changes under our hands is read again.
const MAX_READS: u32 = 3;

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
    },
    /// Nothing: it is refused.
    Rejected(Rejection),
}

/// What every file's way needs.
pub(crate) struct Pipeline<'a> {
    pub(crate) store: &'a Store,
    pub(crate) settings: &'a Settings,
    pub(crate) progress: &'a dyn Progress,
}

impl Pipeline<'_> {
    /// Takes a file as far as to the manifest.
    pub(crate) async fn prepare(
        &self,
        path: &Path,
        wish: Wish<'_>,
    ) -> Result<Prepared, IngestError> {
        for _ in 0..MAX_READS {
            match self.stages(path, wish).await {
                Ok(prepared) => return Ok(prepared),
                Err(Stop::Rejected(rejection)) => return Ok(Prepared::Rejected(rejection)),
                Err(Stop::Failed(IngestError::Changed { file })) => {
                    tracing::info!(file = %file.display(), "changed while it was read");
                }
                Err(Stop::Failed(error)) => return Err(error),
            }
        }
        let detail = "kept changing while it was read; give it when it is complete";
        Ok(Prepared::Rejected(Rejection::new(
            RejectReason::Unreadable,
            "file",
            detail,
        )))
    }

    async fn stages(&self, path: &Path, wish: Wish<'_>) -> Result<Prepared, Stop> {
        let limits = self.settings.limits;
        self.progress.stage(path, Stage::Fetch, 0, 0);
        let raw = fetch::run(path, limits).await?;
        self.progress.stage(path, Stage::Inspect, 0, 0);
        let inspected = inspect::run(raw, self.settings).await?;
        self.progress.stage(path, Stage::Plan, 0, 0);
        let mut planned = plan::run(inspected, wish, limits).await?;
        if let Some(landed) = self.landed_before(&planned, wish).await? {
            return Ok(landed);
        }
        put::raw(self.store, &planned.target.product, &planned.raw).await?;
        let mut grids = Vec::new();
        for index in 0..planned.steps.len() {
            grids.extend(self.step(path, &mut planned, index).await?);
        }
        planned.raw.check_unchanged()?;
        if grids.is_empty() {
            let detail =
                "holds no value in any step; correct fill value or valid range in a profile";
            return Err(
                Rejection::new(RejectReason::Values, &planned.variable.name, detail).into(),
            );
        }
        grids.sort_by_key(|grid| grid.step.period);
        let PlannedGranule {
            raw: RawGranule {
                sha256: raw_sha256, ..
            },
            target,
            mapping,
            ..
        } = planned;
        Ok(Prepared::Stored(StoredGranule {
            target,
            grid: mapping.grid,
            raw_sha256,
            grids,
        }))
    }

    /// One time step: decode, check, encode, put. None if it holds no value at all.
    async fn step(
        &self,
        path: &Path,
        planned: &mut PlannedGranule,
        index: usize,
    ) -> Result<Option<StoredGrid>, Stop> {
        let (number, count) = (index + 1, planned.steps.len());
        let tell = |stage| self.progress.stage(path, stage, number, count);
        tell(Stage::Decode);
        let step = planned.steps[index];
        let decoded = decode::run(planned, step).await?;
        tell(Stage::Check);
        let (quantity, product, grid) = (
            planned.target.quantity,
            planned.target.product.clone(),
            planned.mapping.grid,
        );
        let variable = planned.variable.name.clone();
        let encoded = tokio::task::spawn_blocking(move || {
            let checked = check::run(decoded, quantity, &variable)?;
            if checked.valid_cells == 0 {
                return Ok::<_, Stop>(None);
            }
            Ok(Some(encode::run(&checked, &product, &grid)?))
        })
        .await??;
        let Some(encoded) = encoded else {
            return Ok(None);
        };
        tell(Stage::Put);
        Ok(Some(put::run(self.store, encoded, &planned.raw).await?))
    }

    /// Is this very file in the product? With a profile of the caller's own it is decoded all the same, since the same
    /// bytes may mean other values by it.
    async fn landed_before(
        &self,
        planned: &PlannedGranule,
        wish: Wish<'_>,
    ) -> Result<Option<Prepared>, IngestError> {
        if wish.profile.is_some() {
            return Ok(None);
        }
        let newest = manifests::latest(self.store, &planned.target.product).await;
        let Some(newest) = newest.map_err(IngestError::storage("read the newest manifest"))? else {
            return Ok(None);
        };
        let raw_sha256 = planned.raw.sha256;
        let periods: Vec<Period> = planned.steps.iter().map(|s| s.period).collect();
        let is_there =
            !periods.is_empty() && periods.iter().all(|p| holds(&newest, *p, raw_sha256));
        let is_same =
            newest.quantity == planned.target.quantity && newest.grid == planned.mapping.grid;
        Ok((is_there && is_same).then(|| Prepared::AlreadyLanded {
            raw_sha256,
            manifest: newest.id(),
            periods,
        }))
    }
}

fn holds(manifest: &Manifest, period: Period, raw_sha256: Digest) -> bool {
    manifest
        .steps
        .iter()
        .any(|step| step.period == period && step.raw_sha256 == raw_sha256)
}
