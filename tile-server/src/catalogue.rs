//! The products there are: reads the store's newest manifests, at most once in a while, and remembers them.

use std::collections::BTreeMap;
use std::sync::{Arc, PoisonError, RwLock};
use std::time::{Duration, Instant};

use contract::job::Mode;
use contract::key::ObjectKey;
use contract::manifest::{Manifest, ManifestId};
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::time::{Period, TimeMs};
use storage::{StorageError, Store, manifests};

use crate::error::ServerError;
use crate::metrics::Metrics;
use crate::versions::Versions;

/// Folder of all manifests; [`ObjectKey::manifest`] puts them there.
const FOLDER: &str = "manifests";

/// The newest version of one product.
#[derive(Debug, Clone)]
pub struct Layer {
    /// Its name, which is costly to compute.
    pub id: ManifestId,
    /// Its manifest.
    pub manifest: Arc<Manifest>,
    /// What it covers; a manifest without steps is no layer.
    pub extent: Period,
    /// The accumulated carbon that lifts its particles.
    pub accumulated: Option<Accumulated>,
}

/// Accumulated carbon of one version of a product.
#[derive(Debug, Clone)]
pub struct Accumulated {
    /// Its name, which is costly to compute.
    pub id: ManifestId,
    /// Its manifest.
    pub manifest: Arc<Manifest>,
    /// The last instant at which it holds for that version: none if it was derived from exactly that one.
    pub until: Option<TimeMs>,
}

impl Accumulated {
    /// What was derived from a version, for that version.
    pub fn new(id: ManifestId, manifest: Arc<Manifest>) -> Self {
        let until = None;
        Self {
            id,
            manifest,
            until,
        }
    }

    /// Does it hold at an instant?
    pub(crate) fn holds_at(&self, time: TimeMs) -> bool {
        self.until.is_none_or(|until| time <= until)
    }
}

impl Layer {
    /// Modes it can be drawn in. Accumulated carbon lifts the particles of another product; it has none of its own.
    pub fn modes(&self) -> &'static [Mode] {
        if self.manifest.quantity == Quantity::AccumulatedCarbon {
            &[Mode::Map]
        } else {
            &Mode::ALL
        }
    }
}

/// What was known at one moment.
#[derive(Debug, Default)]
struct Snapshot {
    read_at: Option<Instant>,
    known: BTreeMap<ProductId, (ObjectKey, Arc<Manifest>, ManifestId)>,
    layers: BTreeMap<ProductId, Arc<Layer>>,
}

/// A store that could not be read.
#[derive(Debug)]
struct Failure {
    at: Instant,
    error: Arc<StorageError>,
}

/// What the store says of its products.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Probe {
    /// Products in the store.
    pub(crate) products: usize,
    /// Products that were there before.
    pub(crate) lost: usize,
}

/// The products of a store.
#[derive(Debug)]
pub struct Catalogue {
    store: Store,
    max_age: Duration,
    metrics: Metrics,
    snapshot: RwLock<Arc<Snapshot>>,
    versions: Versions,
    /// Held while the store is read, so that a crowd reads it once; when and how that failed the last time.
    reading: tokio::sync::Mutex<Option<Failure>>,
}

impl Catalogue {
    /// An empty catalogue that reads the store when it is first asked.
    pub fn new(store: Store, max_age: Duration, metrics: Metrics) -> Self {
        Self {
            versions: Versions::new(store.clone()),
            store,
            max_age,
            metrics,
            snapshot: RwLock::default(),
            reading: tokio::sync::Mutex::default(),
        }
    }

    /// The newest version of a product by its name in an address.
    pub async fn layer(&self, product: &str) -> Result<Arc<Layer>, ServerError> {
        let unknown = || ServerError::UnknownProduct {
            name: product.chars().take(80).collect(),
        };
        let id: ProductId = product.parse().map_err(|_no_such_name| unknown())?;
        let snapshot = self.snapshot().await?;
        match snapshot.layers.get(&id) {
            Some(layer) => Ok(Arc::clone(layer)),
            None if snapshot.known.contains_key(&id) => Err(ServerError::EmptyProduct {
                name: id.to_string(),
            }),
            None => Err(unknown()),
        }
    }

