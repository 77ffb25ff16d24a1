//! Why a file was refused: a value, not an error of the program; one line that says what to do.

use std::fmt::{Display, Formatter};

use contract::event::RejectReason;
use serde::{Deserialize, Serialize};

/// Longest object or detail, characters: both may quote a hostile file.
const MAX_TEXT_CHARS: usize = 300;

/// A refusal of a file: class, object inside the file, and one line with what is wrong and what to do.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Rejection {
    /// Class, for counting.
    pub reason: RejectReason,
    /// What in the file is meant: a variable, an attribute, or `file`.
    pub object: String,
    /// What is wrong, and what to do.
    pub detail: String,
}

impl Rejection {
    /// A refusal; control characters are replaced and long texts are cut, since both may come from the file.
    pub fn new(reason: RejectReason, object: impl AsRef<str>, detail: impl AsRef<str>) -> Self {
        Self {
            reason,
            object: one_line(object.as_ref()),
            detail: one_line(detail.as_ref()),
        }
    }

    /// The same refusal after it crossed a process border: its texts are cleaned once more.
    pub(crate) fn cleaned(self) -> Self {
        Self::new(self.reason, self.object, self.detail)
    }
}

impl Display for Rejection {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: {}", self.object, self.detail)
    }
}

fn one_line(text: &str) -> String {
    text.chars()
        .take(MAX_TEXT_CHARS)
        .map(|c| if c.is_control() { ' ' } else { c })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hostile_name_stays_one_short_line() {
        let rejection = Rejection::new(RejectReason::Corrupt, "a\nb\u{1b}[2J", "x".repeat(10_000));
        let line = rejection.to_string();
        assert!(!line.chars().any(char::is_control));
        assert!(line.len() < 400);
    }
}
