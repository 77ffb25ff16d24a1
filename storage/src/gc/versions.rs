//! What versions of products are made of, and pictures of them.

use std::collections::BTreeSet;

use async_trait::async_trait;
use contract::key::ObjectKey;
use contract::kind::Kind;

use super::{Kept, Owner};
use crate::{StorageError, Store};

/// Manifests and what they name; but for series, which versions of before name and nobody reads any more.
#[derive(Debug)]
pub struct Versions;

#[async_trait]
impl Owner for Versions {
    fn kinds(&self) -> &'static [Kind] {
        &[
            Kind::Manifest,
            Kind::ManifestPage,
            Kind::Contributed,
            Kind::Domain,
            Kind::Field,
            Kind::Raw,
            Kind::Series,
        ]
    }

    async fn in_use(
        &self,
        _store: &Store,
        kept: &Kept,
    ) -> Result<BTreeSet<ObjectKey>, StorageError> {
        let mut keys = BTreeSet::new();
        for manifest in &kept.manifests {
            let product = &manifest.product;
            keys.insert(ObjectKey::manifest(product, manifest.number));
            keys.insert(manifest.domain.clone());
            if let Some((paged, _pages)) = manifest.paged() {
                keys.extend(paged.page_keys());
            }
            for step in &manifest.steps {
                keys.insert(step.field.clone());
                keys.extend(step.contributed.iter().map(|step| step.counts.clone()));
                keys.insert(ObjectKey::raw(product, &step.raw_sha256));
            }
        }
        Ok(keys)
    }
}

/// Drawn pictures: kept while they are young.
#[derive(Debug)]
pub struct Pictures;

impl Owner for Pictures {
    fn kinds(&self) -> &'static [Kind] {
        &[Kind::Tile]
    }

    fn is_made_again(&self) -> bool {
        true
    }
}
