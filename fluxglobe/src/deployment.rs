//! What commands and services work on: one process with a data folder, or the servers that settings name.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context as _, Result, bail};
use compute::Engine;
use contract::manifest::{AskedVersion, Manifest};
use contract::product::ProductId;
use kafka_log::{KafkaLog, KafkaSettings};
use prometheus::Registry;
use render::Backend;
use render_worker::{Desk, Limits};
use storage::Store;
use storage::log::{EmbeddedLog, EventLog};

use crate::cli::Settings;

/// Parts of a query that read a store behind a network: a part has one request under way, and answers take milliseconds.
const REMOTE_PARTS: NonZeroUsize = NonZeroUsize::new(16).expect("it is not 0");

/// Opens the object store that settings name, else the one in the data folder.
pub(crate) fn store(settings: &Settings) -> Result<Store> {
    if let Some(url) = &settings.store {
        return Ok(with_attached(&Store::open(url)?));
    }
    let folder = settings.data.join("objects");
    let text = folder.to_str().context("--data is not UTF-8")?;
    Ok(with_attached(&Store::open(text)?))
}

/// The same store, in which fields of attached products are read from where they lie.
pub(crate) fn with_attached(store: &Store) -> Store {
    store.with_attached(Arc::new(ingest::attach::ForeignFields::default()))
}

/// The same for those whom people wait for: that it is away is told of within seconds.
pub(crate) fn interactive_store(settings: &Settings) -> Result<Store> {
    match &settings.store {
        Some(url) => Ok(open_interactive(url)?),
        None => store(settings),
    }
}

/// Opens a store for those whom people wait for.
pub(crate) fn open_interactive(url: &str) -> Result<Store, storage::StorageError> {
    let mut settings = storage::store::Settings::from_environment();
    settings.retry_limits = storage::store::RetryLimits::interactive();
    Ok(with_attached(&Store::open_with(url, &settings)?))
}

/// Folder of the event log in the data folder.
pub(crate) fn events(settings: &Settings) -> PathBuf {
    settings.data.join("events")
}

/// Opens the event log in the data folder; one process at a time writes it.
pub(crate) fn embedded_log(settings: &Settings) -> Result<EmbeddedLog> {
    Ok(EmbeddedLog::open(&events(settings))?)
}

/// Opens the event log that settings name, else the one in the data folder; none over a shared store without Kafka,
/// whose readers would look for events elsewhere.
pub(crate) async fn log(
    settings: &Settings,
    kafka: &KafkaSettings,
) -> Result<Option<Arc<dyn EventLog>>> {
    Ok(match (&kafka.kafka, &settings.store) {
        (Some(_), _) => Some(Arc::new(KafkaLog::connect(kafka).await?)),
        (None, Some(_)) => None,
        (None, None) => Some(Arc::new(embedded_log(settings)?)),
    })
}

/// The same for commands that are of no use without it.
pub(crate) async fn needed_log(
    settings: &Settings,
    kafka: &KafkaSettings,
) -> Result<Arc<dyn EventLog>> {
    log(settings, kafka)
        .await?
        .context("give Kafka's brokers: --kafka or FLUXGLOBE_KAFKA, HOST:PORT[,HOST:PORT...]")
}

/// Who works on whole products: the Ballista cluster that settings name, else Ballista in this process; it starts with
/// its first query.
pub(crate) fn engine(settings: &Settings, store: Store) -> Result<Engine> {
    if let Some(scheduler) = &settings.cluster {
        return cluster(settings, store, scheduler);
    }
    let engine = Engine::standalone(store, parts_in_process(settings, false));
    Ok(engine.with_memory_bytes((settings.memory_mib as usize) << 20))
}

/// Who sums over regions: the Ballista cluster that settings name, else DataFusion in this process, where a scheduler
/// would take longer than the answer. The plan, the functions and the bits are the same (docs/decisions/009).
pub(crate) fn region_engine(settings: &Settings, store: Store) -> Result<Engine> {
    if let Some(scheduler) = &settings.cluster {
        return cluster(settings, store, scheduler);
    }
    Ok(in_process(settings, store))
}

/// DataFusion in this process, whatever cluster there is.
pub(crate) fn in_process(settings: &Settings, store: Store) -> Engine {
    let parts = parts_in_process(settings, store.is_remote());
    Engine::in_process(store, parts).with_memory_bytes((settings.memory_mib as usize) << 20)
}

/// The Ballista cluster of a scheduler.
pub(crate) fn cluster(settings: &Settings, store: Store, scheduler: &str) -> Result<Engine> {
    let engine = Engine::cluster(store, scheduler.parse()?, least_parts(settings));
    let engine = engine.with_query_limit(Duration::from_secs(settings.cluster_limit_s));
    // Statistics of every cell are computed where they are asked for.
    Ok(engine.with_memory_bytes((settings.memory_mib as usize) << 20))
}

/// Parts of a query that a cluster is asked for at least; its scheduler makes as many as its executors have room for.
fn least_parts(settings: &Settings) -> NonZeroUsize {
    settings
        .partitions
        .map_or(NonZeroUsize::MIN, NonZeroUsize::from)
}

