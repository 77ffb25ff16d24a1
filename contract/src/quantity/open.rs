//! Quantities that this program knows nothing special of: a name, a unit and a title as a file states them, and the range
//! of their values. Kept once for as long as the program runs, so that a quantity stays as small as a number.

use std::collections::BTreeMap;
use std::hash::{Hash, Hasher};
use std::sync::{Mutex, PoisonError};

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::flags::Flag;
use crate::ContractError;

/// Longest name, bytes: CF standard names stay below.
pub const MAX_NAME_BYTES: usize = 128;
/// Longest unit, bytes.
pub const MAX_UNIT_BYTES: usize = 64;
/// Longest title, bytes.
pub const MAX_TITLE_BYTES: usize = 256;
/// Most open quantities that a program knows at a time, all ranges counted; one of more than a KiB, by what its codes mean, counts as
/// several. Mostly some 2 MB, never more than 30.
pub(super) const MAX_OPEN: usize = 8192;
/// Values beyond are no range for colours.
const MAX_RANGE: f64 = 1e20;

/// An open quantity: a handle to what is known of it, the same for the same words and range.
#[derive(Clone, Copy)]
pub struct OpenQuantity(&'static Known);

/// What an open quantity is, as JSON has it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = OpenQuantity, description = "A quantity that nothing is built in for, by its own words.")]
pub struct OpenWords {
    /// Its CF standard name, or else its long name or the variable's: lower-case letters, digits and `_`, a letter first.
    pub name: String,
    /// Unit of stored values, as UDUNITS spells it; `1` for shares and codes.
    pub unit: String,
    /// Title for people.
    pub title: String,
    /// Lowest and highest stored value, outwards to two digits; none if that is not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<(f64, f64)>, nullable = false)]
    pub range: Option<[f64; 2]>,
    /// What its values mean, where they are codes, in the order of values: `flag_values` and `flag_meanings` of CF.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(required = false)]
    pub flags: Vec<Flag>,
    /// Is the name the CF standard name that a file states, so that other programs may be told it as such?
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    #[schema(required = false)]
    pub is_standard_name: bool,
}

struct Known {
    words: OpenWords,
    shown_unit: String,
}

/// Statistics of a mass that are one, as their names end.
const MASS_STATISTICS: [&str; 5] = [
    "anomaly",
    "standard_deviation",
    "annual_amplitude",
    "trend",
    "least_squares_trend",
];

/// All that are known.
struct All {
    /// By their JSON.
    quantities: BTreeMap<String, &'static Known>,
    /// What they count together.
    weight: usize,
}

static KNOWN: Mutex<All> = Mutex::new(All {
    quantities: BTreeMap::new(),
    weight: 0,
});

impl OpenQuantity {
    /// The quantity of these words; its range is rounded outwards to two digits.
    ///
    /// # Errors
    /// A word out of its limits, or too many quantities.
    pub fn new(mut words: OpenWords) -> Result<Self, ContractError> {
        validate(&words)?;
        words.flags.sort_by_key(|flag| flag.value);
        words.range = words.range.map(|[low, high]| {
            let within = |value: f64| value.clamp(-MAX_RANGE, MAX_RANGE);
            // Not -0.
            [
                0.0 - rounded_up(-within(low.min(high))),
                rounded_up(within(high.max(low))),
            ]
        });
        let key = serde_json::to_string(&words)
            .map_err(|e| ContractError::invalid("quantity", &words.name, e.to_string()))?;
        let mut all = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = all.quantities.get(&key) {
            return Ok(Self(known));
        }
        let weight = all.weight + key.len().div_ceil(1 << 10);
        if weight > MAX_OPEN {
            let reason = format!(
                "{MAX_OPEN} quantities that are not built in are known at most; start the program anew"
            );
            return Err(ContractError::invalid("quantity", &words.name, reason));
        }
        let known = Known {
            shown_unit: shown_unit_of(&words),
            words,
        };
        let known: &'static Known = Box::leak(Box::new(known));
        all.quantities.insert(key, known);
        all.weight = weight;
        Ok(Self(known))
    }

    /// Its words.
    pub fn words(self) -> &'static OpenWords {
        &self.0.words
    }

    /// The unit with raised powers, as people read it; empty for `1`.
    pub(super) fn shown_unit(self) -> &'static str {
        &self.0.shown_unit
    }

    /// Do its values lie on either side of none? Those of anomalies, trends and correlations do.
    pub fn is_difference(self) -> bool {
        let name = &self.words().name;
        name == "correlation" || name.ends_with("_anomaly") || name.ends_with("_trend")
    }

    /// Is it the same but for title, range, what its codes mean and whether its name is a standard name?
    pub fn is_same_kind(self, other: Self) -> bool {
        let (own, other) = (self.words(), other.words());
        own.name == other.name && own.unit == other.unit
    }

    /// The same over a range of stored values that was found.
    ///
    /// # Errors
    /// Too many quantities.
    pub fn over(self, low: f64, high: f64) -> Result<Self, ContractError> {
        let (low, high) = match self.words().range {
            Some([l, h]) => (l.min(low), h.max(high)),
            None => (low, high),
        };
        Self::new(OpenWords {
            range: Some([low, high]),
            ..self.words().clone()
        })
    }
}

