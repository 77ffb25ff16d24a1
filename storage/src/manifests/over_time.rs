//! A version in, what its values are over time out: that of the statistic behind it, however often it was brought to another grid or averaged
//! since.

use std::collections::BTreeSet;

use contract::analysis::MapStatistic;
use contract::computed::Computation;
use contract::manifest::{Manifest, ManifestId};
use contract::product::ProductId;

use super::{latest, load};
use crate::{StorageError, Store};

/// A statistic over time, and whose.
#[derive(Debug, Clone, PartialEq)]
pub struct OverTime {
    /// Which.
    pub statistic: MapStatistic,
    /// The product that it is one of.
    pub of: ProductId,
}

impl OverTime {
    /// Has each cell its value from another time?
    pub fn is_extreme(&self) -> bool {
        matches!(
            self.statistic,
            MapStatistic::Min | MapStatistic::Max | MapStatistic::Percentile(_)
        )
    }
}

/// What the values of a version are over time of what it was made of; none of one that is no statistic of another. Another grid leaves it what it
/// is, and so do means of extremes.
///
/// # Errors
/// A version that it was made of and that cannot be read.
pub async fn over_time(
    store: &Store,
    manifest: &Manifest,
) -> Result<Option<OverTime>, StorageError> {
    let mut known: Option<OverTime> = None;
    let (mut source, mut seen) = (None, BTreeSet::from([manifest.product.clone()]));
    loop {
        let own = source.as_ref().unwrap_or(manifest);
        let Some(computed) = &own.computed else {
            return Ok(known);
        };
        let Some(from) = computed.inputs.first().map(|input| &input.manifest) else {
            return Ok(known);
        };
        if let Some(statistic) = computed.how.statistic() {
            let of = from.product.clone();
            let found = OverTime { statistic, of };
            if known.is_none() || found.is_extreme() {
                known = Some(found);
            }
        }
        match &computed.how {
            // What keeps the quantity of what it is made of.
            Computation::Regrid { .. }
            | Computation::Statistic {
                statistic: MapStatistic::Mean | MapStatistic::Climatology,
                ..
            } => {
                let found = of_kind(store, from).await?;
                match found {
                    Some(found) if seen.insert(found.product.clone()) => source = Some(found),
                    _ => return Ok(known),
                }
            }
            _ => return Ok(known),
        }
    }
}

/// A version that others are made of, or where it is gone the newest one, which says of what kind its product is; none of a product that is
/// gone.
///
/// # Errors
/// Neither can be read.
pub async fn of_kind(store: &Store, id: &ManifestId) -> Result<Option<Manifest>, StorageError> {
    match load(store, id).await {
        Ok(found) => Ok(Some(found)),
        // That version is let go, or another one has its number.
        Err(error) if error.is_not_found() || matches!(error, StorageError::Damaged { .. }) => {
            latest(store, &id.product).await
        }
        Err(error) => Err(error),
    }
}
