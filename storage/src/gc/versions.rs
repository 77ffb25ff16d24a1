//! What versions of products are made of, and pictures of them.

use std::collections::BTreeSet;

use async_trait::async_trait;
use contract::key::ObjectKey;
use contract::kind::Kind;
use contract::manifest::{LEAST_PAGED_STEPS, Manifest};

use super::{Kept, Owner};
use crate::{StorageError, Store, manifests};

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
        store: &Store,
        kept: &Kept,
    ) -> Result<BTreeSet<ObjectKey>, StorageError> {
        // Of one that is pinned the manifest is in use even where it is gone: whoever has just removed it is to know.
        let pinned = kept.pinned.iter();
        let pinned = pinned.map(|pin| ObjectKey::manifest(&pin.product, pin.number));
        let mut keys: BTreeSet<ObjectKey> = pinned.collect();
        for manifest in &kept.manifests {
            keys.extend(attachments(store, manifest).await?);
            let product = &manifest.product;
            keys.insert(ObjectKey::manifest(product, manifest.number));
            keys.insert(manifest.domain.clone());
            if manifest.steps.len() >= LEAST_PAGED_STEPS {
                // As they are named: versions of before were cut otherwise.
                let own = ObjectKey::manifest(product, manifest.number);
                keys.extend(manifests::page_keys(store, &own).await?);
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

/// What the steps of an attached version refer to: that is newer than what the version names where the product was attached
/// again. All that was ever attached of the product where one of them cannot be read.
async fn attachments(
    store: &Store,
    manifest: &Manifest,
) -> Result<BTreeSet<ObjectKey>, StorageError> {
    let mut keys = BTreeSet::new();
    if store.bare.is_none() {
        return Ok(keys);
    }
    let (product, steps) = (&manifest.product, &manifest.steps);
    // Most versions refer to nothing, as their ends say: those have their values here.
    let mut has_values = true;
    for step in steps.first().into_iter().chain(steps.last()) {
        has_values &= matches!(store.reference(&step.field).await, Ok(None));
    }
    if has_values {
        return Ok(keys);
    }
    for step in steps {
        match store.reference(&step.field).await {
            Ok(Some(reference)) => {
                keys.insert(ObjectKey::raw(product, &reference.attachment));
            }
            Ok(None) => {}
            Err(e) if e.is_not_found() => {}
            // It is damaged, or of a newer program, and may refer to any of them.
            Err(StorageError::Damaged { .. }) => {
                let folder = format!("{}/{product}", Kind::Raw.folder());
                return Ok(store.list(&folder).await?.into_iter().collect());
            }
            Err(e) => return Err(e),
        }
    }
    Ok(keys)
}

/// Hints of newest numbers: kept as long as their product has a version.
#[derive(Debug)]
pub struct Hints;

#[async_trait]
impl Owner for Hints {
    fn kinds(&self) -> &'static [Kind] {
        &[Kind::Newest]
    }

    fn is_made_again(&self) -> bool {
        true
    }

    async fn in_use(
        &self,
        store: &Store,
        kept: &Kept,
    ) -> Result<BTreeSet<ObjectKey>, StorageError> {
        // Where nobody reads them they are of a copy, and no clean-up brings them up.
        let kept = kept.manifests.iter().filter(|_| store.exchanges_at_once());
        Ok(kept
            .map(|manifest| ObjectKey::newest(&manifest.product))
            .collect())
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
