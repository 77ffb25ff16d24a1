//! Pieces of a question, which some threads work off one after the other: each takes the next one when it has reduced the last, and
//! nothing is handed from thread to thread in between.

use std::iter;
use std::sync::{Arc, Mutex, PoisonError};

use tokio::runtime::Handle;
use tokio::sync::{Semaphore, SemaphorePermit};
use tokio::task::{JoinHandle, spawn_blocking};

use super::accumulator::Accumulated;
use super::question::Piece;
use crate::ComputeError;

/// Threads that questions of this process work on at a time: half of the 512 that a runtime has for what blocks. Each of them waits for
/// reads, which need threads of the same runtime: were all of these questions', none of them would ever end.
static THREADS: Semaphore = Semaphore::const_new(256);

/// Reads a piece and reduces it. It must not ask for what pieces come to in turn: it would wait for a thread on a thread.
pub(super) trait Reduce:
    AsyncFn(Piece) -> Result<Accumulated, ComputeError> + Send + Sync + 'static
{
}

impl<R> Reduce for R where
    R: AsyncFn(Piece) -> Result<Accumulated, ComputeError> + Send + Sync + 'static
{
}

/// Pieces that nobody works on yet, those of large maps cut when their turn comes.
struct PieceQueue(Mutex<Box<dyn Iterator<Item = Piece> + Send>>);

impl PieceQueue {
    fn of(pieces: Vec<Piece>) -> Self {
        let pieces = pieces.into_iter().flat_map(Piece::cut);
        Self(Mutex::new(Box::new(pieces)))
    }

    fn next(&self) -> Option<Piece> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).next()
    }

    /// Nobody needs what is left.
    fn clear(&self) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Box::new(iter::empty());
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

/// What all pieces come to, reduced by as many threads as `at_once`, which `reduce` keeps busy; by fewer where other questions have theirs.
///
/// # Errors
/// As `reduce`; sums that leave their range.
pub(super) async fn reduced(
    reduce: impl Reduce,
    pieces: Vec<Piece>,
    at_once: usize,
) -> Result<Accumulated, ComputeError> {
    reduced_on(&THREADS, reduce, pieces, at_once).await
}

