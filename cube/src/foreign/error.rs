//! Why something of a store of others cannot be read.

use storage::attached::Cause;

/// What is not read, and why; nothing in it is secret.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{place}: {reason}")]
pub struct ForeignError {
    /// The store and, as far as it is known, array and chunk.
    pub place: String,
    /// What is wrong and, where something can be done, what.
    pub reason: String,
    /// Where that lies.
    pub cause: Cause,
    /// Is it that something is not there: a chunk, a bucket, or a store at its address?
    pub is_absent: bool,
}

impl ForeignError {
    /// What is there and cannot be read rightly.
    pub fn refused(place: impl Into<String>, reason: impl Into<String>) -> Self {
        Self {
            place: place.into(),
            reason: reason.into(),
            cause: Cause::Content,
            is_absent: false,
        }
    }

    /// What is not there.
    pub fn absent(place: impl Into<String>, reason: impl Into<String>) -> Self {
        Self {
            is_absent: true,
            ..Self::refused(place, reason)
        }
    }

    /// What is not given to whoever asks as we do.
    pub fn denied(place: impl Into<String>, reason: impl Into<String>) -> Self {
        Self {
            cause: Cause::Access,
            ..Self::refused(place, reason)
        }
    }

    /// What may pass.
    pub fn away(place: impl Into<String>, reason: impl Into<String>) -> Self {
        Self {
            cause: Cause::Away,
            ..Self::refused(place, reason)
        }
    }

    /// May the same succeed later?
    pub fn is_retryable(&self) -> bool {
        self.cause.is_retryable()
    }

    /// The same of what was to be read of it: an array, say, or a chunk.
    pub(super) fn of(self, place: impl Into<String>) -> Self {
        Self {
            reason: self.to_string(),
            place: place.into(),
            cause: self.cause,
            is_absent: self.is_absent,
        }
    }
}
