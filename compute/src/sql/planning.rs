//! A question that is being planned: the work in; what comes of it out, or its end, where it pauses next, when nobody waits for it any more.
//!
//! A plan may take long without a pause. It is made on a thread of its own, so that it can be left when its time is over, and holds none that other
//! questions, and their times, need.

use tokio::runtime::Handle;
use tokio::sync::oneshot;
use tokio::task::{JoinHandle, spawn_blocking};
use tokio::time::{Instant, timeout_at};

use super::limits::SqlLimits;
use super::told::overdue;
use crate::ComputeError;

/// Work on a plan. Dropped, it is left.
pub(super) struct Planning<T> {
    /// Nothing of what was left.
    work: JoinHandle<Option<Result<T, ComputeError>>>,
    /// Goes with it, which tells the work to end.
    _wanted: oneshot::Sender<()>,
}

impl<T: Send + 'static> Planning<T> {
    pub(super) fn start(
        work: impl Future<Output = Result<T, ComputeError>> + Send + 'static,
    ) -> Self {
        let (wanted, unwanted) = oneshot::channel::<()>();
        let runtime = Handle::current();
        // The thread's stack is for the plan.
        let work = Box::pin(work);
        let on_its_own = move || {
            runtime.block_on(async move {
                tokio::select! {
                    _left = unwanted => None,
                    done = work => Some(done),
                }
            })
        };
        Self {
            work: spawn_blocking(on_its_own),
            _wanted: wanted,
        }
    }

    /// What comes of it.
    ///
    /// # Errors
    /// Its own, and `QueryTime` where it is not there at its deadline.
    pub(super) async fn until(
        mut self,
        deadline: Instant,
        limits: SqlLimits,
    ) -> Result<T, ComputeError> {
        let Ok(ended) = timeout_at(deadline, &mut self.work).await else {
            return Err(overdue(limits));
        };
        let ended = ended.map_err(|e| ComputeError::inconsistent("the query engine", e))?;
        ended.unwrap_or_else(|| Err(overdue(limits)))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::mpsc::sync_channel;
    use std::time::Duration;

    use tokio::sync::Semaphore;

    use super::*;

    const LIMITS: SqlLimits = SqlLimits {
        memory_bytes: 1 << 20,
        time: Duration::ZERO,
    };

    /// On the one thread of this test nothing would ever wake it.
    #[tokio::test]
    async fn work_that_never_pauses_is_left_at_its_deadline_and_holds_its_turn_until_it_ends() {
        let turns = Arc::new(Semaphore::new(1));
        let turn = Arc::clone(&turns).try_acquire_owned().unwrap();
        let (release, held) = sync_channel::<()>(1);
        let (begin, begun) = oneshot::channel();
        let planning = Planning::start(async move {
            begin.send(()).unwrap();
            assert!(held.recv().is_err());
            Ok(turn)
        });
        begun.await.unwrap();
        let left = planning.until(Instant::now(), LIMITS).await;
        let error = left.unwrap_err();
        assert!(matches!(error, ComputeError::QueryTime { .. }), "{error}");
        assert_eq!(turns.available_permits(), 0);
        drop(release);
        drop(turns.acquire().await.unwrap());
    }

    #[tokio::test]
    async fn work_that_nobody_waits_for_ends_where_it_pauses() {
        let (held, let_go) = oneshot::channel::<()>();
        let planning = Planning::start(async move {
            let _held = held;
            std::future::pending::<Result<(), ComputeError>>().await
        });
        drop(planning);
        assert!(let_go.await.is_err());
    }
}
