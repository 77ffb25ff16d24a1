//! Flags of data sets to the primary flags: each scheme says which of its codes means what.
//!
//! Primary scheme: IOC Manuals and Guides 54, volume 3 (2013): 1 good, 2 not evaluated or unknown, 3 questionable,
//! 4 bad; 9 missing, which is no observation.

use contract::observation::Quality;

use crate::inspect::file::description::{Kind, Variable};
use crate::plan::cf::flag::{self, Flag};

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
    /// One that says what its bits mean; what is set may be of several meanings.
    Bits(Vec<(Flag, Verdict)>),
    /// The primary one.
    Primary,
}

impl Scheme {
    /// The scheme of a CF status-flag variable, from `flag_values`, `flag_masks` and `flag_meanings`, or its name. Bits without
    /// meanings say nothing.
    pub(super) fn of(variable: &Variable) -> Self {
        if variable.attributes.0.contains_key("flag_masks") {
            let flags = flag::of(variable).unwrap_or_default();
            let said = |state: Flag| {
                let verdict = meaning(&state.name);
                (state, verdict)
            };
            return Self::Bits(flags.into_iter().map(said).collect());
        }
        let values = values(variable);
        let meanings = variable.attributes.text("flag_meanings");
        match (values, meanings) {
            (Some(values), Some(meanings)) => {
                let verdicts = verdicts(meanings, values.len());
                Self::Stated(values.into_iter().zip(verdicts).collect())
            }
            _ if is_of_woce(&variable.name) => Self::Woce,
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
            (Self::Bits(known), _) if flag.is_finite() => known
                .iter()
                .filter(|(state, _)| state.holds(flag))
                .map(|(_, verdict)| *verdict)
                .reduce(worse)
                .unwrap_or(Some(Quality::NotEvaluated)),
            _ => Some(Quality::NotEvaluated),
        }
    }
}

/// Does a variable that another one names as ancillary speak of its quality? Errors, counts of samples, instruments and other
/// numbers are ancillary too.
pub(super) fn is_flag(variable: &Variable) -> bool {
    let has = |name: &str| variable.attributes.0.contains_key(name);
    let is_stated = has("flag_values") || has("flag_masks");
    let standard_name = variable.attributes.text("standard_name");
    if let Some(name) = standard_name.filter(|name| !name.is_empty()) {
        return is_flag_name(name) || name.ends_with("quality_flag") && is_stated;
    }
    is_stated || is_called_flag(&variable.name) || is_nameless_flag(variable)
}

/// Is a standard name one of flags of a scheme? Those of single tests mean what they say themselves alone.
pub(super) fn is_flag_name(standard_name: &str) -> bool {
    standard_name.ends_with("status_flag")
        || matches!(standard_name, "quality_flag" | "aggregate_quality_flag")
}

fn is_called_flag(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    let ends = ["_qc", "_flag", "_flags", "_qf"];
    name.starts_with("qc_") || ends.iter().any(|end| name.ends_with(end))
}

/// Is a variable without a standard name a flag, by what it holds: codes of samples, in whole numbers or letters, whose name speaks
/// of nothing else?
fn is_nameless_flag(variable: &Variable) -> bool {
    /// Parts of names of other things; levels of quality go up with it, where flags go down, and count if their meanings are given.
    const OTHERS: [&str; 18] = [
        "calib",
        "confidence",
        "count",
        "deviation",
        "error",
        "instrument",
        "level",
        "method",
        "number",
        "percent",
        "platform",
        "sample",
        "sensor",
        "serial",
        "spread",
        "station",
        "uncertain",
        "variance",
    ];
    /// Words that are short of them.
    const SHORT: [&str; 11] = [
        "err", "id", "n", "nobs", "num", "obs", "sd", "se", "std", "stddev", "stdev",
    ];
    let is_whole = match variable.kind {
        Kind::Integer(_) | Kind::Unsigned(_) | Kind::Text(1) => true,
        Kind::Float(_) | Kind::Text(_) | Kind::Other => false,
    };
    let packed = ["scale_factor", "add_offset"];
    let is_packed = (packed.iter()).any(|name| variable.attributes.0.contains_key(*name));
    let unit = variable.attributes.text("units").unwrap_or_default();
    let name = variable.name.to_ascii_lowercase();
    let is_short =
        |word: &str| SHORT.contains(&word.trim_end_matches(|c: char| c.is_ascii_digit()));
    let is_other = OTHERS.iter().any(|other| name.contains(other))
        || name.split(['_', '-', '.']).any(is_short);
    is_whole
        && !is_packed
        && !variable.dimensions.is_empty()
        && matches!(unit, "" | "1")
        && !is_other
}

