//! `fluxglobe derive`: a product in, a product computed from it out.

use anyhow::Result;
use compute::DeriveProgress;
use contract::event::Event;
use contract::manifest::Manifest;
use contract::product::ProductId;
use contract::time::TimeMs;
use storage::Store;
use storage::log::EventLog;

use crate::cli::{Derive, DeriveStatistic, Settings};
use crate::{deployment, progress};

pub(crate) async fn run(settings: &Settings, options: Derive) -> Result<()> {
    let (product, start, kafka) = match options {
        Derive::Accumulated {
            product,
            start,
            kafka,
        } => (product, start, kafka),
        Derive::Statistic(options) => return statistic(settings, &options).await,
    };
    let store = deployment::store(settings)?;
    deployment::manifest(&store, &product, &settings.data).await?;
    let log = deployment::log(settings, &kafka).await?;
    say_who_is_told(log.is_some());
    let manifest = accumulated(settings, store, log.as_deref(), &product, start).await?;
    progress::result(&manifest.id().to_string())
}

/// Computes a statistic of each cell with a progress bar; at once if it is there already.
async fn statistic(settings: &Settings, options: &DeriveStatistic) -> Result<()> {
    let store = deployment::store(settings)?;
    deployment::manifest(&store, &options.product, &settings.data).await?;
    let log = deployment::log(settings, &options.kafka).await?;
    say_who_is_told(log.is_some());
    let bar = progress::bar("statistic of each cell", 0);
    // A block of cells is read by one query, which a scheduler would only delay.
    let engine = deployment::region_engine(settings, store)?;
    let on_cells = |progress: DeriveProgress| {
        bar.set_length(progress.all_steps as u64);
        bar.set_position(progress.done_steps as u64);
    };
    let asked = options.asked();
    let derived = compute::derive::derive_statistic(&engine, &options.product, &asked, &on_cells);
    let manifest = derived.await?;
    tell(log.as_deref(), &manifest).await?;
    let outcome = format!("{} fields of {}", manifest.steps.len(), manifest.product);
    progress::done(&bar, &outcome);
    progress::result(&manifest.id().to_string())
}

fn say_who_is_told(is_told: bool) {
    if !is_told {
        progress::say("nobody is told of it: give --kafka to tell the services of this store");
    }
}

/// Tells of a derived version, once.
async fn tell(log: Option<&dyn EventLog>, manifest: &Manifest) -> Result<()> {
    if let (Some(log), Some(body)) = (log, compute::derive::derived(manifest)) {
        let event = Event::new(manifest.id().to_string(), body);
        storage::log::tell_once(log, &event).await?;
    }
    Ok(())
}

/// Computes accumulated carbon with a progress bar; at once if it is there already.
pub(crate) async fn accumulated(
    settings: &Settings,
    store: Store,
    log: Option<&dyn EventLog>,
    product: &ProductId,
    start: Option<TimeMs>,
) -> Result<Manifest> {
    let bar = progress::bar("accumulate on Ballista", 0);
    let engine = deployment::engine(settings, store)?;
    let on_step = |progress: DeriveProgress| {
        bar.set_length(progress.all_steps as u64);
        bar.set_position(progress.done_steps as u64);
    };
    let manifest = compute::derive_accumulated(&engine, product, start, &on_step).await?;
    tell(log, &manifest).await?;
    progress::done(
        &bar,
        &format!("{} fields of {}", manifest.steps.len(), manifest.product),
    );
    Ok(manifest)
}