impl OpenQuantity {
    /// The same over the range of another one of its kind too; its codes mean what the other one says, if that says it, and the name is a
    /// standard name if it is one for either.
    ///
    /// # Errors
    /// Too many quantities.
    pub(super) fn joined(self, other: Self) -> Result<Self, ContractError> {
        let (own, other) = (self.words(), other.words());
        let flags = if other.flags.is_empty() {
            &own.flags
        } else {
            &other.flags
        };
        let ranges = [own.range, other.range].into_iter().flatten();
        Self::new(OpenWords {
            range: ranges.reduce(|[l, h], [low, high]| [l.min(low), h.max(high)]),
            flags: flags.clone(),
            is_standard_name: own.is_standard_name || other.is_standard_name,
            ..own.clone()
        })
    }
}

impl PartialEq for OpenQuantity {
    fn eq(&self, other: &Self) -> bool {
        // Each is kept once.
        std::ptr::eq(self.0, other.0)
    }
}

impl Eq for OpenQuantity {}

impl Hash for OpenQuantity {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.words().name.hash(state);
        self.words().unit.hash(state);
    }
}

impl std::fmt::Debug for OpenQuantity {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.words().fmt(f)
    }
}

fn validate(words: &OpenWords) -> Result<(), ContractError> {
    let OpenWords {
        name,
        unit,
        title,
        range,
        flags,
        is_standard_name: _,
    } = words;
    let is_name = name.starts_with(|c: char| c.is_ascii_lowercase())
        && name
            .bytes()
            .all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_');
    if !is_name || name.len() > MAX_NAME_BYTES {
        let reason = format!(
            "a name of lower-case letters, digits and _, a letter first, at most {MAX_NAME_BYTES} bytes"
        );
        return Err(ContractError::invalid("quantity", name, reason));
    }
    for (what, text, most) in [
        ("unit", unit, MAX_UNIT_BYTES),
        ("title", title, MAX_TITLE_BYTES),
    ] {
        if text.is_empty() || text.len() > most || text.chars().any(char::is_control) {
            let reason = format!("text without control characters, 1 to {most} bytes");
            return Err(ContractError::invalid(what, text, reason));
        }
    }
    if range.is_some_and(|range| range.iter().any(|value| !value.is_finite())) {
        let reason = "two finite numbers".to_owned();
        return Err(ContractError::invalid("range", name, reason));
    }
    Flag::check(flags).map_err(|reason| ContractError::invalid("flags", name, reason))
}

/// The least number of two digits (and a power of ten) that is not below; one that is read a last bit off is itself.
fn rounded_up(value: f64) -> f64 {
    if value == 0.0 {
        return 0.0;
    }
    let text = format!("{value:.1e}");
    let near: f64 = text.parse().unwrap_or(value);
    // Stored values are of 32 bits.
    if near >= value || (near - value).abs() <= f64::from(f32::EPSILON) * value.abs() {
        return near;
    }
    let step = 10f64.powi(value.abs().log10().floor() as i32 - 1);
    format!("{:.1e}", near + step).parse().unwrap_or(value)
}

