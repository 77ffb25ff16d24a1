//! The products there are: reads the store's newest manifests, at most once in a while, and remembers them.

mod layer;
mod snapshot;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use contract::budget::AsOf;
use contract::flow::check_parts;
use contract::manifest::{AskedVersion, ManifestId};
use contract::product::ProductId;
use contract::quantity::Quantity;
use futures::FutureExt as _;
use futures::future::{BoxFuture, Shared};
use storage::manifests::{self, AtInstant};
use storage::{StorageError, Store};

use crate::caught::caught;
use crate::error::ServerError;
use crate::metrics::Metrics;
use crate::versions::Versions;
use snapshot::{FOLDER, Reader, Snapshot};

pub use layer::{Accumulated, Layer, Northward, equal_until};

/// How long a store is waited for by those who can be served from what was known before.
const RETRY_LIMIT: Duration = Duration::from_secs(2);

/// What the store says of its products.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Probe {
    /// Products in the store.
    pub(crate) products: usize,
    /// Products that were there before.
    pub(crate) lost: usize,
}

/// The products of a store.
pub struct Catalogue {
    reader: Arc<Reader>,
    max_age: Duration,
    /// Is this told of whatever lands?
    is_told: AtomicBool,
    state: Arc<Mutex<State>>,
}

#[derive(Default)]
struct State {
    snapshot: Arc<Snapshot>,
    /// Raised when what is known may have changed: who began to read before that has read the past.
    epoch: u64,
    reading: Option<StoreRead>,
}

/// The store is being read, once for all who wait.
#[derive(Clone)]
struct StoreRead {
    begun: Instant,
    answer: Shared<BoxFuture<'static, Result<Arc<Snapshot>, ServerError>>>,
}

impl Catalogue {
    /// An empty catalogue that reads the store when it is first asked.
    pub fn new(store: Store, max_age: Duration, metrics: Metrics) -> Self {
        let versions = Versions::new(store.clone(), &metrics.panics);
        Self {
            reader: Arc::new(Reader {
                store,
                metrics,
                versions,
            }),
            max_age,
            is_told: AtomicBool::new(false),
            state: Arc::default(),
        }
    }

    /// From now on this is told of whatever lands: nobody waits for a look that only makes sure.
    pub(crate) fn is_told(&self) {
        self.is_told.store(true, Ordering::Release);
    }

    /// The newest version of a product by its name in an address.
    pub async fn layer(&self, product: &str) -> Result<Arc<Layer>, ServerError> {
        let unknown = || ServerError::UnknownProduct {
            name: product.chars().take(80).collect(),
        };
        let id: ProductId =
            product
                .parse()
                .map_err(|_no_such_name| match product.parse::<AskedVersion>() {
                    Ok(asked) => ServerError::VersionInName {
                        product: asked.product.to_string(),
                        version: asked.to_string(),
                    },
                    Err(_) => unknown(),
                })?;
        let snapshot = self.snapshot().await?;
        match snapshot.layers.get(&id) {
            Some(layer) => Ok(Arc::clone(layer)),
            None if snapshot.known.contains_key(&id) => Err(ServerError::EmptyProduct {
                name: id.to_string(),
            }),
            None => Err(unknown()),
        }
    }

    /// The version of a product that `manifest` names, with or without its digest; the newest one if it names none.
    pub async fn version(
        &self,
        product: &str,
        manifest: Option<&str>,
    ) -> Result<Arc<Layer>, ServerError> {
        let newest = self.layer(product).await?;
        let Some(name) = manifest else {
            return Ok(newest);
        };
        let id: ManifestId = match name.parse::<AskedVersion>() {
            // Its digest is left out.
            Ok(asked) if asked.number.is_some() && asked.digest.is_none() => {
                return self.asked_of(newest, &asked).await;
            }
            _ => name.parse()?,
        };
        if id == newest.id {
            return Ok(newest);
        }
        if id.product != newest.manifest.product {
            return Err(ServerError::UnknownVersion {
                manifest: id.to_string(),
            });
        }
        let older = self.reader.versions.layer(&id).await?;
        Ok(drifting(older, newest.northward.as_ref()))
    }

    /// The version that is asked for by as much of its name as somebody knows.
    pub(crate) async fn asked(&self, asked: &AskedVersion) -> Result<Arc<Layer>, ServerError> {
        let newest = self.layer(asked.product.as_str()).await?;
        self.asked_of(newest, asked).await
    }

