//! What is made of a product, kept up with it: a product that has a newer version in; the newest versions of accumulated
//! carbon, computed products and statistics of it, and of what was made of those, out.
//!
//! How each is made its own newest manifest says. One that cannot be made any more (its inputs have parted) is told of and left
//! as it is.

mod behind;
mod mend;
mod order;
mod recipe;

use std::collections::{BTreeMap, BTreeSet};

use contract::manifest::Manifest;
use contract::product::ProductId;
use futures::future::BoxFuture;
use storage::{Store, manifests};

use crate::computed::{Request, compute_if};
use crate::derive::{
    Progress, StatisticRequest, chosen_start, derive_accumulated_if, derive_statistics_if,
};
use crate::publish::{IsStillAsked, MADE_AGAIN};
use crate::summed::has_budget;
use crate::{ComputeError, Engine, catalogue};
pub use behind::behind;
pub use mend::{mend, to_mend};
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
    follow_telling(engine, product, &|_progress| ())
}

/// The same, telling how far each derivation has come.
///
/// # Errors
/// As there.
pub fn follow_telling<'a>(
    engine: &'a Engine,
    product: &'a ProductId,
    progress: &'a Progress<'a>,
) -> BoxFuture<'a, Result<Vec<Manifest>, ComputeError>> {
    Box::pin(async move {
        let source = catalogue::product(engine.store(), product).await?;
        if is_accumulated(engine.store(), &source).await? {
            product.accumulated()?;
        }
        let mut order = Order::of(product, recipes(engine.store()).await?);
        let mut changed = BTreeSet::from([product.clone()]);
        let mut all = vec![];
        while let Some(next) = order.next() {
            // Where what it is made of was left, it is of what it was.
            let is_touched = |recipe: &Recipe| recipe.sources().any(|it| changed.contains(it));
            let mut touched: BTreeMap<&ProductId, &Recipe> = next
                .iter()
                .filter(|(_, recipe)| is_touched(recipe))
                .collect();
            for _ in 0..MADE_AGAIN {
                let mut asked = vec![];
                for (target, recipe) in &touched {
                    asked.extend(asked_now(engine.store(), target, recipe).await?);
                }
                let Made { newest, otherwise } = make(engine, &asked, progress).await?;
                changed.extend(newest.iter().map(|manifest| manifest.product.clone()));
                all.extend(newest);
                touched.retain(|target, _| otherwise.contains(target));
                if touched.is_empty() {
                    break;
                }
            }
            for product in touched.keys() {
                tracing::error!(%product, "is asked for otherwise again and again; it is made with the next version");
            }
            order.done(next.keys());
        }
        for product in order.left() {
            tracing::error!(%product, "cannot be made again: it is made of itself, through others");
        }
        Ok(all)
    })
}

/// How all products are made that are made of others.
async fn recipes(store: &Store) -> Result<BTreeMap<ProductId, Recipe>, ComputeError> {
    let mut recipes = BTreeMap::new();
    for product in manifests::products(store).await? {
        let Some(latest) = newest(store, &product).await? else {
            continue;
        };
        // Of one whose inputs cannot be read nothing is accumulated, and all others can be made.
        let is_accumulated = is_accumulated(store, &latest).await;
        if let Ok(target) = product.accumulated()
            && told(&product, is_accumulated)?.unwrap_or(false)
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

/// Is carbon accumulated of it? Of a flux that landed or was computed, and of no mean or extreme of one.
async fn is_accumulated(store: &Store, source: &Manifest) -> Result<bool, ComputeError> {
    let is_by_step = source
        .computed
        .as_ref()
        .is_some_and(|it| it.how.is_by_step());
    if source.derived_from.is_some() && !is_by_step {
        return Ok(false);
    }
    has_budget(store, source).await
}

/// What came of making products.
#[derive(Default)]
struct Made {
    newest: Vec<Manifest>,
    /// Products that were asked for otherwise meanwhile, and are left as they are.
    otherwise: BTreeSet<ProductId>,
}

impl Made {
    /// Adds what came of a product.
    ///
    /// # Errors
    /// What may pass; all else is told of.
    fn add(
        &mut self,
        product: &ProductId,
        made: Result<Vec<Manifest>, ComputeError>,
    ) -> Result<(), ComputeError> {
        match made {
            Err(ComputeError::AskedOtherwise { product }) => _ = self.otherwise.insert(product),
            made => self
                .newest
                .extend(told(product, made)?.into_iter().flatten()),
        }
        Ok(())
    }
}

/// Makes a product, or statistics that read the same.
async fn make(
    engine: &Engine,
    asked: &[Recipe],
    progress: &Progress<'_>,
) -> Result<Made, ComputeError> {
    let mut statistics = vec![];
    let mut made = Made::default();
    for recipe in asked {
        match recipe {
            Recipe::Accumulated(source) => {
                let target = source.accumulated()?;
                let before = manifests::latest(engine.store(), &target).await?;
                let before = before.as_ref().map(Manifest::accumulated_since);
                let is_still_asked =
                    |latest: Option<&Manifest>| latest.map(Manifest::accumulated_since) == before;
                let is_still_asked = Some(&is_still_asked as &IsStillAsked<'_>);
                // A start that somebody chose stays as long as the product does.
                let start = chosen_start(engine.store(), source).await?;
                let derived =
                    derive_accumulated_if(engine, source, start, is_still_asked, progress);
                match derived.await {
                    Err(ComputeError::AskedOtherwise { product }) => {
                        made.otherwise.insert(product);
                    }
                    accumulated => made.newest.push(accumulated?),
                }
            }
            Recipe::Computed(request) => {
                let is_still_asked = |latest: Option<&Manifest>| {
                    latest.and_then(Request::of).as_ref() == Some(&**request)
                };
                let outcome = compute_if(engine, request, Some(&is_still_asked), progress).await;
                let computed = outcome.map(|outcome| vec![outcome.manifest]);
                made.add(&request.target, computed)?;
            }
            Recipe::Statistic(request) => statistics.push(&**request),
        }
    }
    of_cells(engine, statistics, progress, &mut made).await?;
    Ok(made)
}

/// Statistics that read the same, together; each alone where one of them cannot be made.
async fn of_cells(
    engine: &Engine,
    mut requests: Vec<&StatisticRequest>,
    progress: &Progress<'_>,
    all: &mut Made,
) -> Result<(), ComputeError> {
    let derived = async |requests: &[&StatisticRequest]| {
        let options: Vec<_> = requests.iter().map(|one| one.options.clone()).collect();
        let is_still_asked = |latest: Option<&Manifest>| {
            let asked = latest.and_then(|latest| StatisticRequest::of(latest).ok().flatten());
            asked.is_some_and(|asked| requests.contains(&&asked))
        };
        let source = &requests[0].product;
        derive_statistics_if(engine, source, &options, Some(&is_still_asked), progress).await
    };
    while requests.len() > 1 {
        match derived(&requests).await {
            Err(ComputeError::AskedOtherwise { product }) => {
                requests.retain(|one| one.target != product);
                all.otherwise.insert(product);
            }
            Err(error) if error.is_retryable() => return Err(error),
            Err(_) => break,
            Ok(made) => {
                all.newest.extend(made);
                return Ok(());
            }
        }
    }
    for request in requests {
        all.add(&request.target, derived(&[request]).await)?;
    }
    Ok(())
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