/// Parts of a query in this process: one a processor, and more where they wait for a network rather than for processors.
fn parts_in_process(settings: &Settings, is_remote: bool) -> NonZeroUsize {
    let there = std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
    let parts = if is_remote {
        there.max(REMOTE_PARTS)
    } else {
        there
    };
    settings.partitions.map_or(parts, NonZeroUsize::from)
}

/// What to draw with: this machine's Vulkan devices, those that are named, or its processor when asked to.
pub(crate) fn backend(settings: &Settings) -> Result<Backend> {
    let named = &settings.adapter;
    match (settings.cpu, settings.require_gpu, named.is_empty()) {
        (true, true, _) => bail!(
            "--cpu draws with the processor and --require-gpu with nothing but a graphics card: give one of them"
        ),
        (true, false, false) => {
            bail!("--cpu draws with the processor and --adapter names others: give one of them")
        }
        (false, true, false) => bail!(
            "--adapter says what is drawn on, in software or not: leave --require-gpu, which chooses by itself, out"
        ),
        (true, false, true) => Ok(Backend::Cpu),
        (false, true, true) => Ok(Backend::HardwareGpu),
        (false, false, true) => Ok(Backend::Gpu),
        (false, false, false) => Ok(Backend::Adapters(named.clone())),
    }
}

/// A desk in this process, whose metrics go to `registry`.
pub(crate) async fn desk(
    settings: &Settings,
    store: Store,
    limits: Limits,
    registry: &Registry,
) -> Result<Desk> {
    let (backend, registry) = (backend(settings)?, registry.clone());
    let open = move || Desk::open(store, backend, &limits, &registry);
    Ok(tokio::task::spawn_blocking(open).await??)
}

/// The same for single pictures of a command: nothing is read ahead for a next one.
pub(crate) async fn single_desk(settings: &Settings, store: Store) -> Result<Desk> {
    let limits = Limits {
        fields_ahead: 0,
        ..Limits::default()
    };
    desk(settings, store, limits, &Registry::new()).await
}

/// Where products are looked for, for people: the data folder, unless another store is named.
fn place(url: &str, data: &Path) -> String {
    let own = data.join("objects").display().to_string();
    if url.trim_end_matches('/').ends_with(&own) {
        data.display().to_string()
    } else {
        url.to_owned()
    }
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
            place(store.url(), data)
        );
    }
    bail!(
        "there is no product {product}{}; there are {}{}",
        meant(product, &known),
        known.join(", "),
        made_by(product, &known)
    )
}

/// Which of the products that are there was meant, if one is close.
fn meant(product: &ProductId, known: &[String]) -> String {
    let close = compute::close_name(product.as_str(), known.iter().map(String::as_str));
    close.map_or_else(String::new, |name| format!(" (did you mean {name}?)"))
}

/// What makes the product that is not there, where one that is there has it made.
fn made_by(product: &ProductId, known: &[String]) -> String {
    let flux = product.as_str().strip_suffix("-accumulated");
    match flux.filter(|flux| known.iter().any(|one| one == flux)) {
        Some(flux) => format!("; `fluxglobe derive accumulated --product {flux}` makes it"),
        None => String::new(),
    }
}

/// The version of a product that is asked for, or an error that says what there is.
pub(crate) async fn version(store: &Store, asked: &AskedVersion, data: &Path) -> Result<Manifest> {
    let product = &asked.product;
    let newest = manifest(store, product, data).await?;
    let Some(number) = asked.number else {
        return Ok(newest);
    };
    let Some(manifest) = storage::manifests::numbered(store, product, number).await? else {
        bail!(
            "{product} has no version {number} (any more); its newest is {}",
            newest.id()
        );
    };
    let id = manifest.id();
    if !asked.is(&manifest, &id) {
        bail!("version {number} of {product} is {id}, not {asked}");
    }
    Ok(manifest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_would_make_a_product_that_is_not_there_is_named() {
        let known = ["flux".to_owned()];
        let of = |name: &str| made_by(&name.parse().unwrap(), &known);
        assert!(of("flux-accumulated").contains("derive accumulated --product flux`"));
        assert_eq!(of("flx-accumulated"), "");
        assert_eq!(of("flx"), "");
    }

    #[test]
    fn the_product_that_was_meant_is_named() {
        let known = ["flux".to_owned(), "sst".to_owned()];
        let of = |name: &str| meant(&name.parse().unwrap(), &known);
        assert_eq!(of("flx"), " (did you mean flux?)");
        assert_eq!(of("nothing"), "");
    }

    #[tokio::test]
    async fn what_holds_no_product_is_where_products_are_looked_for() {
        let folder = tempfile::tempdir().unwrap();
        let data = folder.path().join("data");
        let told = async |store: &Store| {
            let found = manifest(store, &"sst".parse().unwrap(), &data).await;
            found.unwrap_err().to_string()
        };
        let own = Store::open(data.join("objects").to_str().unwrap()).unwrap();
        let text = told(&own).await;
        let place = data.display();
        assert!(
            text.starts_with(&format!("{place} holds no product")),
            "{text}"
        );
        let other = Store::open(folder.path().to_str().unwrap()).unwrap();
        let text = told(&other).await;
        let place = other.url();
        assert!(
            text.starts_with(&format!("{place} holds no product")),
            "{text}"
        );
    }
}