    async fn asked_of(
        &self,
        newest: Arc<Layer>,
        asked: &AskedVersion,
    ) -> Result<Arc<Layer>, ServerError> {
        let unknown = || ServerError::UnknownVersion {
            manifest: asked.to_string(),
        };
        if asked.product != newest.manifest.product {
            return Err(unknown());
        }
        let number = match asked.number {
            Some(number) if !asked.is(&newest.manifest, &newest.id) => number,
            _ => return Ok(newest),
        };
        let found = manifests::numbered(&self.reader.store, &asked.product, number).await?;
        let id = found.map(|found| (found.id(), found));
        let id = id.filter(|(id, found)| asked.is(found, id));
        let (id, _found) = id.ok_or_else(unknown)?;
        let older = self.reader.versions.layer(&id).await?;
        Ok(drifting(older, newest.northward.as_ref()))
    }

    /// The version of a product as of a name or an instant.
    ///
    /// # Errors
    /// The first one that is kept is younger.
    pub(crate) async fn as_of(
        &self,
        product: &str,
        as_of: &AsOf,
    ) -> Result<Arc<Layer>, ServerError> {
        let instant = match as_of {
            AsOf::Version(named) => {
                return self.version(product, Some(&named.to_string())).await;
            }
            AsOf::Instant(instant) => *instant,
        };
        let newest = self.layer(product).await?;
        let product_id = &newest.manifest.product;
        let unknown = || ServerError::EmptyProduct {
            name: product_id.to_string(),
        };
        match manifests::as_of(&self.reader.store, product_id, instant).await? {
            AtInstant::Version(manifest) => {
                self.version(product, Some(&manifest.id().to_string()))
                    .await
            }
            AtInstant::BeforeFirst(first) => {
                Err(AsOf::before_first(product_id, instant, first).into())
            }
            AtInstant::Gone(older) => Err(AsOf::gone(product_id, instant, older).into()),
            AtInstant::Nothing => Err(unknown()),
        }
    }

    /// Is a layer still what the name of its product means?
    pub(crate) async fn is_still(&self, layer: &Arc<Layer>) -> Result<bool, ServerError> {
        let snapshot = self.snapshot().await?;
        let newest = snapshot.layers.get(&layer.manifest.product);
        Ok(newest.is_some_and(|newest| Arc::ptr_eq(newest, layer)))
    }

    /// Is there no newer version known?
    pub(crate) fn is_newest(&self, layer: &Layer) -> bool {
        let newest = self.state().snapshot.clone();
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
        let listed = self.reader.store.folders(FOLDER).await?;
        let before = Arc::clone(&self.state().snapshot);
        let lost = before
            .known
            .keys()
            .filter(|product| !listed.iter().any(|name| name == product.as_str()));
        Ok(Probe {
            products: listed.len(),
            lost: lost.count(),
        })
    }

    /// Reads the store, for what is known may have changed.
    ///
    /// # Errors
    /// The store does not answer; those who ask for products are still served from what was known before.
    pub(crate) async fn renew(&self) -> Result<(), ServerError> {
        let reading = {
            let mut state = self.state();
            Self::outdate(&mut state);
            self.read(&mut state)
        };
        reading.answer.await.map(|_snapshot| ())
    }

    fn outdate(state: &mut State) {
        state.epoch += 1;
        state.reading = None;
        let mut known = Snapshot::clone(&state.snapshot);
        known.read_at = None;
        state.snapshot = Arc::new(known);
    }

