//! A gate before expensive work: a few pass at once, some wait, the rest are sent away at once.

use std::sync::Arc;

use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use crate::backend::Turn;
use crate::error::ServerError;

/// Bounds how much work runs and how much waits.
#[derive(Debug, Clone)]
pub struct Gate {
    /// A place for everything that runs or waits.
    places: Arc<Semaphore>,
    /// A turn for everything that runs.
    turns: Arc<Semaphore>,
}

/// The right to run. Whoever has more to do when what is scarce is free again lets go of the turn before the place.
#[derive(Debug)]
pub struct Pass {
    /// Counts among those who run or wait.
    pub place: Place,
    /// The next one waiting gets it when this is dropped.
    pub turn: Turn,
}

/// One of those who run or wait.
#[derive(Debug)]
pub struct Place(#[expect(dead_code, reason = "held, not read")] OwnedSemaphorePermit);

impl Gate {
    /// A gate that `at_once` pass and at which `queue` may wait.
    pub fn new(at_once: u32, queue: u32) -> Self {
        let (at_once, queue) = (at_once as usize, queue as usize);
        Self {
            places: Arc::new(Semaphore::new(at_once + queue)),
            turns: Arc::new(Semaphore::new(at_once)),
        }
    }

    /// Waits for a turn; `Busy` if as many wait as may. Who stops waiting gives the place back.
    pub async fn enter(&self) -> Result<Pass, ServerError> {
        let place = Arc::clone(&self.places)
            .try_acquire_owned()
            .map_err(|_full| ServerError::Busy)?;
        let turn = Arc::clone(&self.turns)
            .acquire_owned()
            .await
            .map_err(|_closed| ServerError::Busy)?;
        Ok(Pass {
            place: Place(place),
            turn: Turn::new(turn),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use futures::FutureExt as _;

    #[tokio::test]
    async fn one_runs_one_waits_and_the_third_is_sent_away() {
        let gate = Gate::new(1, 1);
        let first = gate.enter().await.unwrap();
        let mut second = Box::pin(gate.enter());
        assert!(second.as_mut().now_or_never().is_none());
        assert!(matches!(gate.enter().await, Err(ServerError::Busy)));
        drop(first);
        assert!(second.await.is_ok());
    }

    #[tokio::test]
    async fn who_lets_go_of_his_turn_alone_is_followed_and_keeps_his_place() {
        let gate = Gate::new(1, 1);
        let Pass { place, turn } = gate.enter().await.unwrap();
        let mut second = Box::pin(gate.enter());
        assert!(second.as_mut().now_or_never().is_none());
        drop(turn);
        let second = second.await.unwrap();
        assert!(matches!(gate.enter().await, Err(ServerError::Busy)));
        drop(place);
        assert!(gate.enter().now_or_never().is_none(), "the third waits");
        drop(second);
        assert!(gate.enter().await.is_ok());
    }

    #[tokio::test]
    async fn who_stops_waiting_gives_the_place_back() {
        let gate = Gate::new(1, 1);
        let _first = gate.enter().await.unwrap();
        let mut second = Box::pin(gate.enter());
        assert!(second.as_mut().now_or_never().is_none());
        drop(second);
        let mut third = Box::pin(gate.enter());
        assert!(
            third.as_mut().now_or_never().is_none(),
            "the third waits in the place of the second"
        );
    }
}
