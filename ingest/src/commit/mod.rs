//! [`StoredGranule`]s of one product in, one new manifest out: a reader sees all of them or none.
//!
//! The manifest is built on the newest one and published under the next number; if another writer took that number the
//! newest is read again. Everything it names is durable before. A crash before the publication leaves objects that
//! nothing names; the same files make the same objects again and land once.

pub(crate) mod landing_note;
mod mend;
mod merge;
mod replace;
mod segments;
pub(crate) mod superseded;

use contract::manifest::{MANIFEST_SCHEMA, Manifest, ManifestId};
use contract::notice::NoticeRun;
use contract::product::ProductId;
use contract::time::Period;
use retry::{Backoff, Pauses};
use storage::{StorageError, Store, manifests};

use crate::error::{IngestError, Rejection};
use crate::put::StoredGranule;
use merge::{Change, Merged};

pub(crate) use mend::mend;
pub(crate) use merge::is_later_or_same;
pub(crate) use replace::replace;
pub(crate) use segments::{MAX_SEGMENT_STEPS, MAX_SEGMENT_VALUES};

/// Lost races for the next number before the caller is told; it may go on.
const LOST_RACES: usize = 200;
/// Attempts to publish, which many writers of one product may want at the same time.
const ATTEMPTS: Backoff = Backoff::contended(LOST_RACES);

/// What became of one file.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Committed {
    Landed {
        manifest: ManifestId,
        periods: Vec<Period>,
        revised: bool,
    },
    AlreadyLanded {
        manifest: ManifestId,
        periods: Vec<Period>,
        /// Is it this file's notice that has to tell?
        is_due: bool,
    },
    /// Files of later notices have its time.
    Superseded {
        manifest: ManifestId,
        periods: Vec<Period>,
        /// The version that held it before, if its notice has still to tell of that.
        held_by: Option<ManifestId>,
    },
    Rejected(Rejection),
}

/// Publishes files of one product, in their order. Files for the same period become manifests one after the other, so
/// that each revision can be cited.
pub(crate) async fn run(
    store: &Store,
    product: &ProductId,
    granules: &[StoredGranule],
) -> Result<Vec<Committed>, IngestError> {
    let mut all = Vec::with_capacity(granules.len());
    let mut rest = granules;
    while !rest.is_empty() {
        let (group, later) = rest.split_at(merge::disjoint_prefix(rest));
        all.extend(publish(store, product, group).await?);
        rest = later;
    }
    Ok(all)
}

async fn publish(
    store: &Store,
    product: &ProductId,
    granules: &[StoredGranule],
) -> Result<Vec<Committed>, IngestError> {
    let mut notes = Notes::of(store, product, granules);
    let mut pauses = ATTEMPTS.pauses();
    loop {
        let newest = manifests::latest(store, product)
            .await
            .map_err(IngestError::storage("read the newest manifest"))?;
        let merged = merge::merge(newest.as_ref(), granules);
        let manifest = match (&newest, merged.is_changed()) {
            (Some(newest), false) => newest.clone(),
            (None, false) => return outcomes(&merged, &notes, None).await,
            (newest, true) => {
                notes.note(&merged).await?;
                let manifest = build(store, product, newest.as_ref(), &merged, granules).await?;
                match manifests::commit(store, &manifest).await {
                    Ok(()) => manifest,
                    Err(StorageError::Conflict { .. }) => {
                        race_lost(product, &mut pauses).await?;
                        continue;
                    }
                    Err(source) => {
                        return Err(IngestError::Storage {
                            action: "publish a manifest",
                            source,
                        });
                    }
                }
            }
        };
        return outcomes(&merged, &notes, Some(&manifest.id())).await;
    }
}

/// Waits before the next attempt, if one is left.
async fn race_lost(product: &ProductId, pauses: &mut Pauses) -> Result<(), IngestError> {
    let Some(pause) = pauses.next() else {
        return Err(IngestError::Contended {
            product: product.to_string(),
            attempts: LOST_RACES,
        });
    };
    tokio::time::sleep(pause).await;
    Ok(())
}

