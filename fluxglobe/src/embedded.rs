//! Embedded mode: one process, a local folder as object store, an event log in it, Ballista in process.

use std::num::NonZeroUsize;
use std::path::Path;
use std::sync::Arc;

use anyhow::{Context as _, Result, bail};
use compute::Engine;
use contract::manifest::Manifest;
use contract::product::ProductId;
use render_worker::{Backend, RenderService};
use storage::Store;
use storage::log::EmbeddedLog;

use crate::cli::Settings;

/// Opens the object store in the data folder.
pub(crate) fn store(settings: &Settings) -> Result<Store> {
    let folder = settings.data.join("objects");
    let text = folder.to_str().context("--data is not UTF-8")?;
    Ok(Store::open(text)?)
}

/// Opens the event log in the data folder; one process at a time writes it.
pub(crate) fn log(settings: &Settings) -> Result<Arc<EmbeddedLog>> {
    Ok(Arc::new(EmbeddedLog::open(&settings.data.join("events"))?))
}

/// Ballista in this process; it starts with its first query.
pub(crate) fn cluster(settings: &Settings, store: Store) -> Engine {
    let partitions = NonZeroUsize::from(settings.partitions);
    Engine::standalone(store, partitions)
}

/// The renderer on this machine's Vulkan device, or on its processor when asked to.
pub(crate) async fn renderer(settings: &Settings, store: Store) -> Result<RenderService> {
    let backend = if settings.cpu {
        Backend::Cpu
    } else {
        Backend::Gpu
    };
    let make = move || RenderService::new(store, backend);
    Ok(tokio::task::spawn_blocking(make).await??)
}

/// The newest manifest of a product, or an error that names the products there are.
pub(crate) async fn manifest(store: &Store, product: &ProductId, data: &Path) -> Result<Manifest> {
    if let Some(manifest) = storage::manifests::latest(store, product).await? {
        return Ok(manifest);
    }
    let known = storage::manifests::products(store).await?;
    let known: Vec<String> = known.iter().map(ToString::to_string).collect();
    if known.is_empty() {
        bail!(
            "{} holds no product yet; land files with `fluxglobe ingest` or run `fluxglobe demo`",
            data.display()
        );
    }
    bail!(
        "there is no product {product}; there are {}",
        known.join(", ")
    )
}
