//! Products as they are now: the newest manifest of a name.

use contract::manifest::Manifest;
use contract::product::ProductId;
use storage::{Store, manifests};

use crate::ComputeError;

/// The newest manifest of a product.
///
/// # Errors
/// Without one the known products are named.
pub async fn product(store: &Store, id: &ProductId) -> Result<Manifest, ComputeError> {
    match manifests::latest(store, id).await? {
        Some(manifest) => Ok(manifest),
        None => Err(ComputeError::UnknownProduct {
            product: id.to_string(),
            known: manifests::products(store).await?,
        }),
    }
}
