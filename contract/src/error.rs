//! The one error of this crate: a value from outside that does not parse, with what it was and why.

/// A text or number that is not a valid value of its type.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ContractError {
    /// A text that does not name a value of the type.
    #[error("{what} {text:?} is not valid: {reason}")]
    Invalid {
        /// The kind of value, as a person would say it.
        what: &'static str,
        /// The offending text, shortened to 80 characters.
        text: String,
        /// Why, and what would be valid.
        reason: String,
    },
}

impl ContractError {
    /// An error for `text`, cut to 80 characters so that a hostile value cannot flood a log.
    pub fn invalid(what: &'static str, text: &str, reason: impl Into<String>) -> Self {
        Self::Invalid {
            what,
            text: text.chars().take(80).collect(),
            reason: reason.into(),
        }
    }
}