/// Does a variable say by its name that its flags are those of WOCE?
fn is_of_woce(name: &str) -> bool {
    name.to_ascii_lowercase()
        .split('_')
        .any(|word| word == "woce")
}

/// The worse of two verdicts; no value is the worst.
pub(super) fn worse(a: Verdict, b: Verdict) -> Verdict {
    a.zip(b).map(|(a, b)| a.max(b))
}

/// What `flag_values` holds: numbers, or of flags that are letters the digits that these are, however they are written (`0, 1, 4`, `014`, or
/// the codes of the letters). None if there are none.
fn values(variable: &Variable) -> Option<Vec<f64>> {
    let zero = f64::from(b'0');
    let is_of_letters = variable.kind == Kind::Text(1);
    if let Some(numbers) = variable.attributes.numbers("flag_values") {
        let digit = |number: f64| {
            let is_letter = is_of_letters && (zero..zero + 10.0).contains(&number);
            if is_letter { number - zero } else { number }
        };
        return Some(numbers.into_iter().map(digit).collect());
    }
    let text = variable.attributes.text("flag_values")?;
    let letters = text.chars().filter(|c| c.is_alphanumeric());
    let digits = letters.map(|c| c.to_digit(10).map_or(f64::NAN, f64::from));
    Some(digits.collect())
}

