//! Who says which objects are in use.

use std::collections::BTreeSet;
use std::time::Duration;

use async_trait::async_trait;
use contract::key::ObjectKey;
use contract::kind::Kind;
use contract::manifest::{Manifest, ManifestId};
use contract::product::ProductId;

use crate::{StorageError, Store, manifests, pins};

/// The youngest age that may be removed: whoever is writing has long been done.
pub const LEAST_AGE: Duration = Duration::from_hours(1);

/// Lays out objects of some kinds, and so knows which of them are in use.
#[async_trait]
pub trait Owner: Send + Sync {
    /// The kinds that it lays out: no other owner does.
    fn kinds(&self) -> &'static [Kind];

    /// The youngest age at which one of them may be removed.
    fn least_age(&self) -> Duration {
        LEAST_AGE
    }

    /// Can what is gone be made again from what stays?
    fn is_made_again(&self) -> bool {
        false
    }

    /// Those in use. One that is young stays anyway.
    ///
    /// # Errors
    /// A store that does not answer; something unreadable that would say what is in use.
    async fn in_use(
        &self,
        _store: &Store,
        _kept: &Kept,
    ) -> Result<BTreeSet<ObjectKey>, StorageError> {
        Ok(BTreeSet::new())
    }

    /// The object of another kind that an object is in use with.
    fn lives_with(&self, _key: &ObjectKey) -> Option<ObjectKey> {
        None
    }
}

/// The versions that are kept.
#[derive(Debug)]
pub struct Kept {
    /// The newest versions of every product, those that are pinned and, so that they stay readable, those that they were derived from.
    pub manifests: Vec<Manifest>,
    /// How many of the newest are kept of every numbered list, at least one; none where it is asked about one version alone.
    pub versions: usize,
    /// What was written to such a list at this instant or later, ms, stays as well.
    pub oldest_ms: i64,
    /// Versions that are pinned, whether they are there or not.
    pub pinned: Vec<ManifestId>,
    /// How many of these are there and would not be kept for being new.
    pub only_pinned_count: usize,
}

impl Kept {
    /// The newest versions of all products, so many of each, and those that are pinned.
    ///
    /// # Errors
    /// A store that does not answer; a pin or a manifest that cannot be read.
    pub async fn read(
        store: &Store,
        versions: usize,
        oldest_ms: i64,
    ) -> Result<Self, StorageError> {
        let (mut kept, mut only_pinned_count) = (vec![], 0);
        // A pin or a list that cannot be read names things that nobody knows: nothing may be removed.
        let pins = pins::all(store).await?;
        let pinned: Vec<ManifestId> = pins.into_iter().map(|pin| pin.version).collect();
        for product in manifests::products(store).await? {
            let there = manifests::numbers(store, &product).await?;
            let newest = there.iter().rev().take(versions);
            let mut numbers: BTreeSet<u64> = newest.copied().collect();
            for pin in pinned.iter().filter(|pin| pin.product == product) {
                let is_old = numbers.insert(pin.number);
                only_pinned_count += usize::from(is_old && there.contains(&pin.number));
            }
            for number in numbers.into_iter().rev() {
                kept.extend(with_sources(store, &product, number).await?);
            }
        }
        let manifests = kept;
        Ok(Self {
            manifests,
            versions,
            oldest_ms,
            pinned,
            only_pinned_count,
        })
    }

    /// Versions that are none of the newest ones and stay, since they are young.
    pub(super) async fn young(&self, store: &Store) -> Result<Vec<(ProductId, u64)>, StorageError> {
        let mut young = vec![];
        for product in manifests::products(store).await? {
            let published = manifests::published(store, &product).await?;
            let before_newest = published.iter().rev().skip(self.versions);
            let stay = before_newest.filter(|(_, written)| written.ms() >= self.oldest_ms);
            young.extend(stay.map(|(number, _)| (product.clone(), *number)));
        }
        Ok(young)
    }

    /// One version alone, and those that it was derived from.
    pub(super) async fn one(
        store: &Store,
        product: &ProductId,
        number: u64,
    ) -> Result<Self, StorageError> {
        Ok(Self {
            manifests: with_sources(store, product, number).await?,
            versions: 0,
            oldest_ms: i64::MAX,
            pinned: vec![],
            only_pinned_count: 0,
        })
    }
}

/// A version behind those that it was derived from; nothing if clean-up took it meanwhile.
async fn with_sources(
    store: &Store,
    product: &ProductId,
    number: u64,
) -> Result<Vec<Manifest>, StorageError> {
    let mut found = vec![];
    let Some(manifest) = manifests::numbered(store, product, number).await? else {
        return Ok(found);
    };
    let computed = manifest.computed.iter().flat_map(|it| &it.inputs);
    let sources = computed.map(|input| &input.manifest);
    for source in manifest.derived_from.iter().chain(sources) {
        found.extend(manifests::numbered(store, &source.product, source.number).await?);
    }
    found.push(manifest);
    Ok(found)
}
