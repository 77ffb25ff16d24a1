//! Which accumulated carbon was derived from a version of a flux: a version in, the derived one out.

use std::fmt::{Debug, Formatter};
use std::sync::Arc;

use contract::digest::Digest;
use contract::manifest::{Manifest, ManifestId};
use contract::product::ProductId;
use futures::stream::{self, StreamExt as _, TryStreamExt as _};
use prometheus::IntCounter;
use quick_cache::sync::Cache;
use storage::{StorageError, Store, manifests};

use crate::error::ServerError;
use crate::single_flight::SingleFlight;

/// Derived versions of which it is remembered what they were derived from: some 100 bytes each.
const REMEMBERED: usize = 1 << 16;
/// Versions of which it is remembered that nothing was derived from them.
const REMEMBERED_NONE: usize = 1024;
/// Derived versions that are read at a time.
const AT_ONCE: usize = 16;

/// The derivations of all products.
pub(crate) struct Derivations {
    store: Store,
    /// What derived versions were derived from, by `product@number`.
    sources: Arc<Cache<String, Option<ManifestId>>>,
    /// Versions that nothing had been derived from when the newest derived version was of this number.
    none_by: Cache<ManifestId, u64>,
    looking: SingleFlight<Option<Arc<Manifest>>>,
}

impl Debug for Derivations {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Derivations").finish_non_exhaustive()
    }
}

impl Derivations {
    /// None known yet; `panics` counts those of looking for one.
    pub(crate) fn new(store: Store, panics: &IntCounter) -> Self {
        Self {
            store,
            sources: Arc::new(Cache::new(REMEMBERED)),
            none_by: Cache::new(REMEMBERED_NONE),
            looking: SingleFlight::new(panics),
        }
    }

    /// The newest version of `product` that was derived from exactly this version.
    ///
    /// # Errors
    /// The store does not answer, or one of the derived versions is damaged.
    pub(crate) async fn of(
        &self,
        id: &ManifestId,
        product: &ProductId,
    ) -> Result<Option<Arc<Manifest>>, ServerError> {
        let Some(newest) = manifests::latest(&self.store, product).await? else {
            return Ok(None);
        };
        let number = newest.number;
        if newest.derived_from.as_ref() == Some(id) {
            return Ok(Some(Arc::new(newest)));
        }
        if self.none_by.get(id) == Some(number) {
            return Ok(None);
        }
        let key = Digest::of(format!("{id} {product}@{number}").as_bytes());
        let older = Older {
            store: self.store.clone(),
            sources: Arc::clone(&self.sources),
            product: product.clone(),
            newest: number,
        };
        let of = id.clone();
        let looking = || async move { Ok(older.derived_from(&of).await?.map(Arc::new)) };
        let found = self.looking.join(key, looking).await?;
        if found.is_none() {
            self.none_by.insert(id.clone(), number);
        }
        Ok(found)
    }
}

/// The derived versions of a product but its newest.
struct Older {
    store: Store,
    sources: Arc<Cache<String, Option<ManifestId>>>,
    product: ProductId,
    newest: u64,
}

impl Older {
    async fn derived_from(&self, id: &ManifestId) -> Result<Option<Manifest>, StorageError> {
        let mut numbers = manifests::numbers(&self.store, &self.product).await?;
        numbers.retain(|number| *number < self.newest);
        let number = match self.in_order(&numbers, id).await? {
            Some(number) => Some(number),
            None => self.anywhere(&numbers, id).await?,
        };
        let Some(number) = number else {
            return Ok(None);
        };
        let derived = manifests::numbered(&self.store, &self.product, number).await?;
        Ok(derived.filter(|derived| derived.derived_from.as_ref() == Some(id)))
    }

    /// Found by halves: whoever publishes a derivation puts none of an older version over one of a newer. None where it is not there,
    /// and where derived versions do not lie in this order.
    async fn in_order(
        &self,
        numbers: &[u64],
        id: &ManifestId,
    ) -> Result<Option<u64>, StorageError> {
        let (mut low, mut high) = (0, numbers.len());
        while low < high {
            let middle = low.midpoint(high);
            match self.source(numbers[middle]).await? {
                Some(source) if source.product != id.product => return Ok(None),
                Some(source) if source.number < id.number => low = middle + 1,
                Some(_) => high = middle,
                None => return Ok(None),
            }
        }
        let mut found = None;
        for number in &numbers[low..] {
            match self.source(*number).await? {
                Some(source) if source == *id => found = Some(*number),
                Some(source) if source.number == id.number => {}
                _ => break,
            }
        }
        Ok(found)
    }

    /// Found by what each was derived from, which is read once.
    async fn anywhere(
        &self,
        numbers: &[u64],
        id: &ManifestId,
    ) -> Result<Option<u64>, StorageError> {
        let mut sources = stream::iter(numbers.iter().rev().copied())
            .map(
                |number| async move { Ok::<_, StorageError>((number, self.source(number).await?)) },
            )
            .buffered(AT_ONCE);
        while let Some((number, source)) = sources.try_next().await? {
            if source.as_ref() == Some(id) {
                return Ok(Some(number));
            }
        }
        Ok(None)
    }

    async fn source(&self, number: u64) -> Result<Option<ManifestId>, StorageError> {
        let name = format!("{}@{number}", self.product);
        if let Some(source) = self.sources.get(&name) {
            return Ok(source);
        }
        // Clean-up may have taken it meanwhile.
        let found = manifests::numbered(&self.store, &self.product, number).await?;
        let Some(derived) = found else {
            return Ok(None);
        };
        self.sources.insert(name, derived.derived_from.clone());
        Ok(derived.derived_from)
    }
}
