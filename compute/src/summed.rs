//! What may be summed over area and time: a flux of carbon, and no extreme of one.

use contract::analysis::MapStatistic;
use contract::computed::Computation;
use contract::manifest::Manifest;
use contract::quantity::Quantity;
use contract::statistics::Percentile;
use storage::{Store, manifests};

use crate::ComputeError;

/// Has a product budgets, and is carbon accumulated of it?
///
/// # Errors
/// A version that it was made of and that cannot be read.
pub async fn has_budget(store: &Store, manifest: &Manifest) -> Result<bool, ComputeError> {
    if manifest.quantity != Quantity::CarbonFlux {
        return Ok(false);
    }
    match check_summed(store, manifest).await {
        Ok(()) => Ok(true),
        Err(ComputeError::NotSummed { .. }) => Ok(false),
        Err(error) => Err(error),
    }
}

/// # Errors
/// `NotSummed` of the highest or lowest values or a percentile of each cell, and of these on another grid: cells of which each has its
/// value from another time were never there together.
pub(crate) async fn check_summed(store: &Store, manifest: &Manifest) -> Result<(), ComputeError> {
    let mut regridded = None;
    loop {
        let own = regridded.as_ref().unwrap_or(manifest);
        let Some(computed) = &own.computed else {
            return Ok(());
        };
        let from = computed.inputs.first().map(|input| &input.manifest);
        match (&computed.how, from) {
            (Computation::Statistic { statistic, .. }, Some(of)) if is_extreme(*statistic) => {
                return Err(ComputeError::NotSummed {
                    product: manifest.product.clone(),
                    what: in_words(*statistic),
                    of: of.product.clone(),
                });
            }
            (Computation::Regrid { .. }, Some(from)) => {
                regridded = Some(manifests::load(store, from).await?);
            }
            _ => return Ok(()),
        }
    }
}

fn is_extreme(statistic: MapStatistic) -> bool {
    matches!(
        statistic,
        MapStatistic::Min | MapStatistic::Max | MapStatistic::Percentile(_)
    )
}

fn in_words(statistic: MapStatistic) -> String {
    match statistic {
        MapStatistic::Min => "lowest values".to_owned(),
        MapStatistic::Max => "highest values".to_owned(),
        MapStatistic::Percentile(Percentile::MEDIAN) => "medians".to_owned(),
        other => format!("percentiles ({other})"),
    }
}
