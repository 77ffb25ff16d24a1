//! [`StoredGranule`]s of one product in, one new manifest out: a reader sees all of them or none.
//!
//! The manifest is built on the newest one and published under the next number; if another writer took that number the
//! newest is read again. Everything it names is durable before. A crash before the publication leaves objects that
//! nothing names; the same files make the same objects again and land once.

mod merge;
mod segments;

use std::time::Duration;

use backon::{BackoffBuilder as _, ExponentialBuilder};
use contract::manifest::{MANIFEST_SCHEMA, Manifest, ManifestId};
use contract::product::ProductId;
use contract::time::Period;
use storage::{StorageError, Store, manifests};

use crate::error::IngestError;
use crate::put::StoredGranule;
use crate::rejection::Rejection;
use merge::{Change, Merged};

/// Lost races for the next number before the caller is told; it may go on.
const MAX_TRIES: u32 = 200;
/// Pause after a lost race, with jitter: it doubles up to the longest, so that many writers of one product get apart.
const FIRST_PAUSE: Duration = Duration::from_millis(5);
const LONGEST_PAUSE: Duration = Duration::from_millis(640);

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
    let pauses = ExponentialBuilder::default()
        .with_min_delay(FIRST_PAUSE)
        .with_max_delay(LONGEST_PAUSE)
        .with_max_times(MAX_TRIES as usize)
        .with_jitter()
        .build();
    for pause in pauses {
        let newest = manifests::latest(store, product)
            .await
            .map_err(IngestError::storage("read the newest manifest"))?;
        let merged = merge::merge(newest.as_ref(), granules);
        let manifest = match (&newest, merged.is_changed()) {
            (Some(newest), false) => newest.clone(),
            (None, false) => return Ok(outcomes(&merged, granules, None)),
            (newest, true) => {
                let manifest = build(store, product, newest.as_ref(), &merged, granules).await?;
                match manifests::commit(store, &manifest).await {
                    Ok(()) => manifest,
                    Err(StorageError::Conflict { .. }) => {
                        tokio::time::sleep(pause).await;
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
        return Ok(outcomes(&merged, granules, Some(&manifest.id())));
    }
    Err(IngestError::Contended {
        product: product.to_string(),
        tries: MAX_TRIES,
    })
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
    })
}

fn outcomes(
    merged: &Merged,
    granules: &[StoredGranule],
    manifest: Option<&ManifestId>,
) -> Vec<Committed> {
    let outcome = |(change, granule): (&Change, &StoredGranule)| {
        let periods = granule.grids.iter().map(|g| g.step.period).collect();
        match (change, manifest) {
            (Change::Taken { revised }, Some(manifest)) => Committed::Landed {
                manifest: manifest.clone(),
                periods,
                revised: *revised,
            },
            (Change::Same, Some(manifest)) => Committed::AlreadyLanded {
                manifest: manifest.clone(),
                periods,
            },
            (Change::Refused(rejection), _) => Committed::Rejected(rejection.clone()),
            (Change::Taken { .. } | Change::Same, None) => {
                unreachable!("a file that is taken or there has a manifest")
            }
        }
    };
    merged.changes.iter().zip(granules).map(outcome).collect()
}
