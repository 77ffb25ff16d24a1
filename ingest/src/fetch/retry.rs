//! How often and how long a source is asked again before its file is given up.

use std::time::Duration;

use contract::event::RejectReason;
use retry::{Backoff, Pauses};

use super::location::Location;
use crate::error::{IngestError, Rejection, Stop};

/// How often and how long a source is asked again.
#[derive(Debug, Clone, Copy)]
pub struct RetryLimits {
    /// Attempts at a source that answers that the file is not there, or not for us: an announced file can come late.
    pub attempts: u32,
    /// How long a source that cannot be reached, or says that it is out of order, is asked again.
    pub away: Duration,
    /// Time limit of one attempt.
    pub one_attempt: Duration,
    /// A source that sends nothing for so long, or less than `slowest_bytes_s` on average, is left and asked again.
    pub silence: Duration,
    /// The slowest that a source may be, bytes a second.
    pub slowest_bytes_s: u64,
}

impl Default for RetryLimits {
    fn default() -> Self {
        Self {
            attempts: 5,
            away: Duration::from_mins(5),
            one_attempt: Duration::from_mins(30),
            silence: Duration::from_secs(30),
            slowest_bytes_s: 4096,
        }
    }
}

/// Pauses between attempts. They end at no limit of their own: what counts is the time that a source took.
const BACKOFF: Backoff = Backoff {
    first_pause: Duration::from_millis(500),
    longest_pause: Duration::from_secs(15),
    attempts: None,
    limit: None,
};

/// How an attempt to have a file can end without it.
#[derive(Debug)]
pub(super) enum Miss {
    /// The source says that it is not there, or not for us.
    Absent(String),
    /// The source does not answer, or says that it is out of order.
    Away(String),
    /// Trying again does not help.
    Stop(Stop),
}

impl<E: Into<Stop>> From<E> for Miss {
    fn from(error: E) -> Self {
        Self::Stop(error.into())
    }
}

/// Attempts to have one file.
pub(super) struct Attempts {
    retry_limits: RetryLimits,
    pauses: Pauses,
    /// Spent on attempts and pauses; waiting for room of our own is not the source's fault.
    spent: Duration,
    absent: u32,
}

impl Attempts {
    pub(super) fn new(retry_limits: RetryLimits) -> Self {
        Self {
            retry_limits,
            pauses: BACKOFF.pauses(),
            spent: Duration::ZERO,
            absent: 0,
        }
    }

    /// Waits for the next attempt after one that took so long, or gives the file up.
    pub(super) async fn after(
        &mut self,
        miss: Miss,
        took: Duration,
        location: &Location,
    ) -> Result<(), Stop> {
        self.spent += took;
        let (why, is_over) = match miss {
            Miss::Stop(stop) => return Err(stop),
            Miss::Absent(why) => {
                self.absent += 1;
                (why, self.absent >= self.retry_limits.attempts)
            }
            Miss::Away(why) => (why, self.spent >= self.retry_limits.away),
        };
        if is_over {
            return Err(given_up(self.spent, &why));
        }
        tracing::info!(%location, why, "not had yet; trying again");
        let pause = self.pauses.next().unwrap_or(BACKOFF.longest_pause);
        self.spent += pause;
        tokio::time::sleep(pause).await;
        Ok(())
    }
}

/// The refusal of a file that its source did not give in so long.
pub(super) fn given_up(spent: Duration, why: &str) -> Stop {
    let seconds = spent.as_secs();
    let detail = format!("could not be had in {seconds} s: {why}; send it again when it is there");
    Rejection::new(RejectReason::Unavailable, "file", detail).into()
}

/// An attempt under its time limit.
pub(super) async fn limited<T>(
    limit: Duration,
    work: impl Future<Output = Result<T, Miss>>,
) -> Result<T, Miss> {
    match tokio::time::timeout(limit, work).await {
        Ok(done) => done,
        Err(_elapsed) => Err(Miss::Away(format!(
            "not all of it came in {} s",
            limit.as_secs()
        ))),
    }
}

/// The first answer of a source, within a time.
pub(super) async fn answered<T>(
    limit: Duration,
    asked: impl Future<Output = Result<T, Miss>>,
) -> Result<T, Miss> {
    match tokio::time::timeout(limit, asked).await {
        Ok(done) => done,
        Err(_elapsed) => Err(Miss::Away(format!("no answer in {} s", limit.as_secs()))),
    }
}

/// A task that ended early is a fault of the program.
impl Miss {
    pub(super) fn task(error: tokio::task::JoinError) -> Self {
        Self::Stop(Stop::Failed(IngestError::Task(error)))
    }
}
