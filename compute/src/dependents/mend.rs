//! A product that was computed here in; the same product out, what was damaged or gone of it made again.

use std::collections::BTreeSet;

use contract::ContractError;
use contract::key::ObjectKey;
use contract::manifest::Manifest;
use contract::product::ProductId;
use futures::future::BoxFuture;
use storage::{Store, verify};

use super::recipe::Recipe;
use crate::computed::compute;
use crate::derive::{accumulated_from, derive_statistic};
use crate::{ComputeError, Engine, catalogue};

/// Makes a computed product or a statistic again of what it is made of now, where fields of its newest version or its domain are damaged or
/// gone; the version that has it then. None if all is whole, and of what landed, which is read again from its files.
///
/// # Errors
/// It cannot be made again by itself, with what to do: it is accumulated, which its flux says how, or how it was made is not kept.
pub fn mend<'a>(
    engine: &'a Engine,
    product: &'a ProductId,
) -> BoxFuture<'a, Result<Option<Manifest>, ComputeError>> {
    Box::pin(async move {
        let store = engine.store();
        let Some((broken, recipe)) = broken_of(store, product).await? else {
            return Ok(None);
        };
        // Who makes it keeps what is there.
        for key in &broken {
            store.remove(key).await?;
        }
        Ok(match recipe {
            Recipe::Computed(request) => {
                let made = compute(engine, &request, &|_progress| ()).await?;
                Some(made.manifest)
            }
            Recipe::Statistic(request) => {
                let (of, options) = (&request.product, &request.options);
                Some(derive_statistic(engine, of, options, &|_progress| ()).await?)
            }
            // A manifest keeps no such recipe.
            Recipe::Accumulated(_) => None,
        })
    })
}

/// What [`mend`] would make again of a product now, damaged or gone; nothing is changed.
///
/// # Errors
/// As there.
pub fn to_mend<'a>(
    store: &'a Store,
    product: &'a ProductId,
) -> BoxFuture<'a, Result<BTreeSet<ObjectKey>, ComputeError>> {
    Box::pin(async move {
        let found = broken_of(store, product).await?;
        Ok(found.map(|(broken, _recipe)| broken).unwrap_or_default())
    })
}

/// What is damaged or gone of the newest version of a product that was computed here, and how that is made.
async fn broken_of(
    store: &Store,
    product: &ProductId,
) -> Result<Option<(BTreeSet<ObjectKey>, Recipe)>, ComputeError> {
    let newest = catalogue::product(store, product).await?;
    if newest.derived_from.is_none() {
        return Ok(None);
    }
    let broken = verify::broken(store, &newest).await?;
    if broken.is_empty() {
        return Ok(None);
    }
    let refused = |reason: String| ContractError::invalid("product", product.as_str(), reason);
    let count = broken.len();
    if let Some(flux) = accumulated_from(&newest) {
        let flux = &flux.product;
        return Err(refused(format!(
            "{count} of its objects are damaged or gone, and it is accumulated from {flux}: `fluxglobe recompute --product {flux} --verify` makes them again"
        ))
        .into());
    }
    let Some(recipe) = Recipe::of(&newest)? else {
        return Err(refused(format!(
            "{count} of its objects are damaged or gone, and how it was made is not kept: `fluxglobe derive` makes it again, asked as it was"
        ))
        .into());
    };
    Ok(Some((broken, recipe)))
}
