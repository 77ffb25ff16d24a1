//! A file that was offered again and is there: what it came with first is in the manifest, and this says until when nothing older may take its
//! place.
//!
//! It is kept by the process that read it, as long as files that were offered before it are on their way there; the next version of the product
//! keeps it for all.

use contract::digest::Digest;
use contract::manifest::Manifest;
use contract::notice::NoticeOrder;
use contract::product::ProductId;
use contract::time::Period;

use crate::notice::Versioned;

/// The place of a file in the order of notices that nothing of it says in the product.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Claim {
    pub(crate) product: ProductId,
    /// The version that has all of it.
    pub(crate) version: u64,
    raw_sha256: Digest,
    periods: Vec<Period>,
    place: NoticeOrder,
}

impl Claim {
    /// That of the newest notice of a file.
    pub(crate) fn of(there: &Versioned, place: NoticeOrder) -> Self {
        Self {
            product: there.manifest.product.clone(),
            version: there.manifest.number,
            raw_sha256: there.raw_sha256,
            periods: there.periods.clone(),
            place,
        }
    }

    /// Brings it into the places of a version's steps.
    pub(super) fn apply(&self, newest: &Manifest, orders: &mut [Option<NoticeOrder>]) {
        if newest.product != self.product {
            return;
        }
        for period in &self.periods {
            let Some(index) = newest.step_of(*period) else {
                continue;
            };
            if newest.steps[index].raw_sha256 == self.raw_sha256 {
                orders[index] = orders[index].max(Some(self.place));
            }
        }
    }
}