/// The next manifest, with its series and domain durable.
async fn build(
    store: &Store,
    product: &ProductId,
    newest: Option<&Manifest>,
    merged: &Merged,
    granules: &[StoredGranule],
) -> Result<Manifest, IngestError> {
    let last = merged
        .last_taken
        .and_then(|i| granules.get(i))
        .unwrap_or(&granules[0]);
    let grid = newest.map_or(last.grid, |m| m.grid);
    let segments::Written { series, domain } =
        segments::write(store, product, &grid, newest, merged).await?;
    Ok(Manifest {
        schema: MANIFEST_SCHEMA,
        product: product.clone(),
        number: newest.map_or(1, |m| m.number + 1),
        title: last.target.title.clone(),
        quantity: last.target.quantity,
        synthetic: last.target.synthetic,
        source: last.target.source.clone(),
        grid,
        steps: merged.steps.clone(),
        domain,
        series,
        derived_from: None,
        notices: NoticeRun::of(&merged.orders),
    })
}

/// What is noted of the files of a commit: whether it was noted before, once that is known.
struct Notes<'a> {
    store: &'a Store,
    product: &'a ProductId,
    granules: &'a [StoredGranule],
    before: Vec<Option<bool>>,
}

impl<'a> Notes<'a> {
    fn of(store: &'a Store, product: &'a ProductId, granules: &'a [StoredGranule]) -> Self {
        Self {
            store,
            product,
            granules,
            before: vec![None; granules.len()],
        }
    }

    /// Notes the files that are about to be published.
    async fn note(&mut self, merged: &Merged) -> Result<(), IngestError> {
        for (index, change) in merged.changes.iter().enumerate() {
            let granule = &self.granules[index];
            if let (Change::Taken { .. }, None, Some(origin)) =
                (change, self.before[index], granule.asked_by)
            {
                let noted =
                    landing_note::note(self.store, self.product, granule.raw_sha256, origin);
                self.before[index] = Some(noted.await?);
            }
        }
        Ok(())
    }

    /// The version that held a file which newer ones replaced, if its notice has still to tell of it.
    async fn untold(
        &self,
        index: usize,
        newest: &ManifestId,
        periods: &[Period],
    ) -> Result<Option<ManifestId>, IngestError> {
        let raw_sha256 = self.granules[index].raw_sha256;
        let is_noted = match (self.before[index], self.granules[index].asked_by) {
            (Some(before), _) => before,
            (None, Some(origin)) => {
                landing_note::is_noted(self.store, self.product, raw_sha256, origin).await?
            }
            (None, None) => false,
        };
        superseded::untold(self.store, newest, raw_sha256, periods, is_noted).await
    }

    /// Is it the notice of a file that was there that has to tell of it?
    async fn is_due(&self, index: usize) -> Result<bool, IngestError> {
        let granule = &self.granules[index];
        match (self.before[index], granule.asked_by) {
            // Noted just now, but somebody else was faster, and tells.
            (Some(before), _) => Ok(before),
            (None, Some(origin)) => {
                landing_note::is_noted(self.store, self.product, granule.raw_sha256, origin).await
            }
            (None, None) => Ok(true),
        }
    }
}

async fn outcomes(
    merged: &Merged,
    notes: &Notes<'_>,
    manifest: Option<&ManifestId>,
) -> Result<Vec<Committed>, IngestError> {
    let mut all = Vec::with_capacity(merged.changes.len());
    for (index, change) in merged.changes.iter().enumerate() {
        let grids = &notes.granules[index].grids;
        let periods: Vec<Period> = grids.iter().map(|g| g.step.period).collect();
        all.push(match (change, manifest) {
            (Change::Taken { revised, periods }, Some(manifest)) => Committed::Landed {
                manifest: manifest.clone(),
                periods: periods.clone(),
                revised: *revised,
            },
            (Change::Same, Some(manifest)) => Committed::AlreadyLanded {
                manifest: manifest.clone(),
                periods,
                is_due: notes.is_due(index).await?,
            },
            (Change::Superseded, Some(manifest)) => Committed::Superseded {
                manifest: manifest.clone(),
                held_by: notes.untold(index, manifest, &periods).await?,
                periods,
            },
            (Change::Refused(rejection), _) => Committed::Rejected(rejection.clone()),
            (Change::Taken { .. } | Change::Same | Change::Superseded, None) => {
                unreachable!("a file that is taken or there has a manifest")
            }
        });
    }
    Ok(all)
}
