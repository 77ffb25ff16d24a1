//! Failures of the query engine, by whether the same query may succeed later.
//!
//! What went wrong on a scheduler or an executor arrives as text: Ballista sends the debug form of its errors.

use ballista_core::error::BallistaError;
use datafusion::error::DataFusionError;
use storage::attached;

/// Whether waiting helps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Failure {
    /// A process, a connection, memory or the store was lost: the same query may succeed later.
    Passing,
    /// The same query will fail again.
    Lasting,
}

/// Parts of texts that speak of what passes.
const PASSING: &[&str] = &[
    // The scheduler went away, or is not there yet.
    "TonicError(",
    "Tonic error",
    "transport error",
    "GrpcConnectionError",
    "Unavailable",
    "service is currently unavailable",
    "h2 protocol error",
    "error reading a body from connection",
    "broken pipe",
    "connection reset",
    "Connection refused",
    "operation timed out",
    "DeadlineExceeded",
    "Timeout expired",
    "Stream closed without job completing",
    // An executor did.
    "all executors were lost",
    "FetchFailed",
    "Shuffle fetch partition error",
    "Task cancelled",
    "Cancelled",
    "not found in queued jobs",
    // The store or a disk did.
    "IoError",
    "IO error",
    "ObjectStore(Generic",
    // Memory was short.
    "ResourcesExhausted",
    "Resources exhausted",
];

/// Parts of texts that speak of what stays, whatever else they say.
const LASTING: &[&str] = &["protocol version mismatch", "FailedPrecondition"];

pub(crate) fn of(error: &DataFusionError) -> Failure {
    match error.find_root() {
        DataFusionError::IoError(_) | DataFusionError::ResourcesExhausted(_) => Failure::Passing,
        DataFusionError::ObjectStore(e) => of_store(e),
        DataFusionError::Execution(text) => of_text(text),
        DataFusionError::External(e) => match e.downcast_ref::<BallistaError>() {
            Some(ballista) => of_ballista(ballista),
            None => of_text(&e.to_string()),
        },
        _ => Failure::Lasting,
    }
}

pub(crate) fn of_ballista(error: &BallistaError) -> Failure {
    match error {
        BallistaError::IoError(_)
        | BallistaError::TonicError(_)
        | BallistaError::GrpcConnectionError(_)
        | BallistaError::FetchFailed(..)
        | BallistaError::Cancelled
        | BallistaError::TokioError(_) => Failure::Passing,
        BallistaError::DataFusionError(e) => of(e),
        other => of_text(&format!("{other:?}")),
    }
}

fn of_store(error: &object_store::Error) -> Failure {
    if may_pass(error) {
        Failure::Passing
    } else {
        Failure::Lasting
    }
}

/// May the same read of an object store succeed later? What is wrong with a store of others stays so.
pub(crate) fn may_pass(error: &object_store::Error) -> bool {
    match error {
        object_store::Error::Generic { .. } | object_store::Error::JoinError { .. } => {
            let of_others = attached::Failure::behind(error);
            of_others.is_none_or(attached::Failure::is_retryable)
        }
        _ => false,
    }
}

fn of_text(text: &str) -> Failure {
    let says = |parts: &[&str]| parts.iter().any(|part| text.contains(part));
    if says(PASSING) && !says(LASTING) {
        Failure::Passing
    } else {
        Failure::Lasting
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn execution(text: &str) -> Failure {
        of(&DataFusionError::Execution(text.to_owned()))
    }

    #[test]
    fn a_lost_scheduler_executor_or_store_passes() {
        for text in [
            "TonicError(tonic::transport::Error(Transport, ConnectError(ConnectError(\"tcp connect error\"))))",
            "status: 'The service is currently unavailable', self: \"tcp connect error\"",
            "Stream closed without job completing",
            "Job 1 failed: Job failed due to stage 2 failed: Stage 2 has failed 4 times, most recent failure reason: {\"FetchPartitionError\"}, FetchFailed",
            "Job 1 failed: all executors were lost and no executor re-registered within 60s",
            "Job 1 failed: Task failed due to IO error: IoError(Os { code: 28, kind: StorageFull })",
        ] {
            assert_eq!(execution(text), Failure::Passing, "{text}");
        }
    }

    #[test]
    fn a_query_that_cannot_succeed_is_not_tried_again() {
        for text in [
            "Job 1 failed: Task failed due to runtime execution error: DataFusionError(Execution(\"region_sums, chunk 3: a cell's share is inf\"))",
            "Job 1 failed: ObjectStore(NotFound { path: \"frames/a\" })",
            "code: FailedPrecondition, protocol version mismatch: scheduler=1, executor=2",
        ] {
            assert_eq!(execution(text), Failure::Lasting, "{text}");
        }
    }
}
