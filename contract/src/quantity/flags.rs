//! What the codes of a mask mean, as the attributes `flag_values` and `flag_meanings` of CF (1.11, 3.5) say it.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Most codes whose meanings are kept.
pub const MAX_FLAGS: usize = 256;
/// Longest meaning, bytes.
pub const MAX_MEANING_BYTES: usize = 100;
/// Of all meanings of a quantity together, bytes.
const MAX_BYTES: usize = 8 << 10;
/// Whole numbers up to here are exact as stored values.
const MAX_CODE: i32 = 1 << 24;
/// Signs of a meaning besides letters and digits: those that CF has for it, and what is met in files.
const SIGNS: &str = "_-.+@/()&'";

/// A code and its meaning.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Flag {
    /// The stored value.
    pub value: i32,
    /// What it means, one word: letters, digits and some signs.
    pub meaning: String,
}

impl Flag {
    /// Is a text a meaning, and no number?
    pub fn is_meaning(text: &str) -> bool {
        let is_sign = |c: char| c.is_alphanumeric() || SIGNS.contains(c);
        (1..=MAX_MEANING_BYTES).contains(&text.len())
            && text.chars().all(is_sign)
            && text.parse::<f64>().is_err()
    }

    /// The code as values of fields have it.
    pub fn code(&self) -> f32 {
        self.value as f32
    }

    /// Is each code there once with a meaning of its own, within limits?
    ///
    /// # Errors
    /// What of it is not so.
    pub fn check(all: &[Self]) -> Result<(), String> {
        if all.len() > MAX_FLAGS {
            let count = all.len();
            return Err(format!("{count} codes, at most {MAX_FLAGS} are kept"));
        }
        let (mut codes, mut meanings, mut bytes) = (BTreeSet::new(), BTreeSet::new(), 0);
        for Self { value, meaning } in all {
            if !(-MAX_CODE..=MAX_CODE).contains(value) {
                return Err(format!("the code {value} is beyond {MAX_CODE}"));
            }
            if !Self::is_meaning(meaning) {
                let start: String = meaning.chars().take(20).collect();
                return Err(format!(
                    "{start:?} is no meaning: letters, digits and {SIGNS}, 1 to {MAX_MEANING_BYTES} bytes, no number"
                ));
            }
            if !codes.insert(value) {
                return Err(format!("the code {value} has two meanings"));
            }
            if !meanings.insert(meaning) {
                return Err(format!("two codes mean {meaning:?}"));
            }
            bytes += meaning.len();
        }
        if bytes > MAX_BYTES {
            return Err(format!(
                "meanings of {bytes} bytes, at most {MAX_BYTES} are kept"
            ));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flags(all: &[(i32, &str)]) -> Vec<Flag> {
        let flag = |(value, meaning): &(i32, &str)| Flag {
            value: *value,
            meaning: (*meaning).to_owned(),
        };
        all.iter().map(flag).collect()
    }

    #[test]
    fn a_code_has_one_meaning_and_a_meaning_one_code() {
        let good = flags(&[(-1, "no_data"), (0, "sea"), (12, "Île-de-France_(coast)")]);
        assert_eq!(Flag::check(&good), Ok(()));
        assert_eq!(Flag::check(&[]), Ok(()));
        for (bad, wanted) in [
            (flags(&[(1, "a"), (1, "b")]), "two meanings"),
            (flags(&[(1, "a"), (2, "a")]), "two codes mean"),
            (flags(&[(i32::MAX, "a")]), "beyond"),
        ] {
            let refused = Flag::check(&bad).unwrap_err();
            assert!(refused.contains(wanted), "{refused}");
        }
    }

    #[test]
    fn hostile_meanings_are_none() {
        let long = "x".repeat(MAX_MEANING_BYTES + 1);
        for bad in [
            "",
            "a b",
            "a\n",
            "\u{1b}[31m",
            "\u{202e}a",
            "a:b",
            "a,b",
            "5",
            "-1.5",
            "nan",
            "inf",
            "1e9",
            "<b>",
            "\"a\"",
            &long,
        ] {
            assert!(!Flag::is_meaning(bad), "{bad:?}");
            let refused = Flag::check(&flags(&[(1, bad)])).unwrap_err();
            assert!(refused.contains("no meaning") && refused.len() < 200);
            assert!(!refused.chars().any(char::is_control), "{refused:?}");
        }
        let many: Vec<_> = (0..=256).map(|at| (at, format!("m{at}"))).collect();
        let many: Vec<_> = many.iter().map(|(at, own)| (*at, own.as_str())).collect();
        assert!(
            Flag::check(&flags(&many))
                .unwrap_err()
                .contains("257 codes")
        );
        let longest: Vec<_> = (0..100).map(|at| format!("{at:x>100}")).collect();
        let longest = (0..).zip(&longest).map(|(at, own)| (at, own.as_str()));
        let refused = Flag::check(&flags(&longest.collect::<Vec<_>>())).unwrap_err();
        assert!(refused.contains("10000 bytes"), "{refused}");
    }
}
