//! Work that takes long, on a thread that nobody waits for.

use crate::StorageError;

/// Does work there; a panic in it goes on here.
pub(crate) async fn off_thread<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, StorageError> + Send + 'static,
) -> Result<T, StorageError> {
    match tokio::task::spawn_blocking(work).await {
        Ok(done) => done,
        Err(ended) => match ended.try_into_panic() {
            Ok(panic) => std::panic::resume_unwind(panic),
            Err(cancelled) => Err(StorageError::Object {
                key: "a thread".to_owned(),
                source: cancelled.into(),
            }),
        },
    }
}
