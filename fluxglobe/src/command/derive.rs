//! `fluxglobe derive`: a product in, a product computed from it out.

use anyhow::Result;
use compute::DeriveProgress;
use contract::event::Event;
use contract::manifest::Manifest;
use contract::product::ProductId;
use contract::time::TimeMs;
use storage::Store;
use storage::log::EventLog;

use crate::cli::{Derive, Settings};
use crate::{deployment, progress};

pub(crate) async fn run(settings: &Settings, options: Derive) -> Result<()> {
    let Derive::Accumulated {
        product,
        start,
        kafka,
    } = options;
    let store = deployment::store(settings)?;
    deployment::manifest(&store, &product, &settings.data).await?;
    let log = deployment::log(settings, &kafka).await?;
    if log.is_none() {
        progress::say("nobody is told of it: give --kafka to tell the services of this store");
    }
    let manifest = accumulated(settings, store, log.as_deref(), &product, start).await?;
    progress::result(&manifest.id().to_string())
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
    if let (Some(log), Some(body)) = (log, compute::derive::derived(&manifest)) {
        let event = Event::new(manifest.id().to_string(), body);
        storage::log::tell_once(log, &event).await?;
    }
    progress::done(
        &bar,
        &format!("{} fields of {}", manifest.steps.len(), manifest.product),
    );
    Ok(manifest)
}
