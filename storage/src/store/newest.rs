//! Numbers of the newest manifests that a process has seen: where to look for the next.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

use contract::product::ProductId;

/// By product.
#[derive(Default)]
pub(crate) struct Newest(Mutex<BTreeMap<ProductId, u64>>);

impl Newest {
    pub(crate) fn get(&self, product: &ProductId) -> Option<u64> {
        self.lock().get(product).copied()
    }

    /// Keeps a number, unless a newer one was seen meanwhile.
    pub(crate) fn insert(&self, product: ProductId, number: u64) {
        let mut all = self.lock();
        let newest = all.entry(product).or_default();
        *newest = number.max(*newest);
    }

    pub(crate) fn remove(&self, product: &ProductId) {
        self.lock().remove(product);
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, BTreeMap<ProductId, u64>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
