//! Files in, outcomes out: prepares several files at a time, publishes them product by product, tells of each.

use std::collections::BTreeMap;
use std::path::PathBuf;

use contract::digest::Digest;
use contract::event::Event;
use contract::product::ProductId;
use futures::{StreamExt as _, TryStreamExt as _};
use storage::Store;
use storage::log::EventLog;

use crate::notice::answer::{self, Answer, Asked, Ready};
use crate::error::{Cause, IngestError, blame, boundary};
use crate::fetch::{Expected, Location};
use crate::limits::gates::Gates;
use crate::limits::memory;
use crate::pipeline::metrics::Metrics;
use crate::notice::{Order, PendingNotice, notice_body};
use crate::notice::Outcome;
use crate::pipeline::{Pipeline, Prepared};
use crate::plan::profile::Profile;
use crate::pipeline::progress::{Progress, Stage};
use crate::put::StoredGranule;
use crate::settings::Settings;
use crate::fetch::source_wait::SourceWait;

/// Files that are published together: bounds what a crash makes be done again.
pub(crate) const COMMIT_FILES: usize = 64;

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
    let asked = asked_for(&batch);
    let (gates, metrics) = (Gates::new(settings), Metrics::unseen());
    let pipeline = Pipeline {
        store,
        settings,
        gates: &gates,
        observations: None,
        metrics: &metrics,
        progress,
    };
    let mut all = Vec::with_capacity(asked.len());
    for group in asked.chunks(COMMIT_FILES) {
        let answers = land_group(&pipeline, group).await?;
        let events: Vec<Event> = answers.iter().filter_map(|a| a.event.clone()).collect();
        log.append(&events)
            .await
            .map_err(IngestError::storage("append events"))?;
        for answer in answers {
            progress.done(&answer.outcome);
            all.push(answer.outcome);
        }
    }
    Ok(all)
}

/// What would have been asked, had there been notices.
pub(crate) fn asked_for(batch: &Batch<'_>) -> Vec<Asked> {
    batch.files.iter().map(|path| asked(path, batch)).collect()
}

fn asked(path: &std::path::Path, batch: &Batch<'_>) -> Asked {
    let shown = path.display().to_string();
    let body = notice_body(&shown, None, None, 1);
    let notice = PendingNotice {
        order_key: body.order_key(),
        order: Ok(Order {
            location: Location::File(path.to_owned()),
            expected: Expected::default(),
            profile: batch.profile.cloned(),
            product: batch.product.cloned(),
        }),
        shown,
        attempt: 1,
        cause: Event::new(trace(path), body),
        given: None,
    };
    Asked {
        notice,
        origin: None,
        file: 0,
        source_wait: SourceWait::default(),
    }
}

/// Lands a group: its files of one product become durable together, in their order.
pub(crate) async fn land_group(
    pipeline: &Pipeline<'_>,
    group: &[Asked],
) -> Result<Vec<Answer>, IngestError> {
    let prepared = async |asked: &Asked| match prepare(pipeline, asked).await {
        Err(error) if error.cause() == Cause::Granule => {
            Ok(Ready::Answered(asked.refused(blame(&error))))
        }
        other => other,
    };
    let ready: Vec<Ready> = futures::stream::iter(group)
        .map(prepared)
        .buffered(pipeline.settings.parallel_files.clamp(1, 64))
        .try_collect()
        .await?;
    let mut answers: Vec<Option<Answer>> = vec![None; group.len()];
    let mut products: BTreeMap<ProductId, Vec<(usize, StoredGranule)>> = BTreeMap::new();
    for (index, ready) in ready.into_iter().enumerate() {
        match ready {
            Ready::ToCommit(granule) => products
                .entry(granule.target.product.clone())
                .or_default()
                .push((index, granule)),
            Ready::Answered(answer) => answers[index] = Some(answer),
        }
    }
    for stored in products.values() {
        let batch: Vec<_> = stored
            .iter()
            .map(|(index, granule)| (&group[*index], granule))
            .collect();
        let committed = commit_or_refuse(pipeline, &batch).await?;
        for ((index, _), answer) in stored.iter().zip(committed) {
            answers[*index] = Some(answer);
        }
    }
    Ok(answers.into_iter().flatten().collect())
}

/// Takes the file of a notice as far as to the manifest.
pub(crate) async fn prepare(pipeline: &Pipeline<'_>, asked: &Asked) -> Result<Ready, IngestError> {
    let prepared = match &asked.notice.order {
        Ok(order) => {
            pipeline
                .prepare(&asked.path(), order, asked.order(), &asked.source_wait)
                .await?
        }
        Err(rejection) => Prepared::Rejected(rejection.clone()),
    };
    asked.settle(pipeline.store, prepared).await
}

/// Publishes files of one product; if one of them makes the program fail, that one is refused and the others go on.
async fn commit_or_refuse(
    pipeline: &Pipeline<'_>,
    batch: &[(&Asked, &StoredGranule)],
) -> Result<Vec<Answer>, IngestError> {
    match commit(pipeline, batch).await {
        Err(error) if error.cause() == Cause::Granule => tracing::error!(%error, "one by one"),
        other => return other,
    }
    let mut answers = Vec::with_capacity(batch.len());
    for pair in batch {
        match commit(pipeline, std::slice::from_ref(pair)).await {
            Err(error) if error.cause() == Cause::Granule => {
                answers.push(pair.0.refused(blame(&error)));
            }
            alone => answers.extend(alone?),
        }
    }
    Ok(answers)
}

/// Publishes files of one product.
pub(crate) async fn commit(
    pipeline: &Pipeline<'_>,
    batch: &[(&Asked, &StoredGranule)],
) -> Result<Vec<Answer>, IngestError> {
    let running = pipeline.metrics.start("commit");
    let granules = batch.iter().map(|(_, granule)| *granule);
    let _memory = pipeline.gates.memory(memory::of_series(granules)).await;
    let work = async {
        for (asked, _) in batch {
            pipeline.progress.stage(&asked.path(), Stage::Commit, 0, 0);
        }
        answer::commit(pipeline.store, batch).await
    };
    let committed = boundary::contained(work).await.flatten();
    running.done(match &committed {
        Ok(_) => service::Outcome::Ok,
        Err(error) if error.is_retryable() => service::Outcome::Retryable,
        Err(_) => service::Outcome::Failed,
    });
    committed
}

/// A trace for a file that no notice came for.
pub(crate) fn trace(path: &std::path::Path) -> String {
    format!(
        "file-{}",
        Digest::of(path.as_os_str().as_encoded_bytes()).short()
    )
}
