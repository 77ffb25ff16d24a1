//! Pieces of a question, which some threads work off one after the other: each takes the next one when it has reduced the last, and
//! nothing is handed from thread to thread in between.

use std::sync::{Arc, Mutex, PoisonError};

use tokio::runtime::Handle;
use tokio::task::{JoinHandle, spawn_blocking};

use super::accumulator::Accumulated;
use super::question::Piece;
use crate::ComputeError;

/// Reads a piece and reduces it.
pub(super) trait Reduce:
    AsyncFn(Piece) -> Result<Accumulated, ComputeError> + Send + Sync + 'static
{
}

impl<R> Reduce for R where
    R: AsyncFn(Piece) -> Result<Accumulated, ComputeError> + Send + Sync + 'static
{
}

/// Pieces that nobody works on yet.
struct PieceQueue(Mutex<std::vec::IntoIter<Piece>>);

impl PieceQueue {
    fn next(&self) -> Option<Piece> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).next()
    }

    /// Nobody needs what is left.
    fn clear(&self) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = vec![].into_iter();
    }

    async fn work_off(&self, reduce: &impl Reduce) -> Result<Accumulated, ComputeError> {
        let mut all = Accumulated::default();
        while let Some(piece) = self.next() {
            let reduced = reduce(piece).await;
            let merged = reduced.and_then(|part| all.merge(part));
            if merged.is_err() {
                self.clear();
            }
            merged?;
        }
        Ok(all)
    }
}

/// Empties a queue when nobody waits any more: threads end with the piece that they are at.
struct Awaited(Arc<PieceQueue>);

impl Drop for Awaited {
    fn drop(&mut self) {
        self.0.clear();
    }
}

/// What all pieces come to, reduced by as many threads as `at_once`, which `reduce` keeps busy.
///
/// # Errors
/// As `reduce`; sums that leave their range.
pub(super) async fn reduced(
    reduce: impl Reduce,
    pieces: Vec<Piece>,
    at_once: usize,
) -> Result<Accumulated, ComputeError> {
    let thread_count = at_once.clamp(1, pieces.len().max(1));
    let queue = Arc::new(PieceQueue(Mutex::new(pieces.into_iter())));
    let awaited = Awaited(Arc::clone(&queue));
    let reduce = Arc::new(reduce);
    let thread = |_number: usize| {
        let (reduce, queue) = (Arc::clone(&reduce), Arc::clone(&queue));
        let runtime = Handle::current();
        spawn_blocking(move || runtime.block_on(queue.work_off(&*reduce)))
    };
    let threads: Vec<JoinHandle<_>> = (0..thread_count).map(thread).collect();
    let mut all = Accumulated::default();
    for thread in threads {
        let part = thread.await;
        all.merge(part.map_err(|e| ComputeError::inconsistent("statistics", e))??)?;
    }
    drop(awaited);
    Ok(all)
}
