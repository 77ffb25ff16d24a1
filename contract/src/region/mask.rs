//! The cells of a mask as somebody asks for them: `MASK:CODE`, or `MASK:MEANING` where its file says what codes mean.

use std::fmt::{Display, Formatter};

use crate::ContractError;
use crate::manifest::Manifest;
use crate::quantity::Flag;

/// Meanings that are named where the one asked for is not there.
const NAMED_MEANINGS: usize = 20;

/// A code of a mask.
#[derive(Debug, Clone, PartialEq)]
pub enum MaskCode {
    /// By its number.
    Number(f32),
    /// By what it means.
    Meaning(String),
}

impl MaskCode {
    /// The mask, by whatever it is called, and the code of a text; none if it cannot be that.
    pub fn split(text: &str) -> Option<(&str, Self)> {
        let (mask, code) = text.split_once(':')?;
        let code = code.trim();
        match code.parse::<f32>() {
            Ok(number) => number.is_finite().then_some((mask, Self::Number(number))),
            Err(_no_number) => {
                Flag::is_meaning(code).then(|| (mask, Self::Meaning(code.to_owned())))
            }
        }
    }

    /// Its number in a version of a mask.
    ///
    /// # Errors
    /// No code of it has this meaning.
    pub fn number(&self, mask: &Manifest) -> Result<f32, ContractError> {
        let meaning = match self {
            Self::Number(number) => return Ok(*number),
            Self::Meaning(meaning) => meaning,
        };
        let flags = mask.quantity.flags();
        if let Some(flag) = flags.iter().find(|flag| flag.meaning == *meaning) {
            return Ok(flag.code());
        }
        let known = flags.iter().take(NAMED_MEANINGS);
        let known: Vec<&str> = known.map(|flag| flag.meaning.as_str()).collect();
        let reason = match flags.len().saturating_sub(known.len()) {
            _ if known.is_empty() => {
                "the mask does not say what its codes mean: give a number".to_owned()
            }
            0 => format!("no code means this; there are {}", known.join(", ")),
            more => format!(
                "no code means this; there are {} and {more} more",
                known.join(", ")
            ),
        };
        let asked = format!("{}:{meaning}", mask.product);
        Err(ContractError::invalid("region", &asked, reason))
    }
}

impl Display for MaskCode {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Number(number) => number.fmt(f),
            Self::Meaning(meaning) => f.write_str(meaning),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_code_or_a_meaning_follows_the_name_of_a_mask() {
        let number = |number| Some(("oceans", MaskCode::Number(number)));
        let meaning = |text: &str| Some(("oceans", MaskCode::Meaning(text.to_owned())));
        for (text, wanted) in [
            ("oceans:3", number(3.0)),
            ("oceans:12345", number(12345.0)),
            ("oceans: 3", number(3.0)),
            ("oceans:-1.5", number(-1.5)),
            ("oceans:north_atlantic", meaning("north_atlantic")),
            ("oceans:2nd", meaning("2nd")),
            ("oceans", None),
            ("oceans:", None),
            ("oceans:nan", None),
            ("oceans:a b", None),
            ("oceans:1:2", None),
            ("oceans:\u{202e}a", None),
            ("http://a:1", None),
        ] {
            assert_eq!(MaskCode::split(text), wanted, "{text}");
        }
        // No product is called like this.
        let (mask, _code) = MaskCode::split("{\"a\":1").unwrap();
        assert!(mask.parse::<crate::product::ProductId>().is_err());
    }
}