/// The unit as people read it. UDUNITS has no word for of what a gram is: of statistics of carbon it is carbon, as that of what they
/// are of, and not CO₂.
fn shown_unit_of(words: &OpenWords) -> String {
    let shown = shown_unit(&words.unit);
    let of_carbon = ["carbon_flux_", "accumulated_carbon_"]
        .iter()
        .filter_map(|quantity| words.name.strip_prefix(quantity))
        .any(|statistic| MASS_STATISTICS.contains(&statistic));
    match shown.strip_prefix("g ") {
        Some(rest) if of_carbon => format!("g C {rest}"),
        _ => shown,
    }
}

/// `kg m-2 s-1` as `kg m⁻² s⁻¹`: digits that end a word, and their sign, are raised.
fn shown_unit(unit: &str) -> String {
    const RAISED: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    if unit == "1" {
        return String::new();
    }
    let raised = |word: &str| -> String {
        let letters = word.trim_end_matches(|c: char| c.is_ascii_digit() || c == '-');
        let power = &word[letters.len()..];
        if letters.is_empty() || !letters.chars().all(char::is_alphabetic) {
            return word.to_owned();
        }
        let raise = |c: char| match c.to_digit(10) {
            Some(digit) => RAISED[digit as usize],
            None => '⁻',
        };
        letters.chars().chain(power.chars().map(raise)).collect()
    };
    let words: Vec<String> = unit.split(' ').map(raised).collect();
    words.join(" ")
}

impl TryFrom<OpenWords> for OpenQuantity {
    type Error = ContractError;

