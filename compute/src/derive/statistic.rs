//! Statistics of every cell: a product and a statistic in; a product of its own out, landed like any other.

mod anomalies;
mod blocks;
mod cells;
mod landed;
mod plan;
mod quantity;
mod wanted;

use contract::ContractError;
use contract::analysis::{MapOptions, MapStatistic};
use contract::manifest::Manifest;
use contract::product::ProductId;
use contract::region::AskedRegion;
use futures::future::BoxFuture;
use storage::manifests;

use super::{Progress, commit};
use crate::{ComputeError, Engine, catalogue};
use landed::{Landing, computed};
use plan::Plan;
use wanted::Wanted;

/// Derives a statistic of each cell of the newest version of a product: [`derive_statistics`] of one.
///
/// # Errors
/// As there.
pub fn derive_statistic<'a>(
    engine: &'a Engine,
    product: &'a ProductId,
    options: &'a MapOptions,
    progress: &'a Progress<'a>,
) -> BoxFuture<'a, Result<Manifest, ComputeError>> {
    Box::pin(async move {
        let options = std::slice::from_ref(options);
        let made = derive_statistics(engine, product, options, progress).await?;
        let one = made.into_iter().next();
        one.ok_or_else(|| ComputeError::inconsistent("a statistic", "none was derived"))
    })
}

/// Derives statistics of each cell of the newest version of a product, or of those in one region, in their order.
///
/// Cells are read once for all of them, in blocks over all time, as many at once as fit an eighth of the engine's memory, and computed on all processors:
/// the same bits whatever their number. Where the newest version of a statistic was derived from the same steps in the same way, it
/// is returned as it is. [`super::derived`] is the event to tell of each, after its manifest.
///
/// # Errors
/// Steps that one cannot be made of, a target that was not derived from the product, and what reading and writing meet; nothing is
/// computed before all are looked at.
pub fn derive_statistics<'a>(
    engine: &'a Engine,
    product: &'a ProductId,
    options: &'a [MapOptions],
    progress: &'a Progress<'a>,
) -> BoxFuture<'a, Result<Vec<Manifest>, ComputeError>> {
    Box::pin(async move {
        let source = catalogue::product(engine.store(), product).await?;
        let wanted = Wanted::of(&source, one_region(options)?)?;
        let mut asked = vec![];
        for one in options {
            asked.push(Asked::of(engine, &source, one).await?);
        }
        let is_twice =
            |one: &Asked| asked.iter().filter(|own| own.target == one.target).count() > 1;
        if let Some(twice) = asked.iter().find(|one| is_twice(one)) {
            let reason = "two statistics would become this one product";
            return Err(ContractError::invalid("product", twice.target.as_str(), reason).into());
        }
        let plans = asked.iter().filter(|one| one.there.is_none());
        let plans: Vec<Plan> = plans.map(|one| one.plan.clone()).collect();
        let found = computed(engine, &source, &plans, &wanted, progress).await?;
        let mut found = found.into_iter();
        let mut made = vec![];
        for Asked {
            target,
            plan,
            there,
        } in asked
        {
            let computed = if there.is_some() { None } else { found.next() };
            let Some(computed) = computed else {
                made.extend(there);
                continue;
            };
            let landing = Landing {
                engine,
                source: &source,
                target: &target,
                plan: &plan,
                wanted: &wanted,
            };
            let derived = match plan.statistic {
                MapStatistic::Anomaly => landing.anomalies(computed, progress).await?,
                _ => landing.each(computed).await?,
            };
            made.push(commit(engine, &source, derived).await?);
        }
        Ok(made)
    })
}

/// The region of all that is derived together.
fn one_region(options: &[MapOptions]) -> Result<Option<&AskedRegion>, ContractError> {
    let first = options.first().and_then(|one| one.region.as_ref());
    match options.iter().find(|one| one.region.as_ref() != first) {
        None => Ok(first),
        Some(other) => {
            let name = other.region.as_ref().map_or("global", |own| &own.name);
            let reason = "statistics that are derived together are of one region";
            Err(ContractError::invalid("region", name, reason))
        }
    }
}

/// A statistic that is asked for.
struct Asked {
    target: ProductId,
    plan: Plan,
    /// Its newest version, if that is what would be derived.
    there: Option<Manifest>,
}

impl Asked {
    async fn of(
        engine: &Engine,
        source: &Manifest,
        options: &MapOptions,
    ) -> Result<Self, ComputeError> {
        let product = &source.product;
        let target = options.target(product)?;
        let plan = Plan::of(source, options)?;
        let mut there = None;
        if let Some(latest) = manifests::latest(engine.store(), &target).await? {
            let of_it = latest.derived_from.as_ref().map(|from| &from.product);
            if of_it != Some(product) {
                let reason = format!(
                    "there is a product of this name that is no statistic of {product}: give another name"
                );
                return Err(ContractError::invalid("product", target.as_str(), reason).into());
            }
            if plan.is_up_to_date(&latest, source) {
                // Whoever published it may have been killed before the cube followed.
                cube::keep_up(engine.store(), &latest).await;
                there = Some(latest);
            }
        }
        Ok(Self {
            target,
            plan,
            there,
        })
    }
}
