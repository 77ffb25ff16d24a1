//! Why a field of an attached product cannot be read.

use std::error::Error;

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

impl Failure {
    /// The failure that an error came from, if it came from one.
    pub fn behind<'a>(error: &'a (dyn Error + 'static)) -> Option<&'a Self> {
        let mut next = Some(error);
        while let Some(error) = next {
            if let Some(found) = error.downcast_ref() {
                return Some(found);
            }
            next = error.source();
        }
        None
    }
}
