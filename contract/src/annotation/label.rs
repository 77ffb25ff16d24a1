//! Texts that are written into pictures: one line, without anything that is no sign.

use serde::{Deserialize, Serialize};

use crate::ContractError;

/// Most characters of a label: a long citation.
pub const MAX_LABEL_CHARS: usize = 240;

/// One line of text: 1 to [`MAX_LABEL_CHARS`] characters, none of them a control or a mark of writing direction. It may
/// hold anything else; whoever writes it into another format escapes it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Label(String);

impl Label {
    /// A text made to fit: runs of spaces and controls become one space, and what is too long ends in an ellipsis. None
    /// where nothing is left.
    pub fn cut(text: &str) -> Option<Self> {
        let mut line = String::new();
        let words = text.split(|sign: char| sign.is_whitespace() || is_unseen(sign));
        let mut count = 0;
        for word in words.filter(|word| !word.is_empty()) {
            if count > 0 {
                line.push(' ');
                count += 1;
            }
            for sign in word.chars() {
                if count >= MAX_LABEL_CHARS {
                    line.truncate(line.char_indices().nth(MAX_LABEL_CHARS - 1)?.0);
                    line.push('…');
                    return Some(Self(line));
                }
                line.push(sign);
                count += 1;
            }
        }
        (!line.is_empty()).then_some(Self(line))
    }

    /// The text.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

/// Nothing to see, or something that turns the text after it round.
fn is_unseen(sign: char) -> bool {
    sign.is_control()
        || matches!(sign, '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}')
}

impl TryFrom<String> for Label {
    type Error = ContractError;

    fn try_from(text: String) -> Result<Self, Self::Error> {
        if Self::cut(&text).is_some_and(|label| label.0 == text) {
            return Ok(Self(text));
        }
        let start: String = text.chars().take(40).collect();
        let reason = format!("one line of 1 to {MAX_LABEL_CHARS} characters");
        Err(ContractError::invalid("label", &start, reason))
    }
}

impl From<Label> for String {
    fn from(label: Label) -> Self {
        label.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_made_one_short_line() {
        let cut = |text: &str| Label::cut(text).map(String::from);
        assert_eq!(cut(" a\tb\r\n c ").as_deref(), Some("a b c"));
        assert_eq!(cut("\u{0}\u{1b}[31m").as_deref(), Some("[31m"));
        assert_eq!(cut("left\u{202e}thgir").as_deref(), Some("left thgir"));
        assert_eq!(cut("\u{200b} \n"), None);
        for long in [
            "é".repeat(10_000),
            "word ".repeat(10_000),
            "é".repeat(MAX_LABEL_CHARS + 1),
        ] {
            let label = cut(&long).unwrap();
            assert!(label.ends_with('…'), "{label}");
            assert!(label.chars().count() <= MAX_LABEL_CHARS, "{label}");
        }
        let exact = "é".repeat(MAX_LABEL_CHARS);
        assert_eq!(cut(&exact), Some(exact));
    }

    #[test]
    fn what_is_read_is_a_label_already() {
        let read = |text: &str| serde_json::from_str::<Label>(&serde_json::json!(text).to_string());
        assert_eq!(read("<b> & \"c\"").unwrap().as_str(), "<b> & \"c\"");
        for bad in [
            "",
            " a",
            "a\nb",
            "a\u{202e}",
            &"x".repeat(MAX_LABEL_CHARS + 1),
        ] {
            assert!(read(bad).is_err(), "{bad:?}");
        }
        let cut = Label::cut(&"word ".repeat(100)).unwrap();
        assert_eq!(read(cut.as_str()).unwrap(), cut);
    }
}
