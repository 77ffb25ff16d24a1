//! Sums of the named regions, stored behind the derivations: budgets of them are then read and not computed.
//!
//! Nobody waits for them, so they wait for everybody: no region is begun while something is derived, and those of a
//! version that has been replaced meanwhile are left to its successor. What fails is left to be computed when asked for.

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::sync::{Arc, Mutex, PoisonError};

use ::service::{Outcome, Red};
use contract::manifest::ManifestId;
use contract::product::ProductId;
use storage::manifests;
use tokio::sync::{Notify, RwLock, RwLockReadGuard};

use crate::budget::{Measure, named};
use crate::{ComputeError, Engine};

/// What waits to be summed; clones share it.
#[derive(Clone)]
pub(super) struct NamedSums {
    engine: Engine,
    red: Red,
    shared: Arc<Shared>,
}

#[derive(Default)]
struct Shared {
    /// The newest version of each product that is not summed yet.
    waiting: Mutex<BTreeMap<ProductId, ManifestId>>,
    /// Rung when something waits.
    news: Notify,
    /// Held for reading while something is derived.
    derivations: RwLock<()>,
}

impl NamedSums {
    pub(super) fn new(engine: Engine, red: Red) -> Self {
        Self {
            engine,
            red,
            shared: Arc::default(),
        }
    }

    /// No region is begun until this is dropped.
    pub(super) async fn hold(&self) -> RwLockReadGuard<'_, ()> {
        self.shared.derivations.read().await
    }

    /// A version whose regions are to be summed.
    pub(super) fn add(&self, source: ManifestId) {
        self.waiting(|waiting| waiting.insert(source.product.clone(), source));
        self.shared.news.notify_one();
    }

    fn waiting<T>(&self, change: impl FnOnce(&mut BTreeMap<ProductId, ManifestId>) -> T) -> T {
        // A panic elsewhere leaves a map that is whole.
        change(
            &mut self
                .shared
                .waiting
                .lock()
                .unwrap_or_else(PoisonError::into_inner),
        )
    }

    /// Sums for ever.
    pub(super) async fn run(&self) -> Infallible {
        loop {
            let Some((product, source)) = self.waiting(BTreeMap::pop_first) else {
                self.shared.news.notified().await;
                continue;
            };
            let running = self.red.start("sums");
            match self.store(&product, &source).await {
                Ok(()) => running.done(Outcome::Ok),
                Err(error) => {
                    tracing::warn!(manifest = %source, %error, "sums of named regions are left to be computed");
                    running.done(Outcome::Failed);
                }
            }
        }
    }

    /// Only what changed since the version before is summed.
    async fn store(&self, product: &ProductId, source: &ManifestId) -> Result<(), ComputeError> {
        let manifest = manifests::load(self.engine.store(), source).await?;
        for region in named::touching(self.engine.store(), &manifest.grid).await? {
            // Waits for derivations to end; not held, so that the next need not wait for a region.
            drop(self.shared.derivations.write().await);
            if self.waiting(|waiting| waiting.contains_key(product)) {
                tracing::debug!(manifest = %source, "replaced before it was summed");
                return Ok(());
            }
            named::store_sums(&self.engine, &manifest, region.name, Measure::Mass).await?;
        }
        Ok(())
    }
}
