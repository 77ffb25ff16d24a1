//! Work that several wait for in; its result out, or its panic as an error that all of them are told.
//!
//! Let through, a panic would be told to the one of them who drives the work: nobody would wake the others.

use std::panic::AssertUnwindSafe;

use futures::FutureExt as _;
use prometheus::IntCounter;

use crate::error::ServerError;

/// Runs work to its end or its panic, which is counted. What it holds is dropped, and nothing that it changed may be looked
/// at again but what is whole after each single change.
pub(crate) async fn caught<T>(
    panics: &IntCounter,
    work: impl Future<Output = Result<T, ServerError>>,
) -> Result<T, ServerError> {
    let ended = AssertUnwindSafe(work).catch_unwind().await;
    ended.unwrap_or_else(|panic| {
        panics.inc();
        Err(ServerError::panicked("what several wait for", &*panic))
    })
}
