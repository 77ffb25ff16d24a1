//! Trying again: who asks for the work says how long, and which file is refused for it.

use ::retry::Backoff;

use super::health::Health;
use crate::error::{Cause, IngestError, blame};
use crate::notice::{Answer, PendingNotice};

/// Tries of a file that makes the program fail.
const TRIES_OF_A_FILE: u32 = 3;
/// Times that a command begins its work again for what may pass.
const BEGINNINGS: u32 = 5;

/// Who asks for the work.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Caller {
    /// A service: it waits for whatever fails around it, and publishes each file as soon as it may be.
    Service,
    /// A command: it soon says what fails. It publishes notices in groups, so that the same notices give the same
    /// manifests, however fast each file was read.
    Command,
}

impl Caller {
    /// Tries of a piece of work that fails in this way; none: as many as it takes.
    fn tries(self, error: &IngestError) -> Option<u32> {
        match (self, error.cause()) {
            (Self::Service, Cause::Passing | Cause::Place) => None,
            (Self::Service, Cause::Stored | Cause::Granule) => Some(TRIES_OF_A_FILE),
            // What passes is waited for before all of it is begun again.
            (Self::Command, _) => Some(1),
        }
    }

    /// Is work that ended in this way for the `times`-th time begun again?
    pub(super) fn begins_again(self, error: &IngestError, times: u32) -> bool {
        match self {
            Self::Service => error.is_retryable(),
            // Whoever frees a disk need not come back to start again what was under way.
            Self::Command => error.is_disk_full() || error.is_retryable() && times < BEGINNINGS,
        }
    }

    /// May a file be refused for this, so that others need not wait behind it? Else the work ends.
    pub(super) fn refuses(self, error: &IngestError) -> bool {
        self == Self::Service || error.cause() == Cause::Granule
    }

    /// The refusal of a file for what its last try ended in, or the end of the work.
    pub(super) fn refused(
        self,
        notice: &PendingNotice,
        error: IngestError,
    ) -> Result<Answer, IngestError> {
        if self.refuses(&error) {
            Ok(notice.refused(blame(&error)))
        } else {
            Err(error)
        }
    }
}

/// Tries until it succeeds, or as often as the caller wants it to be tried.
pub(super) async fn retry<T, F>(
    (caller, health): (Caller, &Health),
    what: &'static str,
    mut attempt: impl FnMut() -> F,
) -> Result<T, IngestError>
where
    F: Future<Output = Result<T, IngestError>>,
{
    let mut pauses = Backoff::default().pauses();
    let mut tries = 0;
    let mut held_up = None;
    loop {
        let error = match attempt().await {
            Ok(done) => return Ok(done),
            Err(error) => error,
        };
        if let Some(most) = caller.tries(&error) {
            tries += 1;
            if tries >= most {
                return Err(error);
            }
        }
        tracing::warn!(%error, what, "held up; trying again");
        held_up.replace(health.held_up(&error));
        if let Some(pause) = pauses.next() {
            tokio::time::sleep(pause).await;
        }
    }
}
