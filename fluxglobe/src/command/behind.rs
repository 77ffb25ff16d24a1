//! What is made of products that have newer versions, and is still of older ones: a line with what makes it anew.

use std::collections::BTreeSet;

use anyhow::Result;
use contract::product::ProductId;
use contract::quantity::Quantity;
use storage::{Store, manifests};

use crate::progress;

/// Says what is made of products and still of older versions of them: the deriver of a cluster reads what ingest services landed, and
/// nothing of commands.
pub(super) async fn say_what_is_behind<'a>(
    store: &Store,
    products: impl IntoIterator<Item = &'a ProductId>,
) -> Result<()> {
    // A file each may have landed in one product.
    let products: BTreeSet<&ProductId> = products.into_iter().collect();
    if products.is_empty() {
        return Ok(());
    }
    let products: Vec<&ProductId> = products.into_iter().collect();
    let behind = compute::dependents::behind(store, &products).await?;
    if let Some(line) = told(&behind, &products) {
        progress::say(&line);
    }
    Ok(())
}

/// Says of fluxes that their carbon is not added up: a deriver does it, and a command when it is told to.
pub(super) async fn say_what_is_not_added_up<'a>(
    store: &Store,
    products: impl IntoIterator<Item = &'a ProductId>,
) -> Result<()> {
    let products: BTreeSet<&ProductId> = products.into_iter().collect();
    for product in products {
        let Some(manifest) = manifests::latest(store, product).await? else {
            continue;
        };
        let Ok(accumulated) = product.accumulated() else {
            continue;
        };
        if manifest.quantity == Quantity::CarbonFlux
            && manifests::latest(store, &accumulated).await?.is_none()
        {
            progress::say(&not_added_up(product));
        }
    }
    Ok(())
}

fn not_added_up(product: &ProductId) -> String {
    format!(
        "{product} is a flux: `fluxglobe derive accumulated --product {product}` adds its carbon up in every cell, which lifts the particles of volumes"
    )
}

/// The line; none where nothing is behind.
fn told(behind: &[ProductId], products: &[&ProductId]) -> Option<String> {
    if behind.is_empty() {
        return None;
    }
    let accumulated = |of: &ProductId| of.accumulated().is_ok_and(|it| behind.contains(&it));
    // `derive accumulated` would begin at the first step, wherever its start was chosen.
    let all = behind.iter().chain(products.iter().copied());
    let recomputed = all.filter(|of| accumulated(of)).map(|of| {
        format!("; `fluxglobe recompute --product {of}` makes what of its carbon is stale")
    });
    let recomputed: Vec<String> = recomputed.collect();
    let names: Vec<&str> = behind.iter().map(ProductId::as_str).collect();
    Some(format!(
        "made of an older version: {}; derive them again, or the deriver of a cluster does when something lands in what they are made from{}",
        names.join(", "),
        recomputed.concat()
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flux_that_is_not_added_up_says_what_does_it() {
        let line = not_added_up(&"flux".parse().unwrap());
        assert!(
            line.contains("`fluxglobe derive accumulated --product flux`"),
            "{line}"
        );
    }

    #[test]
    fn what_is_behind_is_named_and_carbon_keeps_its_start() {
        let id = |name: &str| -> ProductId { name.parse().unwrap() };
        let flux = id("flux");
        assert_eq!(told(&[], &[&flux]), None);
        let line = told(&[id("flux-mean")], &[&flux]).unwrap();
        assert!(line.starts_with("made of an older version: flux-mean; derive them again"));
        assert!(!line.contains("recompute"), "{line}");
        let line = told(&[id("flux-accumulated"), id("flux-mean")], &[&flux]).unwrap();
        assert!(line.contains("flux-accumulated, flux-mean;"), "{line}");
        assert!(
            line.contains("; `fluxglobe recompute --product flux` makes"),
            "{line}"
        );
    }
}
