//! Flags of data sets to the primary flags: each scheme says which of its codes means what.
//!
//! Primary scheme: IOC Manuals and Guides 54, volume 3 (2013): 1 good, 2 not evaluated or unknown, 3 questionable,
//! 4 bad; 9 missing, which is no observation.

use contract::observation::Quality;

use crate::inspect::file::description::Variable;

/// What a flag says: a quality, or that there is no value.
pub(super) type Verdict = Option<Quality>;

/// A scheme of flags.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Scheme {
    /// The tropical moored buoy array's: 1 highest, 2 default, 3 adjusted, 4 lower, 5 failed, 8 and 9 off its place.
    TropicalArray,
    /// WOCE: 2 good, 3 questionable, 4 bad, 5 and 9 missing.
    Woce,
    /// A variable that says itself what its values mean.
    Stated(Vec<(f64, Verdict)>),
    /// The primary one.
    Primary,
}

impl Scheme {
    /// The scheme of a CF status-flag variable, from `flag_values` and `flag_meanings`.
    pub(super) fn of(variable: &Variable) -> Self {
        let values = variable.attributes.numbers("flag_values");
        let meanings = variable.attributes.text("flag_meanings");
        match (values, meanings) {
            (Some(values), Some(meanings)) => {
                let words = meanings.split_whitespace();
                Self::Stated(values.into_iter().zip(words.map(meaning)).collect())
            }
            _ => Self::Primary,
        }
    }

    /// What a flag says; an unknown one says nothing, so the value counts as not evaluated.
    #[expect(clippy::float_cmp, reason = "flags are whole numbers")]
    pub(super) fn verdict(&self, flag: f64) -> Verdict {
        let code = if flag.is_finite() {
            flag.round() as i64
        } else {
            -1
        };
        match (self, code) {
            // Its default means that the calibration after the recovery is not known.
            (Self::TropicalArray | Self::Primary, 1) | (Self::Woce, 2) => Some(Quality::Good),
            (Self::TropicalArray, 3 | 4 | 8 | 9) | (Self::Woce | Self::Primary, 3) => {
                Some(Quality::Questionable)
            }
            (Self::TropicalArray, 5) | (Self::Woce | Self::Primary, 4) => Some(Quality::Bad),
            (Self::TropicalArray, 0) | (Self::Woce, 5 | 9) | (Self::Primary, 9) => None,
            (Self::Stated(known), _) => known
                .iter()
                .find(|(value, _)| *value == flag)
                .map_or(Some(Quality::NotEvaluated), |(_, verdict)| *verdict),
            _ => Some(Quality::NotEvaluated),
        }
    }
}

/// The worse of two verdicts; no value is the worst.
pub(super) fn worse(a: Verdict, b: Verdict) -> Verdict {
    a.zip(b).map(|(a, b)| a.max(b))
}

/// What one word of `flag_meanings` says.
fn meaning(word: &str) -> Verdict {
    let word = word.to_ascii_lowercase();
    let has = |parts: &[&str]| parts.iter().any(|part| word.contains(part));
    if has(&["missing", "no_data", "nodata"]) {
        None
    } else if has(&[
        "not_eval",
        "not_test",
        "unknown",
        "no_qc",
        "not_used",
        "unevaluated",
    ]) {
        Some(Quality::NotEvaluated)
    } else if has(&[
        "suspect",
        "question",
        "probably_bad",
        "doubt",
        "of_high_interest",
    ]) {
        Some(Quality::Questionable)
    } else if has(&["bad", "fail", "erroneous"]) {
        Some(Quality::Bad)
    } else if has(&["good", "pass", "correct"]) {
        Some(Quality::Good)
    } else {
        Some(Quality::NotEvaluated)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Quality::{Bad, Good, NotEvaluated, Questionable};

    #[test]
    fn codes_mean_what_their_scheme_says() {
        let verdicts =
            |scheme: Scheme| [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 9.0].map(|f| scheme.verdict(f));
        assert_eq!(
            verdicts(Scheme::TropicalArray),
            [
                None,
                Some(Good),
                Some(NotEvaluated),
                Some(Questionable),
                Some(Questionable),
                Some(Bad),
                Some(Questionable)
            ]
        );
        assert_eq!(
            verdicts(Scheme::Woce),
            [
                Some(NotEvaluated),
                Some(NotEvaluated),
                Some(Good),
                Some(Questionable),
                Some(Bad),
                None,
                None
            ]
        );
        assert_eq!(Scheme::Primary.verdict(f64::NAN), Some(NotEvaluated));
    }

    #[test]
    fn words_mean_what_they_say() {
        let words = [
            "good_data",
            "probably_bad_data",
            "bad_data",
            "not_evaluated",
            "missing_value",
            "PASS",
        ];
        let found = words.map(meaning);
        assert_eq!(
            found,
            [
                Some(Good),
                Some(Questionable),
                Some(Bad),
                Some(NotEvaluated),
                None,
                Some(Good)
            ]
        );
    }

    #[test]
    fn of_two_flags_the_worse_counts() {
        assert_eq!(
            worse(Some(Quality::Good), Some(Quality::Bad)),
            Some(Quality::Bad)
        );
        assert_eq!(worse(Some(Quality::Good), None), None);
    }
}
