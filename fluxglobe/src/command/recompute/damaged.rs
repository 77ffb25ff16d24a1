//! A product in, what is damaged of it and made again by `--verify` out; nothing is changed.

use std::collections::BTreeSet;

use anyhow::Result;
use contract::key::ObjectKey;
use contract::manifest::{Manifest, Step};
use contract::product::ProductId;
use cube::verify::Mending;
use serde::Serialize;
use storage::{Store, manifests, verify};

use crate::cli::Recompute;

/// What would be made again of a product.
#[derive(Debug, Serialize)]
pub(super) struct Damaged {
    product: ProductId,
    /// What is damaged or gone of its newest version's own: domain, fields, counts of what contributed to them.
    objects: BTreeSet<ObjectKey>,
    /// What becomes of its cube.
    cube: Mending,
}

impl Damaged {
    /// Of the product, and of its accumulated carbon; those of which nothing is damaged are left out.
    ///
    /// # Errors
    /// What is damaged cannot be made again by this command, with what to do.
    pub(super) async fn all(store: &Store, options: &Recompute) -> Result<Vec<Self>> {
        let mut all = vec![];
        for product in [
            Some(options.product.clone()),
            options.product.accumulated().ok(),
        ] {
            let Some(product) = product else { continue };
            let Some(newest) = manifests::latest(store, &product).await? else {
                continue;
            };
            let is_computed = product == options.product && newest.derived_from.is_some();
            let objects = if is_computed {
                compute::dependents::to_mend(store, &product).await?
            } else {
                let broken = verify::broken(store, &newest).await?;
                asked(broken, &newest, options)
            };
            let cube = cube::verify::mending(store, &product).await?;
            if !objects.is_empty() || cube != Mending::Nothing {
                all.push(Self {
                    product,
                    objects,
                    cube,
                });
            }
        }
        Ok(all)
    }

    /// A line each.
    pub(super) fn lines(&self) -> Vec<String> {
        let object = |key| format!("{key} is damaged or gone, and would be made again");
        let mut lines: Vec<String> = self.objects.iter().map(object).collect();
        let product = &self.product;
        lines.extend(match self.cube {
            Mending::Nothing => None,
            Mending::BroughtUp => Some(format!(
                "the cube of {product} would be brought to its newest version"
            )),
            Mending::MadeAgain => Some(format!(
                "the cube of {product} is damaged, and would be made again"
            )),
        });
        lines
    }
}

/// Of these what is made again in the period that is asked for: its domain, and what its steps have.
fn asked(
    mut broken: BTreeSet<ObjectKey>,
    newest: &Manifest,
    options: &Recompute,
) -> BTreeSet<ObjectKey> {
    let is_outside = |step: &&Step| {
        options.from.is_some_and(|from| step.period.end <= from)
            || options.to.is_some_and(|to| step.period.start >= to)
    };
    for step in newest.steps.iter().filter(is_outside) {
        broken.remove(&step.field);
        if let Some(contributed) = &step.contributed {
            broken.remove(&contributed.counts);
        }
    }
    broken
}
