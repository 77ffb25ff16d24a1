//! Numbers of the newest manifests that a process has seen a short while ago: where to look for the next.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use contract::product::ProductId;

/// How long a number is one to go on from: what was published since is there as long as clean-up takes nothing younger than an hour.
/// Later those behind it may be gone, and it may be pinned: the newest is none of those that follow it one by one.
const FRESH: Duration = Duration::from_mins(30);

#[derive(Default)]
pub(crate) struct Newest {
    /// By product, with when it was seen that none follows.
    seen: Mutex<BTreeMap<ProductId, (u64, Instant)>>,
    /// Could the last hint that this process had to write not be written?
    is_untold: AtomicBool,
}

impl Newest {
    pub(crate) fn get(&self, product: &ProductId) -> Option<u64> {
        self.get_within(product, FRESH)
    }

    fn get_within(&self, product: &ProductId, age: Duration) -> Option<u64> {
        let found = self.lock().get(product).copied();
        let fresh = found.filter(|(_, seen)| seen.elapsed() < age);
        fresh.map(|(number, _)| number)
    }

    /// Keeps a number that none follows now, unless a newer one was seen meanwhile.
    pub(crate) fn insert(&self, product: ProductId, number: u64) {
        let mut all = self.lock();
        let now = Instant::now();
        let newest = all.entry(product).or_insert((number, now));
        if number >= newest.0 {
            *newest = (number, now);
        }
    }

    pub(crate) fn remove(&self, product: &ProductId) {
        self.lock().remove(product);
    }

    /// A hint could not be written: is it the first since one could?
    pub(crate) fn is_first_untold(&self) -> bool {
        !self.is_untold.swap(true, Ordering::Relaxed)
    }

    /// A hint was written, or says what it should.
    pub(crate) fn was_told(&self) {
        self.is_untold.store(false, Ordering::Relaxed);
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, BTreeMap<ProductId, (u64, Instant)>> {
        self.seen.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_is_gone_on_from_for_a_while_after_it_was_seen_last() {
        let (newest, product) = (Newest::default(), "p".parse::<ProductId>().unwrap());
        assert_eq!(newest.get(&product), None);
        newest.insert(product.clone(), 12);
        assert_eq!(newest.get(&product), Some(12));
        assert_eq!(newest.get_within(&product, Duration::ZERO), None);
        newest.insert(product.clone(), 11);
        assert_eq!(newest.get(&product), Some(12));
        newest.remove(&product);
        assert_eq!(newest.get(&product), None);
    }

    #[test]
    fn what_cannot_be_told_is_said_once_until_it_goes_well_again() {
        let newest = Newest::default();
        for _outage in 0..2 {
            let said = [(); 3].map(|()| newest.is_first_untold());
            assert_eq!(said, [true, false, false]);
            newest.was_told();
        }
    }
}
