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
    /// Where that lies.
    pub cause: Cause,
}

/// Where it lies that something of a store of others cannot be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cause {
    /// In what is there: it is not what can be read rightly, or not what was attached.
    Content,
    /// In who asks: the store does not give it with these credentials, or not from there.
    Access,
    /// In what may pass: no answer, or too many requests.
    Away,
}

impl Cause {
    /// May the same succeed later, with nothing changed?
    pub fn is_retryable(self) -> bool {
        match self {
            Self::Away => true,
            Self::Content | Self::Access => false,
        }
    }
}

impl Failure {
    /// May the same succeed later?
    pub fn is_retryable(&self) -> bool {
        self.cause.is_retryable()
    }

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
