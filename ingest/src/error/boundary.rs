//! Work for one file in, its result out, or its panic as an error: what a file does to this program ends with the file.
//!
//! The values of a file are read in another process; its description is planned in this one, which others wait for. A
//! fault that a file finds here refuses it. What the work held (places, memory, its reader process) is given back as it is
//! dropped, and nothing that it changed is looked at again, so that going on is safe.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

use futures::FutureExt as _;

use crate::error::IngestError;

/// What a panic says that carries no text.
const SPEECHLESS: &str = "no reason given";

/// Runs work to its end or its panic.
pub(crate) async fn contained<T>(work: impl Future<Output = T>) -> Result<T, IngestError> {
    AssertUnwindSafe(work)
        .catch_unwind()
        .await
        .map_err(panicked)
}

/// Calls a function to its end or its panic.
pub(crate) fn called<T>(work: impl FnOnce() -> T) -> Result<T, IngestError> {
    catch_unwind(AssertUnwindSafe(work)).map_err(panicked)
}

#[expect(
    clippy::needless_pass_by_value,
    reason = "the payload ends here, as its owner"
)]
fn panicked(payload: Box<dyn Any + Send>) -> IngestError {
    let text = payload.downcast_ref::<&'static str>().copied();
    let text = text.or_else(|| payload.downcast_ref::<String>().map(String::as_str));
    IngestError::Panicked {
        what: text.unwrap_or(SPEECHLESS).to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_panic_becomes_an_error_that_says_what_it_said() {
        let number = |text: &str| text.parse::<i8>().expect("a number");
        assert_eq!(called(|| number("7")).unwrap(), 7);
        let error = called(|| number("300")).unwrap_err();
        assert!(error.to_string().contains("a number"), "{error}");
        assert!(error.is_panic() && !error.is_retryable());
        let late = async {
            tokio::task::yield_now().await;
            number("-300")
        };
        let error = contained(late).await.unwrap_err();
        assert!(error.to_string().contains("a number"), "{error}");
        assert_eq!(contained(async { number("1") }).await.unwrap(), 1);
    }

    #[tokio::test]
    async fn a_panic_in_a_background_task_is_known_as_one() {
        let task = tokio::task::spawn_blocking(|| assert_eq!(1, 2, "planted"));
        let error = IngestError::from(task.await.unwrap_err());
        assert!(error.is_panic(), "{error}");
    }
}
