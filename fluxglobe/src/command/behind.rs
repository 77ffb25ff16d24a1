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
    let products: Vec<&ProductId> = products.into_iter().collect();
    say(store, &products, |behind| told(behind, &products)).await
}

/// The same of products that a command derived, which can bring along what is made of them.
pub(super) async fn say_what_would_follow(store: &Store, derived: &[&ProductId]) -> Result<()> {
    say(store, derived, would_follow).await
}

/// Says what is still of older versions of products though it was to be brought along.
pub(super) async fn say_what_is_left(store: &Store, derived: &[&ProductId]) -> Result<()> {
    say(store, derived, left).await
}

/// Says a line about what is behind products; none where nothing is.
async fn say(
    store: &Store,
    products: &[&ProductId],
    line: impl FnOnce(&[ProductId]) -> String,
) -> Result<()> {
    if products.is_empty() {
        return Ok(());
    }
    let behind = compute::dependents::behind(store, products).await?;
    if !behind.is_empty() {
        progress::say(&line(&behind));
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

fn names(behind: &[ProductId]) -> String {
    let names: Vec<&str> = behind.iter().map(ProductId::as_str).collect();
    names.join(", ")
}

fn told(behind: &[ProductId], products: &[&ProductId]) -> String {
    let accumulated = |of: &ProductId| of.accumulated().is_ok_and(|it| behind.contains(&it));
    // `derive accumulated` would begin at the first step, wherever its start was chosen.
    let all = behind.iter().chain(products.iter().copied());
    let recomputed = all.filter(|of| accumulated(of)).map(|of| {
        format!("; `fluxglobe recompute --product {of}` makes what of its carbon is stale")
    });
    let recomputed: Vec<String> = recomputed.collect();
    format!(
        "made of an older version: {}; derive them again (with `--follow` what is made of each comes along), or the deriver of a cluster does \
         when something lands in what they are made from{}",
        names(behind),
        recomputed.concat()
    )
}

fn would_follow(behind: &[ProductId]) -> String {
    format!(
        "made of an older version: {}; the same command with `--follow` brings them along, or the deriver of a cluster does when something lands \
         in what they are made from",
        names(behind)
    )
}

fn left(behind: &[ProductId]) -> String {
    format!(
        "not brought along, and still made of an older version: {}; what cannot be made again is told above with the reason, and \
         `fluxglobe products` says what stays as it is: derive these otherwise",
        names(behind)
    )
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
        let line = told(&[id("flux-mean")], &[&flux]);
        assert!(line.starts_with("made of an older version: flux-mean; derive them again"));
        assert!(line.contains("`--follow`"), "{line}");
        assert!(!line.contains("recompute"), "{line}");
        let line = told(&[id("flux-accumulated"), id("flux-mean")], &[&flux]);
        assert!(line.contains("flux-accumulated, flux-mean;"), "{line}");
        assert!(
            line.contains("; `fluxglobe recompute --product flux` makes"),
            "{line}"
        );
    }

    #[test]
    fn what_a_derivation_leaves_behind_is_named_with_what_brings_it_along() {
        let behind: [ProductId; 2] =
            ["twice-accumulated", "twice-mean"].map(|name| name.parse().unwrap());
        let line = would_follow(&behind);
        assert!(
            line.contains(
                "version: twice-accumulated, twice-mean; the same command with `--follow`"
            ),
            "{line}"
        );
        let line = left(&behind[1..]);
        assert!(line.starts_with("not brought along"), "{line}");
        assert!(line.contains("twice-mean; what cannot"), "{line}");
    }
}
