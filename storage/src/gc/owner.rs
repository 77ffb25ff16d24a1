//! Who says which objects are in use.

use std::collections::BTreeSet;
use std::time::Duration;

use async_trait::async_trait;
use contract::key::ObjectKey;
use contract::kind::Kind;
use contract::manifest::Manifest;

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
    /// How many of the newest are kept of every numbered list, at least one.
    pub versions: usize,
}

impl Kept {
    /// The newest versions of all products, so many of each.
    pub async fn read(store: &Store, versions: usize) -> Result<Self, StorageError> {
        let mut kept = vec![];
        // A list that cannot be read names things that nobody knows: nothing may be removed.
        for product in manifests::products(store).await? {
            for number in manifests::numbers(store, &product)
                .await?
                .into_iter()
                .rev()
                .take(versions)
            {
                let Some(manifest) = manifests::numbered(store, &product, number).await? else {
                    continue;
                };
                let computed = manifest.computed.iter().flat_map(|it| &it.inputs);
                let sources = computed.map(|input| &input.manifest);
                for source in manifest.derived_from.iter().chain(sources) {
                    kept.extend(manifests::numbered(store, &source.product, source.number).await?);
                }
                kept.push(manifest);
            }
        }
        let manifests = kept;
        Ok(Self {
            manifests,
            versions,
        })
    }
}