    /// The version of a product that `manifest` names; the newest one if it names none.
    pub async fn version(
        &self,
        product: &str,
        manifest: Option<&str>,
    ) -> Result<Arc<Layer>, ServerError> {
        let newest = self.layer(product).await?;
        let Some(name) = manifest else {
            return Ok(newest);
        };
        let id: ManifestId = name.parse()?;
        if id == newest.id {
            return Ok(newest);
        }
        if id.product != newest.manifest.product {
            return Err(ServerError::UnknownVersion {
                manifest: id.to_string(),
            });
        }
        self.versions.layer(&id).await
    }

    /// Is there no newer version known?
    pub(crate) fn is_newest(&self, layer: &Layer) -> bool {
        let newest = self.current();
        let newest = newest.layers.get(&layer.manifest.product);
        newest.is_some_and(|newest| newest.id == layer.id)
    }

    /// Every product with steps: carbon fluxes first, accumulated carbon last, then by name.
    pub async fn layers(&self) -> Result<Vec<Arc<Layer>>, ServerError> {
        let mut layers: Vec<_> = self.snapshot().await?.layers.values().cloned().collect();
        layers.sort_by_key(|layer| match layer.manifest.quantity {
            Quantity::CarbonFlux => 0,
            Quantity::AccumulatedCarbon => 2,
            _ => 1,
        });
        Ok(layers)
    }

    /// Asks the store now which products it has: how many, and how many of those known it has lost.
    pub(crate) async fn probe(&self) -> Result<Probe, StorageError> {
        let listed = self.store.folders(FOLDER).await?;
        let known = &self.current().known;
        let lost = known
            .keys()
            .filter(|product| !listed.iter().any(|name| name == product.as_str()));
        Ok(Probe {
            products: listed.len(),
            lost: lost.count(),
        })
    }

    /// What is known may have changed: the next question reads the store.
    pub(crate) fn outdated(&self) {
        let mut snapshot = self
            .snapshot
            .write()
            .unwrap_or_else(PoisonError::into_inner);
        let known = Snapshot {
            read_at: None,
            known: snapshot.known.clone(),
            layers: snapshot.layers.clone(),
        };
        *snapshot = Arc::new(known);
    }

    fn current(&self) -> Arc<Snapshot> {
        Arc::clone(&self.snapshot.read().unwrap_or_else(PoisonError::into_inner))
    }

    fn fresh(&self) -> Option<Arc<Snapshot>> {
        let snapshot = self.current();
        let fresh = snapshot
            .read_at
            .is_some_and(|at| at.elapsed() < self.max_age);
        fresh.then_some(snapshot)
    }

    /// What is known, read anew if it is too old. A store that does not answer leaves what was known before: objects
    /// never change, so it is still true.
    async fn snapshot(&self) -> Result<Arc<Snapshot>, ServerError> {
        if let Some(snapshot) = self.fresh() {
            return Ok(snapshot);
        }
        let asked_at = Instant::now();
        let mut failure = self.reading.lock().await;
        if let Some(snapshot) = self.fresh() {
            return Ok(snapshot);
        }
        let before = self.current();
        // Whoever waited while it failed does not wait for it to fail again.
        if let Some(failure) = failure.as_ref().filter(|failure| failure.at >= asked_at) {
            return known_before(before, &failure.error);
        }
        match self.read(&before).await {
            Ok(snapshot) => {
                let snapshot = Arc::new(snapshot);
                self.metrics.products.set(snapshot.layers.len() as i64);
                self.replace(Arc::clone(&snapshot));
                *failure = None;
                Ok(snapshot)
            }
            Err(error) => {
                self.metrics.store_failures.inc();
                tracing::warn!(%error, "the list of products cannot be read; the one before is used");
                let (at, error) = (Instant::now(), Arc::new(error));
                let answer = known_before(Arc::clone(&before), &error);
                if answer.is_ok() {
                    // As old as if it had been read now: the store is asked again when that is too old.
                    self.replace(Arc::new(Snapshot {
                        read_at: Some(at),
                        known: before.known.clone(),
                        layers: before.layers.clone(),
                    }));
                }
                *failure = Some(Failure { at, error });
                answer
            }
        }
    }

