//! Why something of a store of others cannot be read.

/// What is not read, and why; nothing in it is secret.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{place}: {reason}")]
pub struct ForeignError {
    /// The store and, as far as it is known, array and chunk.
    pub place: String,
    /// What is wrong and, where something can be done, what.
    pub reason: String,
    /// May the same succeed later?
    pub is_retryable: bool,
}

impl ForeignError {
    /// What stays as it is.
    pub fn refused(place: impl Into<String>, reason: impl Into<String>) -> Self {
        Self {
            place: place.into(),
            reason: reason.into(),
            is_retryable: false,
        }
    }

    /// What may pass.
    pub fn away(place: impl Into<String>, reason: impl Into<String>) -> Self {
        Self {
            place: place.into(),
            reason: reason.into(),
            is_retryable: true,
        }
    }
}
