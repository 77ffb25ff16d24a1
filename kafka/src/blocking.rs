//! Calls of the Kafka client that wait: made on threads that may wait.

use crate::KafkaFailure;

/// Runs a call that waits for brokers. It has a limit of its own: nothing can stop it from outside.
pub(crate) async fn blocking<T: Send + 'static>(
    step: &'static str,
    call: impl FnOnce() -> Result<T, KafkaFailure> + Send + 'static,
) -> Result<T, KafkaFailure> {
    match tokio::task::spawn_blocking(call).await {
        Ok(outcome) => outcome,
        Err(error) if error.is_panic() => std::panic::resume_unwind(error.into_panic()),
        Err(_cancelled) => Err(KafkaFailure::Ending { step }),
    }
}
