//! What products were made of, back to those that were landed: a product is never computed of what was made of it.

use std::collections::BTreeSet;

use contract::manifest::Manifest;
use contract::product::ProductId;
use storage::{Store, manifests};

use crate::ComputeError;

/// Refuses to compute a product of inputs that were made of it, directly or through others.
pub(super) async fn check(
    store: &Store,
    target: &ProductId,
    inputs: impl Iterator<Item = &Manifest>,
) -> Result<(), ComputeError> {
    let mut seen = BTreeSet::new();
    let mut open: Vec<Manifest> = inputs.cloned().collect();
    while let Some(manifest) = open.pop() {
        for source in sources(&manifest) {
            if source == target {
                let reason = format!(
                    "{target} cannot be computed from itself, and {} was made of it; give another name",
                    manifest.product
                );
                return Err(ComputeError::Expression { reason });
            }
            if seen.insert(source.clone()) {
                open.extend(manifests::latest(store, source).await?);
            }
        }
    }
    Ok(())
}

fn sources(manifest: &Manifest) -> impl Iterator<Item = &ProductId> {
    let computed = manifest.computed.iter().flat_map(|it| &it.inputs);
    let inputs = computed.map(|input| &input.manifest);
    let all = manifest.derived_from.iter().chain(inputs);
    all.map(|id| &id.product)
}
