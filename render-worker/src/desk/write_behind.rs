//! Pictures that are stored after they were given out: a bounded number of bytes at a time.

use std::sync::Arc;
use std::time::Instant;

use prometheus::Histogram;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

/// Pictures that are written at the same time, together at most so large: some 90 views, or 3000 tiles. One that finds no
/// room is stored before it is given out, so that a slow store slows down those who ask, and fills no memory.
const MOST_KIB: u32 = 64 << 10;

/// Room for writes, and how long they take.
pub(super) struct WriteBehind {
    room_kib: Arc<Semaphore>,
    store_s: Histogram,
}

impl WriteBehind {
    pub(super) fn new(store_s: Histogram) -> Self {
        Self {
            room_kib: Arc::new(Semaphore::new(MOST_KIB as usize)),
            store_s,
        }
    }

    /// Room for a picture of so many bytes until it is dropped; none if there is none now.
    pub(super) fn room(&self, bytes: usize) -> Option<OwnedSemaphorePermit> {
        let kib = u32::try_from(bytes.div_ceil(1024)).ok()?.max(1);
        Arc::clone(&self.room_kib).try_acquire_many_owned(kib).ok()
    }

    /// Times a write.
    pub(super) async fn timed<T>(&self, write: impl Future<Output = T>) -> T {
        let begun = Instant::now();
        let done = write.await;
        self.store_s.observe(begun.elapsed().as_secs_f64());
        done
    }

    /// Returns when nothing is written.
    pub(super) async fn settled(&self) {
        // It is never closed; a closed one would hold nothing either.
        drop(self.room_kib.acquire_many(MOST_KIB).await);
    }
}

#[cfg(test)]
mod tests {
    use futures::FutureExt as _;
    use prometheus::HistogramOpts;

    use super::*;

    #[tokio::test]
    async fn what_is_written_at_once_is_bounded_by_its_bytes() {
        let store_s = Histogram::with_opts(HistogramOpts::new("a", "b")).unwrap();
        let writes = WriteBehind::new(store_s);
        let most = MOST_KIB as usize * 1024;
        let held = writes.room(most - 1024).unwrap();
        assert!(writes.room(1025).is_none());
        let small = writes.room(0).unwrap();
        assert!(writes.room(1).is_none());
        assert!(writes.settled().now_or_never().is_none());
        drop((held, small));
        assert!(writes.settled().now_or_never().is_some());
        assert!(writes.room(most + 1).is_none());
    }
}
