//! Numbers for the readers of one process, used again once free, so that their transactions keep their names.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Numbers taken, by group.
#[derive(Debug, Clone, Default)]
pub(crate) struct Slots {
    taken: Arc<Mutex<BTreeSet<(String, u32)>>>,
}

/// A number; free again when dropped.
#[derive(Debug)]
pub(crate) struct Slot {
    slots: Slots,
    group: String,
    number: u32,
}

impl Slots {
    fn taken(&self) -> MutexGuard<'_, BTreeSet<(String, u32)>> {
        // One insertion or removal at a time: a panic elsewhere cannot leave it half done.
        self.taken.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes the lowest number that is free in a group.
    pub(crate) fn take(&self, group: &str) -> Slot {
        let mut taken = self.taken();
        let number = (0..u32::MAX)
            .find(|&number| !taken.contains(&(group.to_owned(), number)))
            .expect("fewer readers than numbers");
        taken.insert((group.to_owned(), number));
        Slot {
            slots: self.clone(),
            group: group.to_owned(),
            number,
        }
    }
}

impl Slot {
    pub(crate) fn number(&self) -> u32 {
        self.number
    }
}

impl Drop for Slot {
    fn drop(&mut self) {
        let group = std::mem::take(&mut self.group);
        self.slots.taken().remove(&(group, self.number));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_is_used_again_once_its_reader_is_gone() {
        let slots = Slots::default();
        let first = slots.take("g");
        let second = slots.take("g");
        assert_eq!(
            (
                first.number(),
                second.number(),
                slots.take("other").number()
            ),
            (0, 1, 0)
        );
        drop(first);
        assert_eq!(slots.take("g").number(), 0);
        assert_eq!(second.number(), 1);
    }
}
