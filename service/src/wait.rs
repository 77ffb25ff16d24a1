//! Waiting for what a service needs: it may start later, go away and come back.

use std::fmt::Display;
use std::future::Future;

use retry::Backoff;

use crate::Stop;

/// Tries until it succeeds, fails in a way that no waiting mends, or the service is asked to stop (then `None`).
///
/// # Errors
/// The first error that `is_retryable` denies.
pub async fn until_there<T, E, F>(
    what: &str,
    stop: &Stop,
    is_retryable: impl Fn(&E) -> bool,
    mut attempt: impl FnMut() -> F,
) -> Result<Option<T>, E>
where
    E: Display,
    F: Future<Output = Result<T, E>>,
{
    for pause in Backoff::default().pauses() {
        let error = tokio::select! {
            () = stop.said() => return Ok(None),
            tried = attempt() => match tried {
                Ok(there) => return Ok(Some(there)),
                Err(error) if is_retryable(&error) => error,
                Err(error) => return Err(error),
            },
        };
        tracing::warn!(%error, what, "not there yet; trying again");
        tokio::select! {
            () = stop.said() => return Ok(None),
            () = tokio::time::sleep(pause) => {}
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicU32, Ordering};

    #[tokio::test]
    async fn what_passes_is_waited_for_and_what_does_not_ends_it() {
        let tries = AtomicU32::new(0);
        let attempt = || async {
            match tries.fetch_add(1, Ordering::Relaxed) {
                0..3 => Err("away"),
                _ => Ok(7),
            }
        };
        let stop = Stop::new();
        let there = until_there("a part", &stop, |e| *e == "away", attempt).await;
        assert_eq!(there, Ok(Some(7)));
        let never = || async { Err::<u8, _>("wrong") };
        assert_eq!(
            until_there("a part", &stop, |e| *e == "away", never).await,
            Err("wrong")
        );
        stop.now();
        let away = || async { Err::<u8, _>("away") };
        assert_eq!(until_there("a part", &stop, |_| true, away).await, Ok(None));
    }
}
