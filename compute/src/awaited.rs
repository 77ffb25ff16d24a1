//! Work on a thread for what blocks, by its name, in; what comes of it out. Who asks for the same meanwhile waits for it too, and when the last who
//! waits has left it ends early.
//!
//! What blocks cannot be ended from outside: its loops ask, each time before they go on ([`Awaited::check`]).

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError, Weak};

use tokio::task::{JoinHandle, spawn_blocking};

use crate::ComputeError;

/// Does anybody wait for a piece of work? Asked by the work itself.
#[derive(Debug, Clone)]
pub(crate) struct Awaited(Option<Weak<()>>);

impl Awaited {
    /// Of work that is done to its end, whoever waits.
    pub(crate) fn always() -> Self {
        Self(None)
    }

    /// Of work that all have left.
    #[cfg(test)]
    pub(crate) fn never() -> Self {
        Self(Some(Weak::new()))
    }

    /// # Errors
    /// `NotAwaited` once nobody would have what comes of it.
    pub(crate) fn check(&self) -> Result<(), ComputeError> {
        match &self.0 {
            Some(waiters) if waiters.strong_count() == 0 => Err(ComputeError::NotAwaited),
            _ => Ok(()),
        }
    }
}

/// Pieces of work under way, by their names.
#[derive(Debug)]
pub(crate) struct SharedWork<T> {
    under_way: Mutex<BTreeMap<String, Weak<Work<T>>>>,
}

/// A piece of work, held by those who wait for it and by nobody else.
#[derive(Debug)]
pub(crate) struct Work<T> {
    /// Locked by the one who is told of its end. If that one leaves before, it is another's turn.
    running: tokio::sync::Mutex<Option<JoinHandle<Result<T, ComputeError>>>>,
    /// Goes with the last who waits, which tells the work to end.
    waiters: Arc<()>,
}

impl<T> Default for SharedWork<T> {
    fn default() -> Self {
        Self {
            under_way: Mutex::default(),
        }
    }
}

impl<T: Send + 'static> SharedWork<T> {
    /// One who waits for the work of a name, whether it is under way or not yet begun; dropping it is leaving.
    pub(crate) fn join(&self, name: &str) -> Arc<Work<T>> {
        // Changed by single inserts and removals, so a poisoned lock still guards a whole map.
        let mut under_way = self
            .under_way
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        under_way.retain(|_name, work| work.strong_count() > 0);
        if let Some(work) = under_way.get(name).and_then(Weak::upgrade) {
            return work;
        }
        let work = Arc::new(Work {
            running: tokio::sync::Mutex::default(),
            waiters: Arc::default(),
        });
        under_way.insert(name.to_owned(), Arc::downgrade(&work));
        work
    }
}

impl<T: Send + 'static> Work<T> {
    /// What comes of the work under way, else of this, which is begun. One of those who wait is told; the others look where that one keeps it first.
    ///
    /// # Errors
    /// Its own; `Inconsistent` if it panics.
    pub(crate) async fn done(
        &self,
        work: impl FnOnce(&Awaited) -> Result<T, ComputeError> + Send + 'static,
    ) -> Result<T, ComputeError> {
        let mut running = self.running.lock().await;
        let handle = running.get_or_insert_with(|| {
            let awaited = Awaited(Some(Arc::downgrade(&self.waiters)));
            spawn_blocking(move || {
                // Who waited may have left before there was a thread for it.
                awaited.check()?;
                work(&awaited)
            })
        });
        let ended = handle.await;
        *running = None;
        ended.map_err(|e| ComputeError::inconsistent("region", e))?
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::sync_channel;
    use std::time::Duration;

    use tokio::sync::oneshot;
    use tokio::time::timeout;

    use super::*;

    /// Time after which a test that waits has failed.
    const LIMIT: Duration = Duration::from_secs(30);

    #[tokio::test]
    async fn work_ends_when_the_last_who_waits_has_left() {
        let shared = SharedWork::<u32>::default();
        let (first, second) = (shared.join("a"), shared.join("a"));
        let (begin, begun) = oneshot::channel();
        let (tell, told) = oneshot::channel();
        let mut waiting = Box::pin(first.done(move |awaited| {
            begin.send(()).unwrap();
            let ended = loop {
                if let Err(ended) = awaited.check() {
                    break ended;
                }
                std::thread::yield_now();
            };
            tell.send(ended.to_string()).unwrap();
            Err(ended)
        }));
        tokio::select! {
            _answer = &mut waiting => panic!("it ended before anybody left"),
            begun = begun => begun.unwrap(),
        }
        drop(waiting);
        drop(first);
        let still = Awaited(Some(Arc::downgrade(&second.waiters)));
        assert!(still.check().is_ok(), "the second still waits");
        drop(second);
        let told = timeout(LIMIT, told).await.expect("it goes on").unwrap();
        assert_eq!(told, ComputeError::NotAwaited.to_string());
    }

    #[tokio::test]
    async fn who_waits_still_has_what_another_began_who_has_left() {
        let shared = SharedWork::<u32>::default();
        let (first, second) = (shared.join("a"), shared.join("a"));
        let (begin, begun) = oneshot::channel();
        let (go_on, held) = sync_channel::<()>(1);
        let mut waiting = Box::pin(first.done(move |awaited| {
            begin.send(()).unwrap();
            held.recv().unwrap();
            awaited.check()?;
            Ok(7)
        }));
        tokio::select! {
            _answer = &mut waiting => panic!("it did not wait"),
            begun = begun => begun.unwrap(),
        }
        drop(waiting);
        drop(first);
        go_on.send(()).unwrap();
        let answer = second.done(|_awaited| panic!("it is begun anew"));
        assert_eq!(timeout(LIMIT, answer).await.unwrap().unwrap(), 7);
    }

    #[tokio::test]
    async fn what_all_have_left_is_begun_anew_and_what_failed_too() {
        let shared = SharedWork::<u32>::default();
        let first = shared.join("a");
        let failed = first.done(|_awaited| Err(ComputeError::inconsistent("a", "planted")));
        assert!(failed.await.unwrap_err().to_string().contains("planted"));
        assert_eq!(first.done(|_awaited| Ok(1)).await.unwrap(), 1);
        let panicked = first.done(|_awaited| panic!("a planted panic"));
        assert!(panicked.await.is_err());
        drop(first);
        let anew = shared.join("a");
        let other = shared.join("b");
        assert!(!Arc::ptr_eq(&anew, &other));
        assert_eq!(anew.done(|_awaited| Ok(2)).await.unwrap(), 2);
        drop((anew, other));
        let _last = shared.join("c");
        assert_eq!(shared.under_way.lock().unwrap().len(), 1, "names are kept");
    }
}
