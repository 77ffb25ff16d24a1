//! Single flight: whoever asks for what is being made already waits for that one answer.
//!
//! Our own, since in `quick_cache::get_or_insert_async` the work is the first caller's: who waits begins anew when he leaves.

use std::collections::HashMap;
use std::future::Future;
use std::sync::{Mutex, PoisonError};

use contract::digest::Digest;
use futures::FutureExt as _;
use futures::future::{BoxFuture, Shared, WeakShared};
use prometheus::IntCounter;

use crate::caught::caught;
use crate::error::ServerError;

type Flight<V> = BoxFuture<'static, Result<V, ServerError>>;

/// Answers under way, by the digest of what was asked.
///
/// Only those who wait keep an answer under way alive: when the last one goes away, it is dropped. A panic of it is an
/// answer too: that there is a defect.
pub(crate) struct SingleFlight<V: Clone + Send + Sync + 'static> {
    under_way: Mutex<HashMap<Digest, WeakShared<Flight<V>>>>,
    /// Where panics are counted.
    panics: IntCounter,
}

/// One who waits; leaving takes an answer nobody waits for off the list.
struct Waiting<'a, V: Clone + Send + Sync + 'static> {
    flights: &'a SingleFlight<V>,
    key: Digest,
    flight: Option<Shared<Flight<V>>>,
}

impl<V: Clone + Send + Sync + 'static> SingleFlight<V> {
    /// Nothing under way yet; `panics` counts those of answers.
    pub(crate) fn new(panics: &IntCounter) -> Self {
        Self {
            under_way: Mutex::default(),
            panics: panics.clone(),
        }
    }

    /// Waits for the answer under way for `key`, or starts it. `start` is called only if there is none.
    pub(crate) async fn join<F>(
        &self,
        key: Digest,
        start: impl FnOnce() -> F,
    ) -> Result<V, ServerError>
    where
        F: Future<Output = Result<V, ServerError>> + Send + 'static,
    {
        let flight = {
            let mut under_way = self
                .under_way
                .lock()
                .unwrap_or_else(PoisonError::into_inner);
            if let Some(flight) = under_way.get(&key).and_then(WeakShared::upgrade) {
                flight
            } else {
                let (panics, work) = (self.panics.clone(), start());
                let flight = async move { caught(&panics, work).await }.boxed().shared();
                if let Some(weak) = flight.downgrade() {
                    under_way.insert(key, weak);
                }
                flight
            }
        };
        let waiting = Waiting {
            flights: self,
            key,
            flight: Some(flight.clone()),
        };
        let answer = flight.await;
        drop(waiting);
        answer
    }

    #[cfg(test)]
    fn len(&self) -> usize {
        self.under_way.lock().unwrap().len()
    }
}

impl<V: Clone + Send + Sync + 'static> Drop for Waiting<'_, V> {
    fn drop(&mut self) {
        drop(self.flight.take());
        let mut under_way = self
            .flights
            .under_way
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        if under_way
            .get(&self.key)
            .is_some_and(|weak| weak.upgrade().is_none())
        {
            under_way.remove(&self.key);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicU32, Ordering};
    use std::time::Duration;
    use tokio::sync::Notify;

    fn key() -> Digest {
        Digest::of(b"k")
    }

    fn flights() -> SingleFlight<u32> {
        SingleFlight::new(&IntCounter::new("panics", "For a test.").unwrap())
    }

    async fn panicking() -> Result<u32, ServerError> {
        tokio::task::yield_now().await;
        panic!("a planted panic")
    }

    #[tokio::test]
    async fn many_who_ask_at_once_get_one_answer() {
        let flights = flights();
        let (starts, go) = (AtomicU32::new(0), Arc::new(Notify::new()));
        let ask = || {
            flights.join(key(), || {
                starts.fetch_add(1, Ordering::SeqCst);
                let go = Arc::clone(&go);
                async move {
                    go.notified().await;
                    Ok(7)
                }
            })
        };
        let mut first = Box::pin(ask());
        let mut others: Vec<_> = (0..5).map(|_| Box::pin(ask())).collect();
        assert!(first.as_mut().now_or_never().is_none());
        assert!(
            others
                .iter_mut()
                .all(|other| other.as_mut().now_or_never().is_none())
        );
        drop(first); // the one who started goes away: the others still get it
        go.notify_one();
        for answer in futures::future::join_all(others).await {
            assert_eq!(answer.unwrap(), 7);
        }
        assert_eq!(starts.load(Ordering::SeqCst), 1);
        assert_eq!(flights.len(), 0);
    }

    #[tokio::test]
    async fn what_nobody_waits_for_is_dropped_and_started_anew() {
        let flights = flights();
        let mut lost = Box::pin(flights.join(key(), std::future::pending));
        assert!(lost.as_mut().now_or_never().is_none());
        drop(lost);
        assert_eq!(flights.len(), 0);
        assert_eq!(flights.join(key(), || async { Ok(1) }).await.unwrap(), 1);
        assert_eq!(flights.join(key(), || async { Ok(2) }).await.unwrap(), 2);
    }

    #[tokio::test]
    async fn a_panic_is_told_to_all_who_wait_and_what_is_asked_next_is_started_anew() {
        let flights = flights();
        let both = futures::future::join(
            flights.join(key(), panicking),
            flights.join(key(), panicking),
        );
        let told = tokio::time::timeout(Duration::from_secs(20), both).await;
        let (first, second) = told.expect("both are told");
        for answer in [first, second] {
            let error = answer.unwrap_err();
            assert!(error.to_string().contains("a planted panic"), "{error}");
        }
        assert_eq!((flights.panics.get(), flights.len()), (1, 0));
        assert_eq!(flights.join(key(), || async { Ok(1) }).await.unwrap(), 1);
    }
}
