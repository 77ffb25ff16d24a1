//! Room of so many bytes, given out in whole units: a wish is granted as soon as it can be, whatever limit and wish are.

use std::sync::Arc;

use tokio::sync::{OwnedSemaphorePermit, Semaphore};

/// Room is counted in units of this, so that it fits the semaphore's counter.
pub(crate) const UNIT_BYTES: u64 = 64 << 10;

/// Room of so many bytes.
#[derive(Debug)]
pub(crate) struct Room {
    free: Arc<Semaphore>,
    units: u32,
}

/// A part of a room, given back when dropped.
#[derive(Debug)]
pub(crate) struct Taken(OwnedSemaphorePermit);

impl Room {
    /// Room of `bytes`; a part of a unit at its end is not given out, but there is always one unit.
    pub(crate) fn new(bytes: u64) -> Self {
        let units = u32::try_from(bytes / UNIT_BYTES).unwrap_or(u32::MAX).max(1);
        Self {
            free: Arc::new(Semaphore::new(units as usize)),
            units,
        }
    }

    /// Waits for `bytes` of it. Whoever wants more than there is, be it by a part of a unit, has all of it alone: a wish
    /// that can never be granted would wait for ever, and hold up whoever comes after it.
    ///
    /// Nobody who holds a part may wait for another one: two who did could wait for each other.
    pub(crate) async fn take(&self, bytes: u64) -> Taken {
        let units = units(bytes).min(self.units);
        let taken = Arc::clone(&self.free).acquire_many_owned(units).await;
        Taken(taken.expect("the semaphore is never closed"))
    }
}

impl Taken {
    /// Gives back what is more than `bytes`.
    pub(crate) fn shrink_to(&mut self, bytes: u64) {
        let surplus = self.0.num_permits().saturating_sub(units(bytes) as usize);
        drop(self.0.split(surplus));
    }
}

/// Units that hold `bytes`.
fn units(bytes: u64) -> u32 {
    u32::try_from(bytes.div_ceil(UNIT_BYTES)).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use futures::FutureExt as _;
    use proptest::prelude::*;

    /// Limits and wishes about the edges of units, and any others.
    fn bytes() -> impl Strategy<Value = u64> {
        let edge =
            (0u64..40, 0u64..3).prop_map(|(n, off)| (n * UNIT_BYTES + off).saturating_sub(1));
        prop_oneof![edge, any::<u64>()]
    }

    proptest! {
        #[test]
        fn any_wish_is_granted_where_nobody_else_has_room(limit in bytes(), wish in bytes()) {
            let room = Room::new(limit);
            let taken = room.take(wish).now_or_never();
            prop_assert!(taken.is_some(), "{wish} of {limit} bytes waits for ever");
        }

        #[test]
        fn no_more_is_given_out_than_there_is(limit in UNIT_BYTES..50 * UNIT_BYTES, wish in 1..20 * UNIT_BYTES) {
            let room = Room::new(limit);
            let mut taken = vec![];
            while let Some(part) = room.take(wish).now_or_never() {
                taken.push(part);
            }
            let held = taken.len() as u64 * wish;
            prop_assert!(held <= limit || taken.len() == 1, "{held} of {limit} bytes are given out");
        }
    }

    #[test]
    fn what_is_given_back_can_be_taken() {
        let room = Room::new(2 * UNIT_BYTES + 1);
        let mut all = room.take(2 * UNIT_BYTES + 1).now_or_never().unwrap();
        assert!(room.take(1).now_or_never().is_none());
        all.shrink_to(UNIT_BYTES);
        assert!(room.take(UNIT_BYTES).now_or_never().is_some());
        drop(all);
        assert!(room.take(u64::MAX).now_or_never().is_some());
    }
}
