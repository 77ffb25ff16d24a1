//! How much of what is asked for over HTTP is stored: bytes a day in, is anything left out. Nobody who asks fills the store.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

const DAY: Duration = Duration::from_hours(24);

/// Bytes that may be stored. What was used comes back evenly over a day, and never adds up to more than one day's.
#[derive(Debug)]
pub(crate) struct Allowance {
    bytes_per_day: f64,
    state: Mutex<State>,
}

#[derive(Debug)]
struct State {
    /// Less than none where pictures that were begun together were more than what was left.
    left_bytes: f64,
    at: Instant,
}

impl Allowance {
    /// A whole day's is there.
    pub(crate) fn new(bytes_per_day: u64, now: Instant) -> Self {
        let bytes_per_day = bytes_per_day as f64;
        let left_bytes = bytes_per_day;
        Self {
            bytes_per_day,
            state: Mutex::new(State {
                left_bytes,
                at: now,
            }),
        }
    }

    /// May a picture be stored whose size nobody knows yet?
    pub(crate) fn is_left(&self, now: Instant) -> bool {
        self.at(now).left_bytes > 0.0
    }

    /// So much is stored.
    pub(crate) fn used(&self, bytes: usize, now: Instant) {
        self.at(now).left_bytes -= bytes as f64;
    }

    fn at(&self, now: Instant) -> MutexGuard<'_, State> {
        // Two numbers that are written one after the other: a poisoned lock costs a moment's bytes.
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let since = now.saturating_duration_since(state.at);
        let back = self.bytes_per_day * since.div_duration_f64(DAY);
        state.left_bytes = (state.left_bytes + back).min(self.bytes_per_day);
        state.at = state.at.max(now);
        state
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_used_comes_back_within_a_day_and_no_more_than_that() {
        let start = Instant::now();
        let hour = |hours: u64| start + Duration::from_hours(hours);
        let allowance = Allowance::new(2400, start);
        allowance.used(2399, start);
        assert!(allowance.is_left(start), "the last byte");
        allowance.used(501, start);
        assert!(!allowance.is_left(start));
        assert!(!allowance.is_left(hour(5)), "500 too many, 100 an hour");
        assert!(allowance.is_left(hour(6)));
        // However long nobody asks, no more than a day's is there.
        allowance.used(2399, hour(1000));
        assert!(allowance.is_left(hour(1000)));
        allowance.used(1, hour(1000));
        assert!(!allowance.is_left(hour(1000)));
    }

    #[test]
    fn none_is_none_for_ever() {
        let start = Instant::now();
        let allowance = Allowance::new(0, start);
        assert!(!allowance.is_left(start));
        assert!(!allowance.is_left(start + 10 * DAY));
    }
}
