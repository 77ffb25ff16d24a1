//! Products that have newer versions in; what is made of them, directly or through others, and still of older ones out.

use std::collections::{BTreeMap, BTreeSet};

use contract::manifest::{Manifest, ManifestId};
use contract::product::ProductId;
use futures::future::BoxFuture;
use storage::{Store, manifests};

use crate::ComputeError;
use crate::made_from::inputs;

/// What is made of an older version of some products than their newest ones, or of others that are, by name. None that was made to stay as
/// it is. One that cannot be read is told of and passed by.
///
/// # Errors
/// What listing products meets.
pub fn behind<'a>(
    store: &'a Store,
    products: &'a [&'a ProductId],
) -> BoxFuture<'a, Result<Vec<ProductId>, ComputeError>> {
    Box::pin(async move {
        let mut newest = BTreeMap::new();
        for product in manifests::products(store).await? {
            match manifests::latest(store, &product).await {
                Ok(Some(latest)) => _ = newest.insert(product, Made::of(&latest)),
                Ok(None) => {}
                Err(error) => {
                    tracing::warn!(%product, %error, "it is not known what it is made of");
                }
            }
        }
        Ok(among(&newest, products))
    })
}

/// What the newest version of a product says.
struct Made {
    number: u64,
    from: Vec<ManifestId>,
}

impl Made {
    fn of(manifest: &Manifest) -> Self {
        let map = manifest.computed.as_ref().and_then(|it| it.map.as_ref());
        let stays = map.is_some_and(|map| map.once);
        let from = inputs(manifest).into_iter().filter(|_| !stays);
        Self {
            number: manifest.number,
            from: from.cloned().collect(),
        }
    }
}

fn among(newest: &BTreeMap<ProductId, Made>, products: &[&ProductId]) -> Vec<ProductId> {
    let mut behind: BTreeSet<&ProductId> = BTreeSet::new();
    loop {
        let is_old = |from: &ManifestId| {
            let is_older = |made: &Made| from.number < made.number;
            let is_asked = products.contains(&&from.product);
            behind.contains(&from.product)
                || is_asked && newest.get(&from.product).is_some_and(is_older)
        };
        let more = newest.iter().filter(|(target, made)| {
            !products.contains(target) && !behind.contains(target) && made.from.iter().any(is_old)
        });
        let more: Vec<&ProductId> = more.map(|(target, _)| target).collect();
        if more.is_empty() {
            return behind.into_iter().cloned().collect();
        }
        behind.extend(more);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_of_an_older_version_is_behind_and_all_that_is_of_that() {
        let made = |number: u64, from: &[&str]| Made {
            number,
            from: from.iter().map(|id| id.parse().unwrap()).collect(),
        };
        let newest = [
            ("source", made(3, &[])),
            ("twice", made(2, &["source@3-00000000"])),
            ("of-newest", made(5, &["twice@2-00000000"])),
            (
                "of-older",
                made(1, &["other@4-00000000", "twice@1-00000000"]),
            ),
            ("of-that", made(7, &["of-older@1-00000000"])),
            ("other", made(4, &["source@1-00000000"])),
            (
                "round",
                made(1, &["of-that@6-00000000", "round@1-00000000"]),
            ),
        ];
        let newest = newest.map(|(name, made)| (name.parse().unwrap(), made));
        let newest: BTreeMap<ProductId, Made> = newest.into_iter().collect();
        for (products, expected) in [
            ("twice", "of-older of-that round"),
            ("source", "of-older of-that other round"),
            ("of-newest nobody", ""),
            ("of-newest other", ""),
            ("twice other", "of-older of-that round"),
        ] {
            let asked = products.split(' ').map(|name| name.parse().unwrap());
            let asked: Vec<ProductId> = asked.collect();
            let behind = among(&newest, &asked.iter().collect::<Vec<_>>());
            let behind: Vec<&str> = behind.iter().map(ProductId::as_str).collect();
            assert_eq!(behind.join(" "), expected, "{products}");
        }
    }
}