    fn state(&self) -> MutexGuard<'_, State> {
        locked(&self.state)
    }

    /// What is known, read anew if it is too old. A store that does not answer leaves what was known before: objects
    /// never change, so it is still true.
    async fn snapshot(&self) -> Result<Arc<Snapshot>, ServerError> {
        let (before, reading) = {
            let mut state = self.state();
            let before = Arc::clone(&state.snapshot);
            if before.is_younger_than(self.max_age) {
                return Ok(before);
            }
            let under_way = state.reading.clone();
            let reading = under_way.unwrap_or_else(|| self.read(&mut state));
            (before, reading)
        };
        // It was not outdated by anything that landed, only by time.
        if before.read_at.is_some() && self.is_told.load(Ordering::Acquire) {
            return Ok(before);
        }
        if before.is_first() {
            return reading.answer.await;
        }
        let retry_limits = RETRY_LIMIT.saturating_sub(reading.begun.elapsed());
        let read = tokio::time::timeout(retry_limits, reading.answer).await;
        Ok(match read {
            Ok(Ok(snapshot)) => snapshot,
            Ok(Err(_)) | Err(_) => before,
        })
    }

    /// Begins to read the store; what comes of it is kept however long it takes.
    fn read(&self, state: &mut State) -> StoreRead {
        let (reader, before) = (Arc::clone(&self.reader), Arc::clone(&state.snapshot));
        let reading = async move { reader.read(&before).await.map_err(ServerError::from) };
        self.keep(state, reading)
    }

    /// Begins to read the store in this way, once for all who ask meanwhile.
    fn keep(
        &self,
        state: &mut State,
        reading: impl Future<Output = Result<Snapshot, ServerError>> + Send + 'static,
    ) -> StoreRead {
        let (before, epoch) = (Arc::clone(&state.snapshot), state.epoch);
        let (reader, held) = (Arc::clone(&self.reader), Arc::clone(&self.state));
        let task = tokio::spawn(async move {
            // Let through, a panic would be what all who ask are told from now on.
            let read = caught(&reader.metrics.panics, reading).await;
            let mut state = locked(&held);
            let is_of_now = state.epoch == epoch;
            if is_of_now {
                state.reading = None;
            }
            match read {
                Ok(snapshot) => {
                    let snapshot = Arc::new(snapshot);
                    if is_of_now {
                        reader.metrics.products.set(snapshot.layers.len() as i64);
                        state.snapshot = Arc::clone(&snapshot);
                    }
                    Ok(snapshot)
                }
                Err(error) => {
                    if !matches!(error, ServerError::Defect { .. }) {
                        reader.metrics.store_failures.inc();
                    }
                    tracing::warn!(%error, "the list of products cannot be read; the one before is used");
                    if is_of_now && !before.is_first() {
                        // As if it had been read now: the store is asked again when that is too old.
                        let read_at = Some(Instant::now());
                        let before = Snapshot::clone(&before);
                        state.snapshot = Arc::new(Snapshot { read_at, ..before });
                    }
                    Err(error)
                }
            }
        });
        let lost = |e| {
            Err(ServerError::Defect {
                what: format!("reading the list of products ended early: {e}"),
            })
        };
        let answer = task.map(move |ended| ended.unwrap_or_else(lost));
        let reading = StoreRead {
            begun: Instant::now(),
            answer: answer.boxed().shared(),
        };
        state.reading = Some(reading.clone());
        reading
    }
}

/// A version with the northward part of its product's vector, if they belong together: what it drifts with is no part of
/// what was published under its name.
fn drifting(layer: Arc<Layer>, northward: Option<&Northward>) -> Arc<Layer> {
    let fits = |part: &&Northward| check_parts(&layer.manifest, &part.manifest).is_ok();
    match northward.filter(fits) {
        Some(part) => Arc::new(Layer {
            northward: Some(part.clone()),
            ..Layer::clone(&layer)
        }),
        None => layer,
    }
}

fn locked(state: &Mutex<State>) -> MutexGuard<'_, State> {
    // Changed by single assignments, so a poisoned lock still guards a whole state.
    state.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::Registry;

    async fn panicking() -> Result<Snapshot, ServerError> {
        tokio::task::yield_now().await;
        panic!("a planted panic")
    }

    #[tokio::test]
    async fn a_look_that_panics_is_told_to_all_who_wait_and_the_next_one_is_begun_anew() {
        let metrics = Metrics::register(&Registry::new()).unwrap();
        let catalogue = Catalogue::new(Store::memory(), Duration::ZERO, metrics.clone());
        drop(catalogue.keep(&mut catalogue.state(), panicking()));
        let (first, second) = futures::future::join(catalogue.layers(), catalogue.layers()).await;
        for answer in [first, second] {
            let error = answer.unwrap_err();
            assert!(error.to_string().contains("a planted panic"), "{error}");
        }
        assert_eq!((metrics.panics.get(), metrics.store_failures.get()), (1, 0));
        assert!(catalogue.layers().await.unwrap().is_empty());
    }
}
