//! A file that is offered: what of a version is its own has its place in the order of notices, also where it came with an earlier notice of it, so
//! that nothing older takes its place.
//!
//! Claims of files that are there are kept by the process that read them, as long as files that were offered before are on their way; the next version
//! of the product keeps them for all.

use std::collections::BTreeSet;

use contract::digest::Digest;
use contract::key::ObjectKey;
use contract::manifest::{Manifest, Step};
use contract::notice::NoticeOrder;
use contract::product::ProductId;
use contract::time::Period;

use crate::notice::Versioned;
use crate::put::StoredGranule;

/// The place of a file in the order of notices that nothing of it says in the product.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Claim {
    pub(crate) product: ProductId,
    /// The version that it was compared with.
    pub(crate) version: u64,
    raw_sha256: Digest,
    /// What it has a value for; with the field, if it was read anew.
    steps: Vec<(Period, Option<ObjectKey>)>,
    pub(crate) place: NoticeOrder,
}

/// Was the file that is there offered with or after a new one? Not known of steps that were landed before orders were
/// kept: then the new one is taken to be newer.
pub(crate) fn is_later_or_same(there: Option<NoticeOrder>, new: NoticeOrder) -> bool {
    there.is_some_and(|there| new <= there)
}

/// Whose claim it is: product, content, and the first step, for one content may be read as different steps by its name.
pub(crate) type ClaimName = (ProductId, Digest, Option<Period>);

impl Claim {
    /// Tells it from those of other files.
    pub(crate) fn name(&self) -> ClaimName {
        let first = self.steps.first().map(|(period, _)| *period);
        (self.product.clone(), self.raw_sha256, first)
    }

    /// That of a file that changes nothing in a version.
    pub(crate) fn of(there: &Versioned, place: NoticeOrder) -> Self {
        Self {
            product: there.manifest.product.clone(),
            version: there.manifest.number,
            raw_sha256: there.raw_sha256,
            steps: there.periods.iter().map(|period| (*period, None)).collect(),
            place,
        }
    }

    /// That of a file that is about to be published.
    pub(crate) fn of_granule(granule: &StoredGranule) -> Self {
        let step = |step: &Step| (step.period, Some(step.field.clone()));
        Self {
            product: granule.product.clone(),
            version: 0,
            raw_sha256: granule.reading.raw_sha256(),
            steps: granule.reading.steps.iter().map(step).collect(),
            place: granule.notice.place,
        }
    }

    /// Steps of a version that are its own.
    fn own<'a>(&'a self, newest: &'a Manifest) -> impl Iterator<Item = usize> + 'a {
        let own = |(period, field): &(Period, Option<ObjectKey>)| {
            let index = newest.step_of(*period)?;
            let step = &newest.steps[index];
            let is_own = step.raw_sha256 == self.raw_sha256
                && field.as_ref().is_none_or(|field| *field == step.field);
            is_own.then_some(index)
        };
        self.steps.iter().filter_map(own)
    }

    /// Is any step of a version its own?
    pub(super) fn has_any(&self, newest: &Manifest) -> bool {
        self.own(newest).next().is_some()
    }

    /// Brings it into the places of a version's steps.
    pub(super) fn apply(&self, newest: &Manifest, orders: &mut [Option<NoticeOrder>]) {
        if newest.product == self.product {
            for index in self.own(newest) {
                orders[index] = orders[index].max(Some(self.place));
            }
        }
    }

    /// Does the file change nothing in a newer version either?
    pub(crate) fn holds(&self, newest: &Manifest) -> bool {
        let orders = newest.notice_orders();
        let own: BTreeSet<usize> = self.own(newest).collect();
        self.steps.iter().all(|(period, _)| {
            newest.step_of(*period).is_some_and(|index| {
                own.contains(&index) || is_later_or_same(orders[index], self.place)
            })
        })
    }
}