    fn try_from(words: OpenWords) -> Result<Self, Self::Error> {
        Self::new(words)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(name: &str, unit: &str, range: Option<[f64; 2]>) -> OpenWords {
        OpenWords {
            name: name.to_owned(),
            unit: unit.to_owned(),
            title: "Title".to_owned(),
            range,
            flags: vec![],
            is_standard_name: false,
        }
    }

    /// What was stored before names were told apart stays as it is to the byte.
    #[test]
    fn a_standard_name_is_told_of_where_it_is_one() {
        let plain = OpenQuantity::new(words("alkalinity", "mol m-3", None)).unwrap();
        let json = serde_json::to_string(plain.words()).unwrap();
        let before = r#"{"name":"alkalinity","unit":"mol m-3","title":"Title"}"#;
        assert_eq!(json, before);
        let named = OpenQuantity::new(OpenWords {
            is_standard_name: true,
            ..plain.words().clone()
        });
        let named = named.unwrap();
        let json = serde_json::to_string(named.words()).unwrap();
        assert_eq!(json, before.replace('}', r#","is_standard_name":true}"#));
        let again: OpenWords = serde_json::from_str(&json).unwrap();
        assert_eq!(OpenQuantity::new(again).unwrap(), named);
        assert!(named != plain && named.is_same_kind(plain));
        assert_eq!(plain.joined(named).unwrap(), named);
        assert_eq!(named.joined(plain).unwrap(), named);
        assert!(named.over(0.0, 1.0).unwrap().words().is_standard_name);
    }

    #[test]
    fn ranges_are_rounded_outwards_and_stay_as_they_are() {
        for (range, wanted) in [
            ([271.35, 304.9], [270.0, 310.0]),
            ([-3.14159e-7, 0.0], [-3.2e-7, 0.0]),
            ([5.0, 1.0], [1.0, 5.0]),
            ([0.0, f64::from(0.063f32)], [0.0, 0.063]),
            ([99.1, 99.9], [99.0, 100.0]),
            ([-1e30, 1e30], [-1e20, 1e20]),
        ] {
            let quantity = OpenQuantity::new(words("a", "m", Some(range))).unwrap();
            assert_eq!(quantity.words().range, Some(wanted), "{range:?}");
            let json = serde_json::to_string(quantity.words()).unwrap();
            assert!(!json.contains("-0.0"), "{json}");
            let again = OpenQuantity::new(quantity.words().clone()).unwrap();
            assert_eq!(again, quantity);
        }
    }

    #[test]
    fn a_range_grows_by_what_is_found_in_any_order() {
        let plain = OpenQuantity::new(words("b", "m", None)).unwrap();
        let one = plain.over(1.0, 2.0).unwrap().over(-5.5, 0.0).unwrap();
        let other = plain.over(-5.5, 0.0).unwrap().over(1.0, 2.0).unwrap();
        assert_eq!(one, other);
        assert_eq!(one.words().range, Some([-5.5, 2.0]));
        assert_ne!(one, plain);
        assert!(one.is_same_kind(plain));
    }

    #[test]
    fn what_codes_mean_is_kept_in_their_order_and_told_anew_by_who_joins() {
        let flag = |value, meaning: &str| Flag {
            value,
            meaning: meaning.to_owned(),
        };
        let of = |flags: Vec<Flag>, range| {
            let plain = words("basin", "1", range);
            OpenQuantity::new(OpenWords { flags, ..plain }).unwrap()
        };
        let plain = of(vec![], Some([1.0, 9.0]));
        let own = of(vec![flag(2, "b"), flag(1, "a")], None);
        assert_eq!(own.words().flags, [flag(1, "a"), flag(2, "b")]);
        assert!(own != plain && own.is_same_kind(plain));
        let found = own.over(0.0, 5.0).unwrap();
        assert_eq!(found.words().flags, own.words().flags);
        for (joined, range) in [
            (plain.joined(own), [1.0, 9.0]),
            (own.joined(plain), [1.0, 9.0]),
            (found.joined(plain), [0.0, 9.0]),
        ] {
            let words = joined.unwrap().words();
            assert_eq!(
                (&words.flags, words.range),
                (&own.words().flags, Some(range))
            );
        }
        let newer = of(vec![flag(1, "c")], None);
        assert_eq!(found.joined(newer).unwrap().words().flags, [flag(1, "c")]);
        let json = serde_json::to_string(own.words()).unwrap();
        let wanted = r#","flags":[{"value":1,"meaning":"a"},{"value":2,"meaning":"b"}]}"#;
        assert!(json.ends_with(wanted), "{json}");
        let again: OpenWords = serde_json::from_str(&json).unwrap();
        assert_eq!(OpenQuantity::new(again).unwrap(), own);
        let twice = OpenWords {
            flags: vec![flag(1, "a"), flag(1, "b")],
            ..words("basin", "1", None)
        };
        assert!(OpenQuantity::new(twice).is_err());
    }

    #[test]
    fn words_beyond_a_limit_are_refused() {
        for bad in [
            words("", "m", None),
            words("Sst", "m", None),
            words("2m", "m", None),
            words("a b", "m", None),
            words(&"a".repeat(MAX_NAME_BYTES + 1), "m", None),
            words("a", "", None),
            words("a", "m\n", None),
            words("a", &"m".repeat(MAX_UNIT_BYTES + 1), None),
            words("a", "m", Some([f64::NAN, 1.0])),
        ] {
            assert!(OpenQuantity::new(bad.clone()).is_err(), "{bad:?}");
        }
    }

    #[test]
    fn a_gram_of_statistics_of_carbon_is_one_of_carbon() {
        let shown = |name: &str, unit: &str| shown_unit_of(&words(name, unit, None));
        for (name, unit, expected) in [
            ("carbon_flux_anomaly", "g m-2 year-1", "g C m⁻² year⁻¹"),
            (
                "carbon_flux_trend",
                "g m-2 year-1 year-1",
                "g C m⁻² year⁻¹ year⁻¹",
            ),
            ("accumulated_carbon_anomaly", "g m-2", "g C m⁻²"),
            ("carbon_flux_trend_p_value", "1", ""),
            ("carbon_flux_of_somebody", "g m-2 year-1", "g m⁻² year⁻¹"),
            ("co2_flux", "g m-2 year-1", "g m⁻² year⁻¹"),
        ] {
            assert_eq!(shown(name, unit), expected, "{name}");
        }
    }

    #[test]
    fn units_are_shown_with_raised_powers() {
        for (unit, shown) in [
            ("kg m-2 s-1", "kg m⁻² s⁻¹"),
            ("m3 s-1", "m³ s⁻¹"),
            ("K year-1", "K year⁻¹"),
            ("1", ""),
            ("degC", "degC"),
            ("W/m2", "W/m2"),
            ("1e-3", "1e-3"),
            ("10 m", "10 m"),
        ] {
            assert_eq!(shown_unit(unit), shown);
        }
    }
}
