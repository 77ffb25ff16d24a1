//! The domain of a product that is damaged or gone, written again from its fields.

use contract::manifest::Manifest;
use contract::product::ProductId;
use storage::{Store, manifests};

use super::Workplace;
use crate::commit;
use crate::error::IngestError;

/// Writes the domain of the newest version again where it is damaged or gone; its fields must be whole. The version that
/// names it, a new one if it has another name now; none if nothing had to be done.
pub async fn mend(
    store: &Store,
    product: &ProductId,
    workplace: &Workplace,
) -> Result<Option<Manifest>, IngestError> {
    let newest = manifests::latest(store, product)
        .await
        .map_err(IngestError::storage("read the newest manifest"))?;
    match newest {
        // What was computed is computed again.
        Some(newest) if newest.derived_from.is_none() => {
            commit::mend(store, &workplace.gates, &newest).await
        }
        _ => Ok(None),
    }
}
