//! Who draws next: a bounded number at once, those whom somebody waits for before the batch, each in order of arrival.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::oneshot;

/// Who wants a picture. The order is that of the queue.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Class {
    /// Somebody waits for it.
    OnDemand,
    /// It is drawn ahead.
    Batch,
}

/// Permits and those who wait for one.
pub(super) struct Queue {
    state: Mutex<State>,
    most_waiting: usize,
}

struct State {
    free: usize,
    next_number: u64,
    waiting: BTreeMap<(Class, u64), oneshot::Sender<Permit>>,
}

/// Leave to draw; the next in the queue has it when this is dropped.
pub(super) struct Permit {
    queue: Arc<Queue>,
}

/// As many wait as may.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Full {
    pub(super) waiting: usize,
}

/// A place in the queue, given up when dropped.
struct Place {
    queue: Arc<Queue>,
    key: (Class, u64),
    called: oneshot::Receiver<Permit>,
}

impl Queue {
    /// `at_once` permits; `most_waiting` of [`Class::OnDemand`] wait for one.
    pub(super) fn new(at_once: usize, most_waiting: usize) -> Arc<Self> {
        Arc::new(Self {
            state: Mutex::new(State {
                free: at_once,
                next_number: 0,
                waiting: BTreeMap::new(),
            }),
            most_waiting,
        })
    }

    /// A permit in turn. The batch reader takes no more messages than it may wait for, so only others are counted.
    pub(super) async fn permit(self: &Arc<Self>, class: Class) -> Result<Permit, Full> {
        match self.place(class, class == Class::OnDemand)? {
            Ok(permit) => Ok(permit),
            Err(place) => Ok(place.called().await),
        }
    }

    /// The same for somebody who was let in before.
    pub(super) async fn permit_of_known(self: &Arc<Self>, class: Class) -> Permit {
        match self.place(class, false) {
            Ok(Ok(permit)) => permit,
            Ok(Err(place)) => place.called().await,
            Err(Full { .. }) => unreachable!("nobody is counted, so nobody is one too many"),
        }
    }

    fn place(self: &Arc<Self>, class: Class, counted: bool) -> Result<Result<Permit, Place>, Full> {
        let mut state = self.lock();
        if state.free > 0 {
            state.free -= 1;
            let queue = Arc::clone(self);
            return Ok(Ok(Permit { queue }));
        }
        let waiting = state.count(class);
        if counted && waiting >= self.most_waiting {
            return Err(Full { waiting });
        }
        let (call, called) = oneshot::channel();
        let key = (class, state.next_number);
        state.next_number += 1;
        state.waiting.insert(key, call);
        Ok(Err(Place {
            queue: Arc::clone(self),
            key,
            called,
        }))
    }

    /// How many of a class wait.
    pub(super) fn waiting(&self, class: Class) -> usize {
        self.lock().count(class)
    }

    /// How many of `at_once` permits are given out.
    pub(super) fn in_use(&self, at_once: usize) -> usize {
        at_once.saturating_sub(self.lock().free)
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // Every change is one step, so a poisoned lock still guards a whole queue.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn count(&self, class: Class) -> usize {
        self.waiting.range((class, 0)..=(class, u64::MAX)).count()
    }
}

impl Place {
    async fn called(mut self) -> Permit {
        let called = (&mut self.called).await;
        called.expect("a place is taken out of the queue by a call or by its own end")
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.queue.lock().waiting.remove(&self.key);
    }
}

impl Drop for Permit {
    fn drop(&mut self) {
        let mut state = self.queue.lock();
        let Some((_, call)) = state.waiting.pop_first() else {
            state.free += 1;
            return;
        };
        drop(state);
        let queue = Arc::clone(&self.queue);
        // Whoever gave up in this moment returns the permit, which is dropped here and so calls the next.
        drop(call.send(Permit { queue }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use futures::FutureExt as _;

    #[tokio::test]
    async fn those_who_are_waited_for_go_first_and_each_class_in_order() {
        let queue = Queue::new(1, 8);
        let first = queue.permit(Class::Batch).await.unwrap();
        let order = Arc::new(Mutex::new(vec![]));
        let mut tasks = vec![];
        for (name, class) in [
            ("b1", Class::Batch),
            ("b2", Class::Batch),
            ("d1", Class::OnDemand),
            ("d2", Class::OnDemand),
        ] {
            let (own, order) = (Arc::clone(&queue), Arc::clone(&order));
            tasks.push(tokio::spawn(async move {
                let permit = own.permit(class).await.unwrap();
                order.lock().unwrap().push(name);
                drop(permit);
            }));
            let total = || queue.waiting(Class::Batch) + queue.waiting(Class::OnDemand);
            while total() < tasks.len() {
                tokio::task::yield_now().await;
            }
        }
        drop(first);
        for task in tasks {
            task.await.unwrap();
        }
        assert_eq!(*order.lock().unwrap(), ["d1", "d2", "b1", "b2"]);
        assert_eq!(queue.lock().free, 1);
    }

    #[tokio::test]
    async fn the_queue_is_full_for_those_who_are_counted_only() {
        let queue = Queue::new(1, 1);
        let held = queue.permit(Class::OnDemand).await.unwrap();
        let mut waiting = Box::pin(queue.permit(Class::OnDemand));
        assert!(waiting.as_mut().now_or_never().is_none());
        let refused = queue.permit(Class::OnDemand).await.err();
        assert_eq!(refused, Some(Full { waiting: 1 }));
        let mut batch = Box::pin(queue.permit(Class::Batch));
        assert!(batch.as_mut().now_or_never().is_none());
        assert_eq!(queue.waiting(Class::Batch), 1);
        drop(held);
        assert!(waiting.as_mut().now_or_never().is_some());
    }

    #[tokio::test]
    async fn a_place_that_is_given_up_is_nobodys_turn() {
        let queue = Queue::new(1, 2);
        let held = queue.permit(Class::OnDemand).await.unwrap();
        let mut gone = Box::pin(queue.permit(Class::OnDemand));
        let mut next = Box::pin(queue.permit(Class::OnDemand));
        assert!(gone.as_mut().now_or_never().is_none());
        assert!(next.as_mut().now_or_never().is_none());
        drop(gone);
        assert_eq!(queue.waiting(Class::OnDemand), 1);
        drop(held);
        drop(next.as_mut().now_or_never().unwrap());
        assert_eq!(queue.lock().free, 1);
        // Given up after the call and before it was heard.
        let held = queue.permit(Class::OnDemand).await.unwrap();
        let mut deaf = Box::pin(queue.permit(Class::OnDemand));
        assert!(deaf.as_mut().now_or_never().is_none());
        drop(held);
        drop(deaf);
        assert_eq!(queue.lock().free, 1, "the permit came back");
    }
}
