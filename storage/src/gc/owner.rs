//! Who says which objects are in use.

use std::collections::BTreeSet;
use std::time::Duration;

use async_trait::async_trait;
use contract::key::ObjectKey;
use contract::kind::Kind;
use contract::manifest::Manifest;
use contract::product::ProductId;

use crate::{StorageError, Store, manifests};

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
    /// The newest versions of every product and, so that they stay readable, those that they were derived from.
    pub manifests: Vec<Manifest>,
    /// How many of the newest are kept of every numbered list, at least one; none where it is asked about one version alone.
    pub versions: usize,
    /// What was written to such a list at this instant or later, ms, stays as well.
    pub oldest_ms: i64,
}

impl Kept {
    /// The newest versions of all products, so many of each.
    pub async fn read(
        store: &Store,
        versions: usize,
        oldest_ms: i64,
    ) -> Result<Self, StorageError> {
        let mut kept = vec![];
        // A list that cannot be read names things that nobody knows: nothing may be removed.
        for product in manifests::products(store).await? {
            for number in manifests::numbers(store, &product)
                .await?
                .into_iter()
                .rev()
                .take(versions)
            {
                kept.extend(with_sources(store, &product, number).await?);
            }
        }
        let manifests = kept;
        Ok(Self {
            manifests,
            versions,
            oldest_ms,
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
