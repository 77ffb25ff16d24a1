//! Objects that were compared with their names once: those that are read in parts and have no checks of their parts.

use std::collections::BTreeSet;
use std::sync::{Mutex, PoisonError};

use contract::key::ObjectKey;
use futures::{StreamExt as _, TryStreamExt as _, stream};

use super::Store;
use crate::StorageError;

/// Objects that are read at the same time.
const AT_ONCE: usize = 4;
/// Names remembered before all are forgotten: 100 bytes each.
const MOST_NAMES: usize = 1 << 18;

/// Names of objects that were whole when they were read.
#[derive(Debug, Default)]
pub(super) struct Checked(Mutex<BTreeSet<ObjectKey>>);

impl Checked {
    fn has(&self, key: &ObjectKey) -> bool {
        self.names().contains(key)
    }

    fn add(&self, key: &ObjectKey) {
        let mut names = self.names();
        if names.len() >= MOST_NAMES {
            names.clear();
        }
        names.insert(key.clone());
    }

    fn names(&self) -> std::sync::MutexGuard<'_, BTreeSet<ObjectKey>> {
        // A set is whole after every insertion.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Store {
    /// Reads each of these objects whole and compares it with its name, unless this handle or a clone of it did before.
    ///
    /// # Errors
    /// `Damaged` for the first one that is.
    pub async fn check_once(&self, keys: &[&ObjectKey]) -> Result<(), StorageError> {
        let new = keys.iter().filter(|key| !self.checked.has(key));
        let checks: Vec<_> = new
            .map(|&key| self.clone().check_now(key.clone()))
            .collect();
        stream::iter(checks)
            .buffer_unordered(AT_ONCE)
            .try_collect()
            .await
    }

    async fn check_now(self, key: ObjectKey) -> Result<(), StorageError> {
        self.get(&key).await?;
        self.checked.add(&key);
        Ok(())
    }
}
