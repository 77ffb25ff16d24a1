//! A store that takes nothing for a while: told when the first begins to wait for it and when the last ends, with their number,
//! however many wait.

use std::sync::{Mutex, MutexGuard, PoisonError};

/// Those that wait now and, since there was nobody, have waited.
#[derive(Debug)]
pub(super) struct Outage {
    /// What they are, for people.
    what: &'static str,
    counts: Mutex<Counts>,
}

#[derive(Debug, Default)]
struct Counts {
    /// That wait now.
    waiting: u64,
    /// That have waited.
    all: u64,
    /// That got what they waited for.
    went_well: u64,
}

/// One that waits, until it is dropped.
#[derive(Debug)]
pub(super) struct Waiting<'a> {
    outage: &'a Outage,
    /// Is it the first, which tells why?
    pub(super) is_first: bool,
    went_well: bool,
}

impl Outage {
    pub(super) fn of(what: &'static str) -> Self {
        Self {
            what,
            counts: Mutex::default(),
        }
    }

    /// One more waits.
    pub(super) fn wait(&self) -> Waiting<'_> {
        let mut counts = self.counts();
        counts.waiting += 1;
        counts.all += 1;
        Waiting {
            outage: self,
            is_first: counts.all == 1,
            went_well: false,
        }
    }

    fn counts(&self) -> MutexGuard<'_, Counts> {
        self.counts.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Waiting<'_> {
    /// It got what it waited for.
    pub(super) fn went_well(mut self) {
        self.went_well = true;
    }
}

impl Drop for Waiting<'_> {
    fn drop(&mut self) {
        let ended = {
            let mut counts = self.outage.counts();
            counts.waiting -= 1;
            counts.went_well += u64::from(self.went_well);
            (counts.waiting == 0).then(|| std::mem::take(&mut *counts))
        };
        // Of one alone its caller hears.
        if let Some(Counts { all, went_well, .. }) = ended.filter(|counts| counts.all > 1) {
            let what = self.outage.what;
            tracing::warn!("{all} {what} waited for the store: {went_well} of them went well then");
        }
    }
}
