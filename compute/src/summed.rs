//! What may be summed over area and time, a flux of carbon and no extreme of one; and what may be averaged, no days of a year that goes round
//! and, on the way to another grid, no codes.

use std::collections::BTreeSet;

use contract::ContractError;
use contract::analysis::MapStatistic;
use contract::computed::{Computation, Computed, Regridding};
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
/// `NotSummed` of the highest or lowest values or a percentile of each cell, and of these on another grid or averaged: cells of which each has
/// its value from another time were never there together.
pub(crate) async fn check_summed(store: &Store, manifest: &Manifest) -> Result<(), ComputeError> {
    // What keeps the quantity of what it is made of.
    let keeps = |how: &Computation| {
        matches!(
            how,
            Computation::Regrid { .. }
                | Computation::Statistic {
                    statistic: MapStatistic::Mean | MapStatistic::Climatology,
                    ..
                }
        )
    };
    for computed in made_by(store, manifest, keeps).await? {
        if let Some(statistic) = computed.how.statistic().filter(|it| is_extreme(*it))
            && let Some(from) = computed.inputs.first()
        {
            return Err(ComputeError::NotSummed {
                product: manifest.product.clone(),
                what: in_words(statistic),
                of: from.manifest.product.clone(),
            });
        }
    }
    Ok(())
}

/// # Errors
/// Of the phase of the year's wave, on whichever grid: 31 December and 1 January are next to each other, and the mean of their numbers lies
/// in July.
pub(crate) async fn check_averaged(store: &Store, manifest: &Manifest) -> Result<(), ComputeError> {
    let keeps = |how: &Computation| matches!(how, Computation::Regrid { .. });
    let computed = made_by(store, manifest, keeps).await?;
    let mut statistics = computed.iter().filter_map(|it| it.how.statistic());
    if statistics.all(|statistic| statistic != MapStatistic::Phase) {
        return Ok(());
    }
    let reason = "it holds days of the year, which go round: the mean of 1 January and 31 December is no day in July; ask for single places";
    let refused = ContractError::invalid("product", manifest.product.as_str(), reason);
    Err(refused.into())
}

/// # Errors
/// Of what no mean is to be taken, unless each cell has the value of one: codes of a mask, whose mean is another code, and what
/// [`check_averaged`] refuses.
pub(crate) async fn check_regridded(
    store: &Store,
    manifest: &Manifest,
    method: Regridding,
) -> Result<(), ComputeError> {
    match method {
        Regridding::Nearest => Ok(()),
        Regridding::Bilinear | Regridding::Conservative if holds_codes(manifest) => {
            let reason = format!(
                "{} holds codes, and the mean of two is the code of something else: bring it to another grid with --method {}",
                manifest.product,
                Regridding::Nearest,
            );
            Err(ComputeError::Expression { reason })
        }
        Regridding::Bilinear | Regridding::Conservative => check_averaged(store, manifest).await,
    }
}

/// The method that brings a product to another grid with all that it holds: by means, or where there are none by single cells.
pub(crate) fn usual_regridding(manifest: &Manifest) -> Regridding {
    let computed = manifest.computed.as_ref();
    let statistic = computed.and_then(|computed| computed.how.statistic());
    if holds_codes(manifest) || statistic == Some(MapStatistic::Phase) {
        Regridding::Nearest
    } else {
        Regridding::Conservative
    }
}

fn holds_codes(manifest: &Manifest) -> bool {
    !manifest.quantity.flags().is_empty()
}

/// How a version was computed, and before it what it was made of, as long as each `keeps` what that holds; its own computation is the first.
async fn made_by(
    store: &Store,
    manifest: &Manifest,
    keeps: fn(&Computation) -> bool,
) -> Result<Vec<Computed>, ComputeError> {
    let (mut found, mut seen) = (vec![], BTreeSet::from([manifest.product.clone()]));
    let mut next = manifest.computed.clone();
    while let Some(computed) = next.take() {
        if let Some(from) = computed.inputs.first().filter(|_| keeps(&computed.how)) {
            let from = &from.manifest;
            let source = match manifests::load(store, from).await {
                Ok(source) => Some(source),
                // That version is let go; of what kind the product is the newest one says.
                Err(error) if error.is_not_found() => {
                    manifests::latest(store, &from.product).await?
                }
                Err(error) => return Err(error.into()),
            };
            let source = source.filter(|source| seen.insert(source.product.clone()));
            next = source.and_then(|source| source.computed);
        }
        found.push(computed);
    }
    Ok(found)
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
