//! Equal jobs are one: the first caller begins it, the others wait with him, and it ends when all have gone.
//!
//! Our own, since in `quick_cache::get_or_insert_async` the work is the first caller's: who waits begins anew when he leaves. And
//! whoever waits for a batch job makes it urgent.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use contract::digest::Digest;
use contract::encoding::Encoding;
use render::RenderError;
use render::plan::Part;
use tokio::sync::watch;

use super::{DeskError, Drawn};
use crate::desk::queue::Class;
use crate::error::DrawError;
use crate::pipeline::IsWanted;

/// How a job ended.
pub(super) type Outcome = Result<Drawn, DeskError>;

/// A job under way. Nobody waits for it any more when its outcome has no receiver.
pub(super) struct Flight {
    outcome: watch::Sender<Option<Outcome>>,
    /// Does somebody wait for it, though it may have begun as a batch job?
    urgent: watch::Sender<bool>,
}

/// A job by its digest, the bytes that are made of its picture, and of which part of it.
pub(super) type Flown = (Digest, Encoding, Option<Part>);

/// All jobs under way.
#[derive(Default)]
pub(super) struct SingleFlight {
    by_job: Mutex<BTreeMap<Flown, Arc<Flight>>>,
}

/// One who waits for a job under way; dropping it is giving up.
pub(super) struct Waiter {
    outcome: watch::Receiver<Option<Outcome>>,
}

impl SingleFlight {
    /// Waits for a job under way, or begins it, which the caller must then draw and [`complete`](Self::complete).
    pub(super) fn join(&self, job: Flown, class: Class) -> (Waiter, Option<Arc<Flight>>) {
        let urgent = class == Class::OnDemand;
        let mut under_way = self.lock();
        let known = under_way.get(&job);
        // A flight that all have left ends at its next step: too late to join.
        if let Some(flight) = known.filter(|flight| flight.outcome.receiver_count() > 0) {
            if urgent {
                flight.urgent.send_replace(true);
            }
            return (flight.waiter(), None);
        }
        let flight = Arc::new(Flight {
            outcome: watch::Sender::new(None),
            urgent: watch::Sender::new(urgent),
        });
        under_way.insert(job, Arc::clone(&flight));
        (flight.waiter(), Some(flight))
    }

    /// Ends a job with its outcome.
    pub(super) fn complete(&self, job: &Flown, flight: &Arc<Flight>, outcome: Outcome) {
        let mut under_way = self.lock();
        if under_way
            .get(job)
            .is_some_and(|known| Arc::ptr_eq(known, flight))
        {
            under_way.remove(job);
        }
        drop(under_way);
        flight.outcome.send_replace(Some(outcome));
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<Flown, Arc<Flight>>> {
        // Changed by single inserts and removals, so a poisoned lock still guards a whole map.
        self.by_job.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Flight {
    fn waiter(&self) -> Waiter {
        Waiter {
            outcome: self.outcome.subscribe(),
        }
    }

    /// Work that is given up when nobody waits any more.
    pub(super) async fn while_wanted<T>(
        &self,
        work: impl Future<Output = Result<T, DrawError>>,
    ) -> Result<T, DrawError> {
        tokio::select! {
            done = work => done,
            () = self.outcome.closed() => Err(RenderError::NotWanted.into()),
        }
    }

    /// Returns once somebody waits for a picture of the batch.
    pub(super) async fn turns_urgent(&self) {
        let mut urgent = self.urgent.subscribe();
        // The sender lives as long as this flight, so waiting ends with the word only.
        drop(urgent.wait_for(|urgent| *urgent).await);
    }

    /// Asked by the drawing thread.
    pub(super) fn is_wanted(self: &Arc<Self>) -> IsWanted {
        let flight = Arc::clone(self);
        Arc::new(move || flight.outcome.receiver_count() > 0)
    }
}

impl Waiter {
    /// The outcome, shared by all.
    pub(super) async fn outcome(mut self) -> Outcome {
        let ended = self.outcome.wait_for(Option::is_some).await;
        // A sender without an outcome is gone only if its process is ending.
        ended.map_or(Err(DeskError::Stopping), |outcome| {
            outcome.clone().unwrap_or(Err(DeskError::Stopping))
        })
    }
}
