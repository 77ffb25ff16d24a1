//! Trying again what may pass: how often, for how long, and the pauses in between.
//!
//! Left out on purpose: which failures may pass, which every crate asks of its own errors.

use std::time::{Duration, Instant};

use backon::{BackoffBuilder, ExponentialBuilder};

/// `attempt.retry(backoff.pauses()).when(may_pass)`.
pub use backon::Retryable;

/// When to try again. Pauses double from the first to the longest; each is lengthened by jitter, at most by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Backoff {
    /// Pause after the first attempt.
    pub first_pause: Duration,
    /// Longest pause, without its jitter.
    pub longest_pause: Duration,
    /// Most attempts; any number if none.
    pub attempts: Option<usize>,
    /// How long after the beginning the last attempt is begun; never if none.
    pub limit: Option<Duration>,
}

impl Default for Backoff {
    /// For what somebody else has to mend: a tenth of a second to five seconds, for ever.
    fn default() -> Self {
        Self {
            first_pause: Duration::from_millis(100),
            longest_pause: Duration::from_secs(5),
            attempts: None,
            limit: None,
        }
    }
}

impl Backoff {
    /// The default, for so long.
    pub fn within(limit: Duration) -> Self {
        Self {
            limit: Some(limit),
            ..Self::default()
        }
    }

    /// For lost races for the next number of something: short pauses, so that writers of one thing get apart.
    pub const fn contended(attempts: usize) -> Self {
        Self {
            first_pause: Duration::from_millis(5),
            longest_pause: Duration::from_millis(640),
            attempts: Some(attempts),
            limit: None,
        }
    }

    /// The pauses between attempts, of which the first begins now.
    pub fn pauses(self) -> Pauses {
        let builder = ExponentialBuilder::new()
            .with_min_delay(self.first_pause)
            .with_max_delay(self.longest_pause)
            .with_jitter();
        let builder = match self.attempts {
            Some(attempts) => builder.with_max_times(attempts.saturating_sub(1)),
            None => builder.without_max_times(),
        };
        Pauses {
            exponential: builder.build(),
            end: self.limit.map(|limit| Instant::now() + limit),
        }
    }
}

/// Pauses before the attempts that are left; the last one ends at the limit, however long attempts take.
#[derive(Debug)]
pub struct Pauses {
    exponential: <ExponentialBuilder as BackoffBuilder>::Backoff,
    end: Option<Instant>,
}

impl Iterator for Pauses {
    type Item = Duration;

    fn next(&mut self) -> Option<Duration> {
        let pause = self.exponential.next()?;
        match self.end {
            None => Some(pause),
            Some(end) => {
                let left = end.saturating_duration_since(Instant::now());
                (left > Duration::ZERO).then_some(pause.min(left))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_grow_to_the_longest_with_its_jitter_and_never_end() {
        let backoff = Backoff::default();
        let pauses: Vec<Duration> = backoff.pauses().take(1000).collect();
        assert_eq!(pauses.len(), 1000);
        assert!(pauses[0] >= backoff.first_pause && pauses[0] <= 2 * backoff.first_pause);
        let longest = pauses.iter().max().unwrap();
        assert!(*longest > backoff.longest_pause && *longest <= 2 * backoff.longest_pause);
    }

    #[tokio::test]
    async fn the_last_attempt_is_begun_when_the_limit_is_reached() {
        let limit = Duration::from_millis(150);
        let mut begun_at = vec![];
        let begun = Instant::now();
        let attempt = || {
            begun_at.push(begun.elapsed());
            async { Err::<(), _>(()) }
        };
        let ended = attempt.retry(Backoff::within(limit).pauses()).await;
        assert_eq!(ended, Err(()));
        // After a tenth of a second, and at the limit at the latest.
        let (last, before) = begun_at.split_last().unwrap();
        assert!(*last >= limit, "{last:?}");
        assert!(before.iter().all(|at| *at < limit), "{before:?}");
        let long = Backoff {
            first_pause: Duration::from_hours(1),
            ..Backoff::within(limit)
        };
        assert!(long.pauses().next().is_some_and(|pause| pause <= limit));
    }

    #[tokio::test]
    async fn an_attempt_that_outlasts_the_limit_is_the_last() {
        let mut attempts = 0;
        let attempt = || {
            attempts += 1;
            async {
                tokio::time::sleep(Duration::from_millis(20)).await;
                Err::<(), _>(())
            }
        };
        let backoff = Backoff::within(Duration::from_millis(5));
        assert_eq!(attempt.retry(backoff.pauses()).await, Err(()));
        assert_eq!(attempts, 1);
    }

    #[tokio::test]
    async fn attempts_are_counted() {
        for most in [1, 4] {
            let mut attempts = 0;
            let attempt = || {
                attempts += 1;
                async { Err::<(), _>(()) }
            };
            let ended = attempt.retry(Backoff::contended(most).pauses()).await;
            assert_eq!((ended, attempts), (Err(()), most));
        }
    }
}
