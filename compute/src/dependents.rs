//! What is made of a product, kept up with it: a product that has a newer version in; the newest versions of accumulated
//! carbon, computed products and statistics of it, and of what was made of those, out.
//!
//! How each is made its own newest manifest says. One that cannot be made any more (its inputs have parted) is told of and left
//! as it is.

mod order;
mod recipe;

use std::collections::{BTreeMap, BTreeSet};

use contract::manifest::Manifest;
use contract::product::ProductId;
use contract::quantity::Quantity;
use futures::future::BoxFuture;
use storage::{Store, manifests};

use crate::computed::{Request, compute};
use crate::derive::{StatisticRequest, chosen_start, derive_statistics};
use crate::{ComputeError, Engine, catalogue, derive_accumulated};
use order::Order;
use recipe::Recipe;
pub use recipe::why_it_stays;

/// Brings everything up to date that is made of a product, directly or through others; their newest versions, each after
/// those it is made of, each once. Carbon of a flux is accumulated where it never was.
///
/// # Errors
/// What may pass, and carbon that cannot be accumulated; all else that cannot be made is told of and left.
pub fn follow<'a>(
    engine: &'a Engine,
    product: &'a ProductId,
) -> BoxFuture<'a, Result<Vec<Manifest>, ComputeError>> {
    Box::pin(async move {
        let source = catalogue::product(engine.store(), product).await?;
        if is_accumulated(&source) {
            product.accumulated()?;
        }
        let mut order = Order::of(product, recipes(engine.store()).await?);
        let mut changed = BTreeSet::from([product.clone()]);
        let mut made = vec![];
        while let Some(next) = order.next() {
            // Where what it is made of was left, it is of what it was.
            let is_touched = |recipe: &Recipe| recipe.sources().any(|it| changed.contains(it));
            let mut touched = vec![];
            for (target, recipe) in next.iter().filter(|(_, recipe)| is_touched(recipe)) {
                touched.extend(asked_now(engine.store(), target, recipe).await?);
            }
            let newest = make(engine, touched.iter().collect()).await?;
            changed.extend(newest.iter().map(|manifest| manifest.product.clone()));
            made.extend(newest);
            order.done(next.keys());
        }
        for product in order.left() {
            tracing::error!(%product, "cannot be made again: it is made of itself, through others");
        }
        Ok(made)
    })
}

/// How all products are made that are made of others.
async fn recipes(store: &Store) -> Result<BTreeMap<ProductId, Recipe>, ComputeError> {
    let mut recipes = BTreeMap::new();
    for product in manifests::products(store).await? {
        let Some(latest) = newest(store, &product).await? else {
            continue;
        };
        if let Some(target) = product
            .accumulated()
            .ok()
            .filter(|_| is_accumulated(&latest))
        {
            recipes.insert(target, Recipe::Accumulated(product.clone()));
        }
        match Recipe::of(&latest) {
            Ok(Some(recipe)) => _ = recipes.insert(product, recipe),
            Ok(None) => {}
            Err(error) => tracing::error!(%product, %error, "cannot be made again"),
        }
    }
    Ok(recipes)
}

/// The newest manifest of a product; none of one that cannot be read, which is told of: all others can be made.
async fn newest(store: &Store, product: &ProductId) -> Result<Option<Manifest>, ComputeError> {
    let latest = manifests::latest(store, product).await;
    Ok(told(product, latest.map_err(ComputeError::from))?.flatten())
}

/// How a product is made by its newest version: somebody may have asked for it otherwise while others were made. None if it is to stay.
async fn asked_now(
    store: &Store,
    target: &ProductId,
    recipe: &Recipe,
) -> Result<Option<Recipe>, ComputeError> {
    if let Recipe::Accumulated(source) = recipe {
        return Ok(Some(Recipe::Accumulated(source.clone())));
    }
    let Some(latest) = newest(store, target).await? else {
        return Ok(None);
    };
    let asked = Recipe::of(&latest).map_err(ComputeError::from);
    Ok(told(target, asked)?.flatten())
}

/// Is carbon accumulated of it? Of a flux that landed or was computed, and of no mean of one.
fn is_accumulated(source: &Manifest) -> bool {
    let is_by_step = source
        .computed
        .as_ref()
        .is_some_and(|it| it.how.is_by_step());
    source.quantity == Quantity::CarbonFlux && (source.derived_from.is_none() || is_by_step)
}

/// Makes a product, or statistics that read the same.
async fn make(engine: &Engine, next: Vec<&Recipe>) -> Result<Vec<Manifest>, ComputeError> {
    let mut statistics = vec![];
    let mut made = vec![];
    for recipe in next {
        match recipe {
            Recipe::Accumulated(source) => {
                // A start that somebody chose stays as long as the product does.
                let start = chosen_start(engine.store(), source).await?;
                made.push(derive_accumulated(engine, source, start, &|_progress| ()).await?);
            }
            Recipe::Computed(request) => made.extend(computed(engine, request).await?),
            Recipe::Statistic(request) => statistics.push(&**request),
        }
    }
    made.extend(of_cells(engine, &statistics).await?);
    Ok(made)
}

async fn computed(engine: &Engine, request: &Request) -> Result<Option<Manifest>, ComputeError> {
    let outcome = compute(engine, request, &|_progress| ()).await;
    told(&request.target, outcome.map(|outcome| outcome.manifest))
}

/// Statistics that read the same, together; each alone where one of them cannot be made.
async fn of_cells(
    engine: &Engine,
    requests: &[&StatisticRequest],
) -> Result<Vec<Manifest>, ComputeError> {
    let Some(first) = requests.first() else {
        return Ok(vec![]);
    };
    let source = &first.product;
    if requests.len() > 1 {
        let options: Vec<_> = requests.iter().map(|one| one.options.clone()).collect();
        match derive_statistics(engine, source, &options, &|_progress| ()).await {
            Err(error) if !error.is_retryable() => {}
            made => return made,
        }
    }
    let mut made = vec![];
    for request in requests {
        let options = std::slice::from_ref(&request.options);
        let alone = derive_statistics(engine, source, options, &|_progress| ()).await;
        made.extend(told(&request.target, alone)?.into_iter().flatten());
    }
    Ok(made)
}

/// What was made; nothing of what cannot be, which is told of.
fn told<T>(product: &ProductId, made: Result<T, ComputeError>) -> Result<Option<T>, ComputeError> {
    match made {
        Ok(made) => Ok(Some(made)),
        Err(error) if error.is_retryable() => Err(error),
        Err(error) => {
            tracing::error!(%product, %error, "cannot be made again");
            Ok(None)
        }
    }
}
