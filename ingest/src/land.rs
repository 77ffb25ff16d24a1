//! Files in, outcomes out: prepares several files at a time, publishes them product by product, tells of each.

use std::collections::BTreeMap;
use std::path::PathBuf;

use contract::digest::Digest;
use contract::event::Event;
use contract::product::ProductId;
use futures::{StreamExt as _, TryStreamExt as _};
use storage::Store;
use storage::log::EventLog;

use crate::commit::{self, Committed};
use crate::error::IngestError;
use crate::outcome::Outcome;
use crate::pipeline::{Pipeline, Prepared};
use crate::plan::Wish;
use crate::profile::Profile;
use crate::progress::{Progress, Stage};
use crate::put::StoredGranule;
use crate::settings::Settings;

/// Files that are published together: bounds what a crash makes be done again.
const COMMIT_FILES: usize = 64;

/// A file to land, and what its sender wants.
#[derive(Debug, Clone)]
pub(crate) struct Order<'a> {
    pub(crate) path: PathBuf,
    pub(crate) wish: Wish<'a>,
    /// The same text on everything that follows from one notice.
    pub(crate) trace: String,
}

/// Files to land together.
#[derive(Debug, Clone, Default)]
pub struct Batch<'a> {
    /// The files, in the order in which they are to be taken.
    pub files: Vec<PathBuf>,
    /// How to read them; found for each by itself if absent.
    pub profile: Option<&'a Profile>,
    /// Where to land them; named by the profile or the variable if absent.
    pub product: Option<&'a ProductId>,
}

/// Lands files and appends an event for each. A bad file is refused and the others go on.
pub async fn land_files(
    store: &Store,
    log: &dyn EventLog,
    settings: &Settings,
    batch: Batch<'_>,
    progress: &dyn Progress,
) -> Result<Vec<Outcome>, IngestError> {
    let wish = Wish {
        profile: batch.profile,
        product: batch.product,
    };
    let order = |path: PathBuf| Order {
        trace: trace(&path),
        path,
        wish,
    };
    let orders: Vec<Order<'_>> = batch.files.into_iter().map(order).collect();
    land_orders(store, log, settings, &orders, progress).await
}

/// Lands files; an event of each is durable when this returns.
pub(crate) async fn land_orders(
    store: &Store,
    log: &dyn EventLog,
    settings: &Settings,
    orders: &[Order<'_>],
    progress: &dyn Progress,
) -> Result<Vec<Outcome>, IngestError> {
    let pipeline = Pipeline {
        store,
        settings,
        progress,
    };
    let mut all = Vec::with_capacity(orders.len());
    for group in orders.chunks(COMMIT_FILES) {
        for (order, (outcome, raw_sha256)) in group.iter().zip(land_group(&pipeline, group).await?)
        {
            let event = Event::new(order.trace.clone(), outcome.event(raw_sha256, 1));
            log.append(&event)
                .await
                .map_err(IngestError::storage("append an event"))?;
            progress.done(&outcome);
            all.push(outcome);
        }
    }
    Ok(all)
}

type Told = (Outcome, Option<Digest>);

async fn land_group(
    pipeline: &Pipeline<'_>,
    group: &[Order<'_>],
) -> Result<Vec<Told>, IngestError> {
    let prepared: Vec<Prepared> = futures::stream::iter(group)
        .map(|order| pipeline.prepare(&order.path, order.wish))
        .buffered(pipeline.settings.parallel_files.clamp(1, 64))
        .try_collect()
        .await?;
    let mut told: Vec<Option<Told>> = vec![None; group.len()];
    let mut products: BTreeMap<ProductId, Vec<(usize, StoredGranule)>> = BTreeMap::new();
    for (index, prepared) in prepared.into_iter().enumerate() {
        let file = group[index].path.clone();
        match prepared {
            Prepared::Stored(granule) => products
                .entry(granule.target.product.clone())
                .or_default()
                .push((index, granule)),
            Prepared::AlreadyLanded {
                raw_sha256,
                manifest,
                periods,
            } => {
                told[index] = Some((
                    Outcome::AlreadyLanded {
                        file,
                        manifest,
                        periods,
                    },
                    Some(raw_sha256),
                ));
            }
            Prepared::Rejected(rejection) => {
                told[index] = Some((Outcome::rejected(file, rejection), None));
            }
        }
    }
    for (product, stored) in products {
        let (indices, granules): (Vec<usize>, Vec<StoredGranule>) = stored.into_iter().unzip();
        for index in &indices {
            let file = &group[*index].path;
            pipeline.progress.stage(file, Stage::Commit, 0, 0);
        }
        let committed = commit::run(pipeline.store, &product, &granules).await?;
        for ((index, granule), committed) in indices.into_iter().zip(&granules).zip(committed) {
            told[index] = Some((
                outcome(group[index].path.clone(), committed),
                Some(granule.raw_sha256),
            ));
        }
    }
    Ok(told.into_iter().flatten().collect())
}

fn outcome(file: PathBuf, committed: Committed) -> Outcome {
    match committed {
        Committed::Landed {
            manifest,
            periods,
            revised,
        } => Outcome::Landed {
            file,
            manifest,
            periods,
            revised,
        },
        Committed::AlreadyLanded { manifest, periods } => Outcome::AlreadyLanded {
            file,
            manifest,
            periods,
        },
        Committed::Rejected(rejection) => Outcome::rejected(file, rejection),
    }
}

/// A trace for a file that no notice came for.
pub(crate) fn trace(path: &std::path::Path) -> String {
    format!(
        "file-{}",
        Digest::of(path.as_os_str().as_encoded_bytes()).short()
    )
}
