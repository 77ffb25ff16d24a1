//! Pages of manifests that a process has read or written: they never change.

use std::sync::Arc;

use contract::key::ObjectKey;
use contract::manifest::Page;
use quick_cache::sync::Cache;

/// Pages that are held, 30 kB each: those of a product of 100,000 steps, and some.
const HELD: usize = 2048;

/// By their keys.
pub(crate) struct HeldPages(Cache<ObjectKey, Arc<Page>>);

impl Default for HeldPages {
    fn default() -> Self {
        Self(Cache::new(HELD))
    }
}

impl HeldPages {
    pub(crate) fn get(&self, key: &ObjectKey) -> Option<Arc<Page>> {
        self.0.get(key)
    }

    pub(crate) fn insert(&self, key: ObjectKey, page: Arc<Page>) {
        self.0.insert(key, page);
    }
}