/// What `flag_meanings` say of each of so many flags: a word a flag, or a phrase between commas or semicolons. Nothing if there are
/// more or fewer: with those of its neighbours what is bad would be good.
fn verdicts(meanings: &str, count: usize) -> Vec<Verdict> {
    let words: Vec<Verdict> = meanings.split_whitespace().map(meaning).collect();
    if words.len() == count {
        return words;
    }
    let phrases = meanings.trim_end_matches([',', ';']).split([',', ';']);
    let phrase = |text: &str| meaning(&text.trim().replace(' ', "_"));
    let phrases: Vec<Verdict> = phrases.map(phrase).collect();
    if phrases.len() == count {
        phrases
    } else {
        vec![]
    }
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
    use crate::inspect::file::description::{AttributeValue, Dimension};
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

    fn variable(name: &str, attributes: &[(&str, AttributeValue)]) -> Variable {
        let own = |(name, value): &(&str, AttributeValue)| ((*name).to_owned(), value.clone());
        Variable {
            name: name.to_owned(),
            dimensions: vec![Dimension {
                name: Some("time".to_owned()),
                len: 3,
            }],
            kind: Kind::Integer(1),
            attributes: attributes.iter().map(own).collect(),
        }
    }

    #[test]
    fn bits_mean_what_is_said_of_each_and_the_worst_that_is_set_counts() {
        let words = AttributeValue::Text("range_test_failed spike_suspect pump_on".to_owned());
        let kind = Kind::Integer(1);
        let bits = [1.0_f64, 2.0, 4.0].map(Into::into).to_vec();
        let masks = AttributeValue::Numbers { kind, bits };
        let scheme = Scheme::of(&variable(
            "state",
            &[("flag_masks", masks.clone()), ("flag_meanings", words)],
        ));
        let verdicts = [0.0, 1.0, 2.0, 3.0, 4.0, f64::NAN].map(|bits| scheme.verdict(bits));
        assert_eq!(
            verdicts,
            [
                Some(NotEvaluated),
                Some(Bad),
                Some(Questionable),
                Some(Bad),
                Some(NotEvaluated),
                Some(NotEvaluated)
            ]
        );
        // Nothing says what these mean: 4 is no "bad".
        let unsaid = Scheme::of(&variable("state", &[("flag_masks", masks)]));
        assert_eq!(unsaid.verdict(4.0), Some(NotEvaluated));
    }

    #[test]
    fn meanings_that_are_no_word_a_flag_are_not_those_of_its_neighbours() {
        let verdicts = |meanings: &str| {
            let kind = Kind::Integer(1);
            let bits = [0.0_f64, 1.0, 4.0].map(Into::into).to_vec();
            let values = AttributeValue::Numbers { kind, bits };
            let meanings = AttributeValue::Text(meanings.to_owned());
            let told = [("flag_values", values), ("flag_meanings", meanings)];
            let scheme = Scheme::of(&variable("temp_qc", &told));
            [0.0, 1.0, 4.0].map(|flag| scheme.verdict(flag))
        };
        let told = [Some(NotEvaluated), Some(Good), Some(Bad)];
        assert_eq!(verdicts("no_qc good_data bad_data"), told);
        assert_eq!(verdicts("no QC, good data, bad data"), told);
        // By its place the third word, "good", would be of 4.
        assert_eq!(
            verdicts("no QC good data bad data"),
            [Some(NotEvaluated); 3]
        );
        assert_eq!(verdicts("good bad"), [Some(NotEvaluated); 3]);
    }

    #[test]
    fn flags_that_are_letters_mean_what_is_said_of_them() {
        let meanings = || AttributeValue::Text("good bad unknown".to_owned());
        let verdicts = |values: AttributeValue| {
            let told = [("flag_values", values), ("flag_meanings", meanings())];
            let scheme = Scheme::of(&Variable {
                kind: Kind::Text(1),
                ..variable("temp_qc", &told)
            });
            // By the primary scheme 4 is bad, and 0 and 1 are not.
            [4.0, 1.0, 0.0].map(|flag| scheme.verdict(flag))
        };
        let told = [Some(Good), Some(Bad), Some(NotEvaluated)];
        for text in ["410", "4, 1, 0", "4 1 0", "'4', '1', '0'"] {
            let text = AttributeValue::Text(text.to_owned());
            assert_eq!(verdicts(text.clone()), told, "{text:?}");
        }
        let kind = Kind::Integer(1);
        let bits = [52.0_f64, 49.0, 48.0].map(Into::into).to_vec();
        assert_eq!(verdicts(AttributeValue::Numbers { kind, bits }), told);
        let text = AttributeValue::Text("41".to_owned());
        assert_eq!(verdicts(text), [Some(NotEvaluated); 3]);
    }
    #[test]
    fn errors_and_counts_are_no_flags() {
        let named = |name: &str| {
            let text = AttributeValue::Text(name.to_owned());
            variable("beside", &[("standard_name", text)])
        };
        assert!(is_flag(&named("sea_water_temperature status_flag")));
        assert!(is_flag(&named("aggregate_quality_flag")));
        assert!(!is_flag(&named("sea_water_temperature standard_error")));
        let stated = || {
            let kind = Kind::Integer(1);
            let bits = vec![1.0_f64.into()];
            ("flag_values", AttributeValue::Numbers { kind, bits })
        };
        assert!(is_flag(&variable("state", &[stated()])));
        for name in [
            "TEMP_QC",
            "temp_quality_control",
            "temp_quality",
            "temp_flags",
            "TEMP_WOCE",
        ] {
            assert!(is_flag(&variable(name, &[])), "{name}");
        }
        for name in [
            "temp_uncertainty",
            "temp_count",
            "temp_std",
            "n_obs",
            "number_of_samples",
            "instrument1",
            "sst_quality_level",
        ] {
            assert!(!is_flag(&variable(name, &[])), "{name}");
        }
        // Levels of quality say themselves what is good.
        assert!(is_flag(&variable("sst_quality_level", &[stated()])));
        let of_a_test = || AttributeValue::Text("spike_test_quality_flag".to_owned());
        let name = ("standard_name", of_a_test());
        assert!(is_flag(&variable("beside", &[name, stated()])));
        assert!(!is_flag(&variable(
            "beside",
            &[("standard_name", of_a_test())]
        )));
    }

    #[test]
    fn numbers_with_units_or_fractions_and_lone_ones_are_no_flags() {
        let plain = || variable("temp_quality", &[]);
        let unit = |unit: &str| {
            let text = AttributeValue::Text(unit.to_owned());
            variable("temp_quality", &[("units", text)])
        };
        assert!(is_flag(&unit("1")) && !is_flag(&unit("%")));
        assert!(!is_flag(&Variable {
            kind: Kind::Float(4),
            ..plain()
        }));
        assert!(!is_flag(&Variable {
            dimensions: vec![],
            ..plain()
        }));
        assert!(is_flag(&Variable {
            kind: Kind::Text(1),
            ..plain()
        }));
    }

    #[test]
    fn flags_that_are_called_those_of_woce_are_of_its_scheme() {
        assert_eq!(Scheme::of(&variable("TEMP_WOCE", &[])), Scheme::Woce);
        assert_eq!(Scheme::of(&variable("temp_qc", &[])), Scheme::Primary);
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