    fn replace(&self, snapshot: Arc<Snapshot>) {
        let held = self.snapshot.write();
        *held.unwrap_or_else(PoisonError::into_inner) = snapshot;
    }

    /// One listing of all manifests; only those that are new are read.
    async fn read(&self, before: &Snapshot) -> Result<Snapshot, StorageError> {
        let read_at = Some(Instant::now());
        let mut newest: BTreeMap<ProductId, ObjectKey> = BTreeMap::new();
        for key in self.store.list(FOLDER).await? {
            // Keys come sorted and numbers are zero-padded: the last of a product is its newest.
            if let Some(product) = key
                .as_str()
                .split('/')
                .nth(1)
                .and_then(|name| name.parse().ok())
            {
                newest.insert(product, key);
            }
        }
        // Manifests are never deleted: a product that is gone was lost with its disk, not withdrawn.
        let mut known = before.known.clone();
        for (product, key) in newest {
            if known.get(&product).is_none_or(|entry| entry.0 != key)
                && let Some(entry) = self.load(&product, key).await?
            {
                known.insert(product, entry);
            }
        }
        let mut layers = BTreeMap::new();
        for (product, (_, manifest, id)) in &known {
            let Some(extent) = manifest.extent() else {
                continue;
            };
            let layer = Layer {
                id: id.clone(),
                manifest: Arc::clone(manifest),
                extent,
                accumulated: self.accumulated(&known, manifest, id).await,
            };
            layers.insert(product.clone(), Arc::new(layer));
        }
        Ok(Snapshot {
            read_at,
            layers,
            known,
        })
    }

    /// The newest accumulated carbon of a version. While the derivation from a new version is on its way, the one
    /// before still holds as far as nothing changed that it was summed from.
    async fn accumulated(
        &self,
        known: &BTreeMap<ProductId, Entry>,
        manifest: &Manifest,
        id: &ManifestId,
    ) -> Option<Accumulated> {
        let product = manifest.product.accumulated().ok()?;
        let (_, derived, derived_id) = known.get(&product)?;
        let source = derived.derived_from.as_ref()?;
        let accumulated = Accumulated::new(derived_id.clone(), Arc::clone(derived));
        if source == id {
            return Some(accumulated);
        }
        let before = match self.versions.manifest(source).await {
            Ok(before) => before,
            Err(error) => {
                tracing::debug!(%error, manifest = %source, "the version before cannot be compared");
                return None;
            }
        };
        let until = Some(equal_until(&before, manifest)?);
        Some(Accumulated {
            until,
            ..accumulated
        })
    }

    /// The newest manifest of a product; none if it is damaged, which must not hide the other products.
    async fn load(
        &self,
        product: &ProductId,
        key: ObjectKey,
    ) -> Result<Option<Entry>, StorageError> {
        match manifests::latest(&self.store, product).await {
            Ok(manifest) => Ok(manifest.map(|manifest| {
                let id = manifest.id();
                (
                    ObjectKey::manifest(product, manifest.number),
                    Arc::new(manifest),
                    id,
                )
            })),
            Err(error) if error.is_retryable() => Err(error),
            Err(error) => {
                self.metrics.store_failures.inc();
                tracing::error!(%error, product.id = %product, object.key = %key, "a manifest cannot be used");
                Ok(None)
            }
        }
    }
}

/// What is known although the store does not answer, if anything is.
fn known_before(
    before: Arc<Snapshot>,
    error: &Arc<StorageError>,
) -> Result<Arc<Snapshot>, ServerError> {
    if before.read_at.is_none() && before.known.is_empty() {
        return Err(ServerError::Storage(Arc::clone(error)));
    }
    Ok(before)
}

type Entry = (ObjectKey, Arc<Manifest>, ManifestId);

/// The end of the steps at the start of both versions that are equal in both; none if what was summed up from one says
/// nothing of the other.
fn equal_until(before: &Manifest, now: &Manifest) -> Option<TimeMs> {
    if before.product != now.product || before.grid != now.grid || before.domain != now.domain {
        return None;
    }
    let pairs = before.steps.iter().zip(&now.steps);
    let equal = pairs.take_while(|(old, new)| old.period == new.period && old.frame == new.frame);
    equal.last().map(|(_, new)| new.period.end)
}
