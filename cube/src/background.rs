//! Compaction in the background of whoever publishes: one at a time in a process, so that its memory is that of one.

use std::collections::BTreeSet;
use std::sync::{LazyLock, Mutex, PoisonError};

use storage::Store;
use tokio::sync::{Semaphore, watch};

use crate::compact;

/// How many wait or run.
static UNDER_WAY: LazyLock<watch::Sender<usize>> = LazyLock::new(|| watch::Sender::new(0));
static TURN: Semaphore = Semaphore::const_new(1);
/// Cubes that wait for their turn, by where they are.
static WAITING: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());

/// One that waits or runs; it counts itself, whatever becomes of it.
struct Task {
    place: String,
}

impl Task {
    /// None if the same waits already.
    fn new(place: String) -> Option<Self> {
        let mut waiting = WAITING.lock().unwrap_or_else(PoisonError::into_inner);
        if !waiting.insert(place.clone()) {
            return None;
        }
        UNDER_WAY.send_modify(|count| *count += 1);
        Some(Self { place })
    }

    /// Others that come from now on have to wait themselves: it may not see what they saw.
    fn waits_no_more(&self) {
        let mut waiting = WAITING.lock().unwrap_or_else(PoisonError::into_inner);
        waiting.remove(&self.place);
    }
}

impl Drop for Task {
    fn drop(&mut self) {
        self.waits_no_more();
        UNDER_WAY.send_modify(|count| *count = count.saturating_sub(1));
    }
}

/// Has the runs of the cube in a folder made time-major, some time.
pub(crate) fn begin(store: Store, folder: String) {
    let Some(task) = Task::new(format!("{}{folder}", store.url())) else {
        return;
    };
    // Nobody waits for what becomes of it: it is said in the log, and the next to publish tries again.
    drop(tokio::spawn(async move {
        let Ok(_turn) = TURN.acquire().await else {
            return;
        };
        task.waits_no_more();
        match compact(&store, &folder).await {
            Ok(0) => {}
            Ok(runs) => tracing::debug!(%folder, runs, "runs of steps are time-major now"),
            Err(error) => {
                tracing::warn!(%folder, %error, "its newest steps stay map-major until its next version");
            }
        }
        drop(task);
    }));
}

/// Waits until nothing is compacted in this process any more: for commands, which end it. Services are killed at any point,
/// and whoever publishes next goes on.
pub async fn compacted() {
    let mut under_way = UNDER_WAY.subscribe();
    // The sender lives as long as the process.
    drop(under_way.wait_for(|count| *count == 0).await);
}
