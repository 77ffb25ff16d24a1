//! The work of a plan: every file that is not read yet, several at a time, then one new version of the product.

use std::path::Path;

use contract::index::DimensionIndex;
use contract::manifest::Manifest;
use contract::product::ProductId;
use futures::StreamExt as _;
use storage::Store;

use super::plan::listed;
use super::{By, Item, Plan, Request, Workplace};
use crate::error::{IngestError, Stop, blame, boundary};
use crate::fetch::{RawFiles, RawGranule};
use crate::limits::memory;
use crate::pipeline::Pipeline;
use crate::pipeline::metrics::Metrics;
use crate::pipeline::progress::{Quiet, Stage};
use crate::plan::profile::Profile;
use crate::plan::recipe::Recipe;
use crate::plan::{self, Wish};
use crate::put::reading::{self, Reading};
use crate::{commit, inspect};

/// Works a plan off; the new version, or none if everything came out as it was. `progress` is told how many files have
/// been read.
///
/// Killed at any point, it leaves what readers see as it was; the same request planned again holds what is left.
///
/// # Errors
/// A file cannot be read any more: all others are read, and nothing is published.
pub async fn run(
    store: &Store,
    plan: &Plan,
    request: &Request,
    workplace: &Workplace,
    progress: &(dyn Fn(usize) + Send + Sync),
) -> Result<Option<Manifest>, IngestError> {
    if plan.items.is_empty() {
        return Ok(None);
    }
    let settings = &workplace.settings;
    let (gates, metrics) = (&*workplace.gates, Metrics::unseen());
    let work = Work {
        pipeline: Pipeline {
            store,
            settings,
            gates,
            observations: None,
            metrics: &metrics,
            progress: &Quiet,
        },
        raw: RawFiles::open(store, &workplace.spool, workplace.spool_bytes)?,
        product: &request.product,
        given: request.profile.as_ref(),
        indexes: &plan.indexes,
    };
    let mut readings = Vec::with_capacity(plan.items.len());
    let mut refused = vec![];
    let mut read = futures::stream::iter(&plan.items)
        .map(|item| work.read(item))
        .buffered(settings.parallel_files.clamp(1, 64));
    let mut done_count = plan.items.len() - plan.unread_count();
    for item in &plan.items {
        match read.next().await {
            Some(Ok(reading)) => readings.push(reading),
            Some(Err(Stop::Rejected(rejection))) => {
                refused.push(format!("{}: {rejection}", item.file));
            }
            Some(Err(Stop::Failed(error))) => return Err(error),
            None => unreachable!("every item has an end"),
        }
        done_count += usize::from(!item.is_read);
        progress(done_count);
    }
    if !refused.is_empty() {
        return Err(IngestError::Reread {
            product: request.product.to_string(),
            detail: format!(
                "{} of its files are refused now: {}",
                refused.len(),
                listed(&refused)
            ),
        });
    }
    commit::replace(store, gates, &request.product, &readings).await
}

/// What every file needs.
struct Work<'a> {
    pipeline: Pipeline<'a>,
    raw: RawFiles,
    product: &'a ProductId,
    given: Option<&'a Profile>,
    /// At which all files are read.
    indexes: &'a [DimensionIndex],
}

impl Work<'_> {
    async fn read(&self, item: &Item) -> Result<Reading, Stop> {
        let named = match &item.by {
            By::Named(name) => Some(self.pipeline.settings.profiles.named(name)?),
            By::Found | By::Given | By::Variable(_) => None,
        };
        let profile = match item.by {
            By::Given => self.given,
            By::Found | By::Named(_) | By::Variable(_) => named.as_ref(),
        };
        let variable = match &item.by {
            By::Variable(name) => Some(name.as_str()),
            By::Found | By::Given | By::Named(_) => None,
        };
        let wish = Wish {
            profile,
            product: Some(self.product),
            variable,
            meaning: None,
            indexes: self.indexes,
        };
        if item.is_read {
            let recipe = Recipe::of(wish);
            let (product, store) = (self.product, self.pipeline.store);
            let key = reading::key(product, &recipe, item.raw_sha256, &item.file)
                .map_err(IngestError::storage("find a reading"))?;
            if let Some(reading) = reading::get(store, &key).await? {
                return Ok(reading);
            }
            // Cleaned up since the plan was made.
        }
        let fetched = self.raw.fetch(self.product, item.raw_sha256, &item.file);
        let reread = self.reread(Path::new(&item.file), fetched.await?, wish);
        match boundary::contained(Box::pin(reread))
            .await
            .unwrap_or_else(|panic| Err(panic.into()))
        {
            Err(Stop::Failed(error)) if error.is_panic() => Err(blame(&error).into()),
            other => other,
        }
    }
    /// Reads a file that landed before as it would be read now: its fields become durable, and are noted.
    async fn reread(&self, shown: &Path, raw: RawGranule, wish: Wish<'_>) -> Result<Reading, Stop> {
        let Pipeline {
            store,
            settings,
            gates,
            progress,
            ..
        } = self.pipeline;
        let seat = gates.seat().await;
        progress.stage(shown, Stage::Inspect, 0, 0);
        let inspected = inspect::run(raw, settings).await?;
        let planned = plan::run(inspected, wish, settings).await?;
        let newest = self.pipeline.newest(&planned).await?;
        let _pass = seat
            .with_memory(memory::of_grids(&planned, &settings.limits))
            .await;
        let (reading, _masked) = self.pipeline.grids(shown, planned, newest.as_ref()).await?;
        reading
            .put(store, self.product)
            .await
            .map_err(IngestError::storage("note a reading"))?;
        Ok(reading)
    }
}
