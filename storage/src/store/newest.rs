//! Numbers of the newest manifests that a process has seen a short while ago: where to look for the next.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use contract::product::ProductId;

/// How long a number is one to go on from: what was published since is there as long as clean-up takes nothing younger than an hour.
/// Later those behind it may be gone, and it may be pinned: the newest is none of those that follow it one by one.
const FRESH: Duration = Duration::from_mins(30);

/// By product, with when it was seen that none follows.
#[derive(Default)]
pub(crate) struct Newest(Mutex<BTreeMap<ProductId, (u64, Instant)>>);

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

    fn lock(&self) -> std::sync::MutexGuard<'_, BTreeMap<ProductId, (u64, Instant)>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
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
}
