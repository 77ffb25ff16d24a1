//! Products that were computed from a product, and how to compute them again: as their newest manifest says.

use contract::manifest::Manifest;
use contract::product::ProductId;
use storage::{Store, manifests};

use super::request::{Request, RequestedInput};
use crate::ComputeError;

/// What would bring every product up to date whose newest version was computed from one, in the order of their names.
pub(super) async fn of(store: &Store, product: &ProductId) -> Result<Vec<Request>, ComputeError> {
    let mut found = vec![];
    for target in manifests::products(store).await? {
        let latest = manifests::latest(store, &target).await?;
        let request = latest.and_then(again);
        let reads = |request: &Request| request.inputs.iter().any(|it| it.product == *product);
        found.extend(request.filter(reads));
    }
    Ok(found)
}

/// The request that a computed product was made by.
fn again(manifest: Manifest) -> Option<Request> {
    // What is of all steps together waits until it is asked for.
    let computed = manifest.computed.filter(|it| it.how.is_by_step())?;
    let input = |input: &contract::computed::ComputedInput| RequestedInput {
        name: input.name.clone(),
        product: input.manifest.product.clone(),
        matching: input.matching,
    };
    Some(Request {
        target: manifest.product,
        title: Some(manifest.title),
        quantity: Some(manifest.quantity),
        how: computed.how,
        grid: Some(manifest.grid),
        inputs: computed.inputs.iter().map(input).collect(),
        from: computed.from,
        to: computed.to,
    })
}
