//! The work of a plan, in its order, each item once.

use contract::manifest::Manifest;
use futures::future::BoxFuture;
use storage::manifests;

use super::{Item, Plan, What};
use crate::budget::{named, sums};
use crate::derive::{derive_accumulated, derive_anew};
use crate::{ComputeError, DeriveProgress, Engine};

/// What a run came to.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Outcome {
    /// The version that accumulated fields are in, if any were asked for.
    pub derived: Option<Manifest>,
    /// Tables of sums that are stored now.
    pub tables_count: usize,
}

/// Works a plan off. `progress` is told how many items are done.
///
/// Killed at any point, it leaves what readers see as it was; the same request planned again holds what is left.
pub fn run<'a>(
    engine: &'a Engine,
    plan: &'a Plan,
    progress: &'a (dyn Fn(usize) + Send + Sync),
) -> BoxFuture<'a, Result<Outcome, ComputeError>> {
    Box::pin(async move {
        let mut outcome = Outcome::default();
        let fields_count = plan
            .items
            .iter()
            .filter(|item| item.what == What::Fields)
            .count();
        if fields_count > 0 {
            outcome.derived = Some(fields(engine, plan, fields_count, progress).await?);
            progress(fields_count);
        }
        let manifest = manifests::load(engine.store(), &plan.manifest).await?;
        let tables = plan.items.iter().filter(|item| item.what != What::Fields);
        for item in tables {
            table(engine, &manifest, item, plan.is_forced).await?;
            outcome.tables_count += 1;
            progress(fields_count + outcome.tables_count);
        }
        Ok(outcome)
    })
}

async fn fields(
    engine: &Engine,
    plan: &Plan,
    fields_count: usize,
    progress: &(dyn Fn(usize) + Send + Sync),
) -> Result<Manifest, ComputeError> {
    let product = &plan.manifest.product;
    // Steps that are kept are told of too, before those of the plan.
    let on_step = |now: DeriveProgress| {
        progress((now.done_steps + fields_count).saturating_sub(now.all_steps));
    };
    match plan.anew_from {
        Some(from) => derive_anew(engine, product, plan.start, from, &on_step).await,
        None => derive_accumulated(engine, product, plan.start, &on_step).await,
    }
}

async fn table(
    engine: &Engine,
    manifest: &Manifest,
    item: &Item,
    is_forced: bool,
) -> Result<(), ComputeError> {
    let (Some(name), Some(measure)) = (&item.region, item.measure) else {
        return Err(ComputeError::inconsistent(
            "plan",
            "a table names no region",
        ));
    };
    if is_forced {
        let weights = named::stored_weights(engine, manifest, name).await?;
        sums::verify(engine, manifest, &weights, measure).await
    } else {
        let stored = named::store_sums(engine, manifest, name, measure).await?;
        tracing::debug!(region = name, key = %stored.key, computed = stored.computed_count, "sums");
        Ok(())
    }
}
