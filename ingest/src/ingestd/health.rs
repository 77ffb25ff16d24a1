//! What holds the service up now, for whoever asks whether it works.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// What holds the service up; clones share it.
#[derive(Debug, Clone, Default)]
pub(super) struct Health(Arc<Mutex<Troubles>>);

#[derive(Debug, Default)]
struct Troubles {
    next: u64,
    /// Text of each trouble that is not over.
    open: BTreeMap<u64, String>,
}

/// A trouble, over when dropped.
#[derive(Debug)]
pub(super) struct HeldUp {
    health: Health,
    number: u64,
}

impl Health {
    fn troubles(&self) -> MutexGuard<'_, Troubles> {
        // A panic elsewhere leaves a map that is whole.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Notes what holds the service up until the guard is dropped.
    pub(super) fn held_up(&self, by: &dyn Display) -> HeldUp {
        let mut troubles = self.troubles();
        troubles.next += 1;
        let number = troubles.next;
        troubles.open.insert(number, by.to_string());
        HeldUp {
            health: self.clone(),
            number,
        }
    }

    /// Is nothing held up? Else one of the reasons.
    pub(super) fn check(&self) -> Result<(), String> {
        match self.troubles().open.values().next() {
            None => Ok(()),
            Some(trouble) => Err(trouble.clone()),
        }
    }
}

impl Drop for HeldUp {
    fn drop(&mut self) {
        self.health.troubles().open.remove(&self.number);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trouble_lasts_until_it_is_over() {
        let health = Health::default();
        let first = health.held_up(&"disk full");
        let second = health.held_up(&"store away");
        drop(first);
        assert_eq!(health.check(), Err("store away".to_owned()));
        drop(second);
        assert_eq!(health.check(), Ok(()));
    }
}
