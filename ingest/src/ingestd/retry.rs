//! Trying again: for ever where the file is not to blame, a few times where it may be.

use retry::Backoff;

use super::health::Health;
use crate::error::{Cause, IngestError};

/// Attempts at a file that makes the program fail.
const ATTEMPTS_AT_A_FILE: u32 = 3;

/// Tries until it succeeds, or until the file or what is stored of its product is to blame.
pub(super) async fn retry<T, F>(
    health: &Health,
    what: &'static str,
    mut attempt: impl FnMut() -> F,
) -> Result<T, IngestError>
where
    F: Future<Output = Result<T, IngestError>>,
{
    let mut pauses = Backoff::default().pauses();
    let mut blamed = 0;
    let mut held_up = None;
    loop {
        let error = match attempt().await {
            Ok(done) => return Ok(done),
            Err(error) => error,
        };
        match error.cause() {
            Cause::Passing | Cause::Place => {}
            Cause::Stored | Cause::Granule => {
                blamed += 1;
                if blamed >= ATTEMPTS_AT_A_FILE {
                    return Err(error);
                }
            }
        }
        tracing::warn!(%error, what, "held up; trying again");
        held_up.replace(health.held_up(&error));
        if let Some(pause) = pauses.next() {
            tokio::time::sleep(pause).await;
        }
    }
}
