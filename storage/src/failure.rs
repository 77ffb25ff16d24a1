//! Why a field of an attached product cannot be read.

/// Why a field of an attached product cannot be read.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{place}: {reason}")]
pub struct Failure {
    /// Store, array and, as far as it is known, step or chunk.
    pub place: String,
    /// What is wrong, and what to do.
    pub reason: String,
    /// May the same succeed later?
    pub is_retryable: bool,
}
