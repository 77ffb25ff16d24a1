//! How fast a source sends: one that trickles is left, as one that is silent is.

use std::time::{Duration, Instant};

use bytes::Bytes;
use futures::StreamExt as _;
use futures::stream::BoxStream;

use super::retry::Miss;

/// The slowest that a source may be.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slowest {
    /// On average over `within`.
    pub(super) bytes_s: u64,
    pub(super) within: Duration,
}

/// Watches what comes; time in which nobody waits for the source is not counted.
pub(super) struct Pace {
    slowest: Slowest,
    waited: Duration,
    bytes: u64,
}

impl Pace {
    pub(super) fn new(slowest: Slowest) -> Self {
        Self {
            slowest,
            waited: Duration::ZERO,
            bytes: 0,
        }
    }

    /// What comes next.
    pub(super) async fn next(
        &mut self,
        chunks: &mut BoxStream<'_, Result<Bytes, Miss>>,
    ) -> Option<Result<Bytes, Miss>> {
        loop {
            let begun = Instant::now();
            let left = self.slowest.within.saturating_sub(self.waited);
            let came = tokio::time::timeout(left, chunks.next()).await;
            self.waited += begun.elapsed();
            match came {
                Ok(Some(Ok(chunk))) => {
                    self.bytes += chunk.len() as u64;
                    return Some(self.judge().map(|()| chunk));
                }
                Ok(ended) => return ended,
                Err(_late) => {
                    // The timer and the clock need not agree to the millisecond.
                    self.waited = self.waited.max(self.slowest.within);
                    if let Err(miss) = self.judge() {
                        return Some(Err(miss));
                    }
                }
            }
        }
    }

    /// Was what came in a whole stretch of time enough? Then the next one begins.
    fn judge(&mut self) -> Result<(), Miss> {
        if self.waited < self.slowest.within {
            return Ok(());
        }
        let (seconds, bytes) = (self.waited.as_secs_f64(), self.bytes);
        (self.waited, self.bytes) = (Duration::ZERO, 0);
        if (bytes as f64) < seconds * self.slowest.bytes_s as f64 || bytes == 0 {
            let detail = format!("only {bytes} bytes came in {seconds:.0} s");
            return Err(Miss::Away(detail));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SLOWEST: Slowest = Slowest {
        bytes_s: 100,
        within: Duration::from_secs(2),
    };

    /// Bytes that come of a source which sends so many at a time and then pauses, until it is left or ends.
    async fn sent(chunks: usize, bytes: usize, pause_ms: u64) -> Result<usize, String> {
        let one = move |_| async move {
            tokio::time::sleep(Duration::from_millis(pause_ms)).await;
            Ok(Bytes::from(vec![0; bytes]))
        };
        let mut stream = futures::stream::iter(0..chunks).then(one).boxed();
        let mut pace = Pace::new(SLOWEST);
        let mut all = 0;
        while let Some(chunk) = pace.next(&mut stream).await {
            match chunk {
                Ok(chunk) => all += chunk.len(),
                Err(Miss::Away(why)) => return Err(why),
                Err(other) => panic!("{other:?}"),
            }
        }
        Ok(all)
    }

    #[tokio::test]
    async fn a_source_that_trickles_or_is_silent_is_left_and_others_are_not() {
        let all = (
            sent(1000, 1, 20),
            sent(2, 1 << 20, 60_000),
            sent(60, 200, 50),
        );
        let (slow, silent, good) = tokio::join!(all.0, all.1, all.2);
        let slow = slow.unwrap_err();
        assert!(slow.contains("bytes came in"), "{slow}");
        let silent = silent.unwrap_err();
        assert!(silent.starts_with("only 0 bytes"), "{silent}");
        assert_eq!(good, Ok(12_000), "forty times the least");
    }
}
