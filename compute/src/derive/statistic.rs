//! Statistics of every cell: a product and a statistic in; a product of its own out, landed like any other.

mod anomalies;
mod blocks;
mod cells;
mod landed;
mod plan;
mod quantity;

use contract::ContractError;
use contract::analysis::{MapOptions, MapStatistic};
use contract::manifest::Manifest;
use contract::product::ProductId;
use futures::future::BoxFuture;
use storage::manifests;

use super::{Progress, commit};
use crate::{ComputeError, Engine, catalogue};
use plan::Plan;

/// Derives a statistic of each cell of the newest version of a product.
///
/// Cells are read in blocks over all time, as many at once as fit 128 MiB, and computed on all processors: the same bits
/// whatever their number. If the newest version of the statistic was derived from the same steps in the same way, it is
/// returned as it is. [`super::derived`] is the event to tell of it, after the manifest.
///
/// # Errors
/// Steps that it cannot be made of, a target that was not derived from the product, and what reading and writing meet.
pub fn derive_statistic<'a>(
    engine: &'a Engine,
    product: &'a ProductId,
    options: &'a MapOptions,
    progress: &'a Progress<'a>,
) -> BoxFuture<'a, Result<Manifest, ComputeError>> {
    Box::pin(async move {
        let source = catalogue::product(engine.store(), product).await?;
        let target = options.target(product)?;
        let plan = Plan::of(&source, options)?;
        if let Some(latest) = manifests::latest(engine.store(), &target).await? {
            let of_it = latest.derived_from.as_ref().map(|from| &from.product);
            if of_it != Some(product) {
                let reason = format!(
                    "there is a product of this name that is no statistic of {product}: give another name"
                );
                return Err(ContractError::invalid("product", target.as_str(), reason).into());
            }
            if plan.is_up_to_date(&latest, &source) {
                // Whoever published it may have been killed before the cube followed.
                cube::keep_up(engine.store(), &latest).await;
                return Ok(latest);
            }
        }
        let derived = match options.statistic {
            MapStatistic::Anomaly => {
                anomalies::land(engine, &source, &target, &plan, progress).await?
            }
            _ => landed::land(engine, &source, &target, &plan, progress).await?,
        };
        commit(engine, &source, derived).await
    })
}