async fn reduced_on(
    free: &'static Semaphore,
    reduce: impl Reduce,
    pieces: Vec<Piece>,
    at_once: usize,
) -> Result<Accumulated, ComputeError> {
    let piece_count: usize = pieces.iter().map(Piece::cut_count).sum();
    let thread_count = at_once.clamp(1, piece_count.max(1));
    let queue = Arc::new(PieceQueue::of(pieces));
    let awaited = Awaited(Arc::clone(&queue));
    // One is waited for, so that every question has its turn, and no more: who waits holds nothing that others wait for.
    let first = free.acquire().await.expect("nobody closes it");
    let reduce = Arc::new(reduce);
    let thread = |permit: SemaphorePermit<'static>| {
        let (reduce, queue) = (Arc::clone(&reduce), Arc::clone(&queue));
        let runtime = Handle::current();
        spawn_blocking(move || {
            let _permit = permit;
            runtime.block_on(queue.work_off(&*reduce))
        })
    };
    let more = (1..thread_count).map_while(|_number| free.try_acquire().ok());
    let threads: Vec<JoinHandle<_>> = iter::once(first).chain(more).map(thread).collect();
    let mut all = Accumulated::default();
    for thread in threads {
        let part = thread.await;
        all.merge(part.map_err(|e| ComputeError::inconsistent("statistics", e))??)?;
    }
    drop(awaited);
    Ok(all)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::time::{Duration, Instant};

    use contract::digest::Digest;
    use contract::key::ObjectKey;
    use futures::future;
    use tokio::runtime::Builder;
    use tokio::sync::{Notify, oneshot};
    use tokio::time::timeout;

    use super::super::accumulator::StepSums;
    use super::super::question::Layout;
    use super::*;

    /// Time after which a test that waits has failed.
    const LIMIT: Duration = Duration::from_secs(30);
    /// Time for a thread too many to come.
    const TOO_MANY: Duration = Duration::from_millis(300);

    /// So many pieces, each of a step of its own.
    fn pieces(count: u32) -> Vec<Piece> {
        let piece = |number: u32| Piece {
            key: ObjectKey::field(&"p".parse().unwrap(), &Digest::of(&number.to_le_bytes())),
            address: "".into(),
            layout: Layout::Blocks,
            first_step: number,
            steps: 0..1,
            rows: [].into(),
            inside: vec![],
        };
        (0..count).map(piece).collect()
    }

    /// What a piece comes to: one value in its step.
    fn sums_of(piece: &Piece, sum: i128) -> Accumulated {
        let sums = StepSums {
            count: 1,
            sum,
            ..StepSums::default()
        };
        Accumulated {
            steps: BTreeMap::from([(piece.first_step, sums)]),
            ..Accumulated::default()
        }
    }

    fn failed() -> ComputeError {
        ComputeError::inconsistent("a piece", "it cannot be read")
    }

    #[tokio::test]
    async fn every_piece_is_reduced_once_by_any_number_of_threads() {
        for count in [0, 1, 2, 7, 50] {
            for at_once in [0, 1, 2, 3, 8, 100] {
                let reduce = async |piece: Piece| Ok(sums_of(&piece, i128::from(piece.first_step)));
                let all = reduced(reduce, pieces(count), at_once).await.unwrap();
                let found = all
                    .steps
                    .iter()
                    .map(|(step, own)| (*step, own.count, own.sum));
                let wanted = (0..count).map(|step| (step, 1, i128::from(step)));
                assert!(
                    found.eq(wanted),
                    "{count} pieces, {at_once} at once: {all:?}"
                );
            }
        }
    }

    #[tokio::test]
    async fn as_many_are_worked_on_at_a_time_as_may_be_and_no_more() {
        for (count, at_once, wanted) in [(12, 3, 3), (12, 1, 1), (2, 8, 2)] {
            let (now, most) = (Arc::new(AtomicUsize::new(0)), Arc::new(AtomicUsize::new(0)));
            let reduce = {
                let (most, begun) = (Arc::clone(&most), Instant::now());
                async move |piece: Piece| {
                    let own = now.fetch_add(1, Ordering::SeqCst) + 1;
                    most.fetch_max(own, Ordering::SeqCst);
                    let is_held = || match most.load(Ordering::SeqCst) {
                        most if most < wanted => begun.elapsed() < LIMIT,
                        most => most == wanted && begun.elapsed() < TOO_MANY,
                    };
                    while is_held() {
                        std::thread::yield_now();
                    }
                    now.fetch_sub(1, Ordering::SeqCst);
                    Ok(sums_of(&piece, 1))
                }
            };
            let all = reduced(reduce, pieces(count), at_once).await.unwrap();
            assert_eq!(all.steps.len(), count as usize);
            assert_eq!(most.load(Ordering::SeqCst), wanted, "{count} {at_once}");
        }
    }

    #[tokio::test]
    async fn an_error_ends_a_question_and_leaves_the_rest_undone() {
        let begun = Arc::new(AtomicUsize::new(0));
        let own = Arc::clone(&begun);
        let third_fails = async move |piece: Piece| {
            own.fetch_add(1, Ordering::SeqCst);
            match piece.first_step {
                2 => Err(failed()),
                _ => Ok(sums_of(&piece, 1)),
            }
        };
        let queue = PieceQueue::of(pieces(10));
        let told = queue.work_off(&third_fails).await.unwrap_err();
        assert!(told.to_string().contains("cannot be read"), "{told}");
        assert_eq!(begun.load(Ordering::SeqCst), 3);
        assert!(queue.next().is_none(), "others would go on");
    }

    #[tokio::test]
    async fn an_error_on_any_thread_is_that_of_the_question() {
        for at_once in [1, 2, 5] {
            for failing in [0, 1, 19] {
                let reduce = async move |piece: Piece| {
                    let part = sums_of(&piece, 1);
                    (piece.first_step != failing)
                        .then_some(part)
                        .ok_or_else(failed)
                };
                let told = reduced(reduce, pieces(20), at_once).await;
                assert!(told.is_err(), "piece {failing}, {at_once} at once");
            }
        }
    }

    #[tokio::test]
    async fn sums_that_leave_their_range_are_an_error_and_end_it_too() {
        let queue = PieceQueue::of([pieces(1), pieces(1), pieces(1)].concat());
        let reduce = async |piece: Piece| Ok(sums_of(&piece, i128::MAX));
        assert!(queue.work_off(&reduce).await.is_err());
        assert!(queue.next().is_none(), "the rest is worked on");
        let both = [pieces(1), pieces(1)].concat();
        assert!(reduced(reduce, both, 2).await.is_err());
    }

    #[tokio::test]
    async fn a_question_that_nobody_waits_for_leaves_the_rest_of_its_pieces_undone() {
        let count = Arc::new(AtomicUsize::new(0));
        let (begun, go_on) = (Arc::new(Notify::new()), Arc::new(Semaphore::new(0)));
        // Gone with the last thread.
        let (ended, has_ended) = oneshot::channel::<()>();
        let reduce = {
            let (count, begun, go_on) =
                (Arc::clone(&count), Arc::clone(&begun), Arc::clone(&go_on));
            async move |piece: Piece| {
                assert!(!ended.is_closed());
                count.fetch_add(1, Ordering::SeqCst);
                begun.notify_one();
                go_on.acquire().await.unwrap().forget();
                Ok(sums_of(&piece, 1))
            }
        };
        let mut asked = Box::pin(reduced(reduce, pieces(5), 1));
        tokio::select! {
            answer = &mut asked => panic!("it did not wait: {answer:?}"),
            () = begun.notified() => {}
        }
        drop(asked);
        go_on.add_permits(5);
        let is_over = tokio::time::timeout(LIMIT, has_ended).await;
        assert!(is_over.is_ok(), "its thread is still there");
        assert_eq!(count.load(Ordering::SeqCst), 1, "the piece that it was at");
    }

    /// A runtime of four threads for what blocks, and what is asked in it within the limit.
    fn in_four_threads<T>(asked: impl Future<Output = T>) -> Option<T> {
        let runtime = Builder::new_multi_thread()
            .worker_threads(2)
            .max_blocking_threads(4)
            .enable_time()
            .build()
            .unwrap();
        let answer = runtime.block_on(async { timeout(LIMIT, asked).await.ok() });
        // Threads that wait for each other would be waited for.
        runtime.shutdown_background();
        answer
    }

    #[test]
    fn questions_leave_threads_for_what_they_read() {
        static HALF: Semaphore = Semaphore::const_new(2);
        let asked = (0..8).map(|_question| {
            let reduce = async |piece: Piece| {
                let read = spawn_blocking(move || sums_of(&piece, 1));
                Ok(read.await.unwrap())
            };
            reduced_on(&HALF, reduce, pieces(20), 4)
        });
        let all = in_four_threads(future::join_all(asked));
        let all = all.expect("threads wait for reads that have no thread");
        for one in all {
            assert_eq!(one.unwrap().steps.len(), 20);
        }
        assert_eq!(HALF.available_permits(), 2, "a thread is not given back");
    }
}
