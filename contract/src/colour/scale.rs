//! How values are spread over the colours of a range: evenly, or by their logarithms.

use serde::{Deserialize, Serialize};

use crate::ContractError;

/// How values are spread over a range of colours.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Scale {
    /// Equal differences are equally far apart.
    #[default]
    Linear,
    /// Equal ratios are equally far apart (log10), for quantities over several powers of ten. Its range lies above 0.
    Log,
}

impl Scale {
    /// Both, in the order they are offered.
    pub const ALL: [Self; 2] = [Self::Linear, Self::Log];

    /// Name in URLs and on the command line.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::Log => "log",
        }
    }

    #[expect(clippy::trivially_copy_pass_by_ref, reason = "serde calls it so")]
    pub(super) fn is_usual(&self) -> bool {
        *self == Self::default()
    }

    /// The number by which a value is placed; what a logarithm has no place for lies below all else. NaN stays NaN.
    pub fn spread(self, value: f64) -> f64 {
        match self {
            Self::Linear => value,
            Self::Log if value <= 0.0 => f64::NEG_INFINITY,
            Self::Log => value.log10(),
        }
    }

    /// The value at a share of the way from one to another.
    pub(super) fn between(self, low: f64, high: f64, share: f64) -> f64 {
        match self {
            Self::Linear => low + (high - low) * share,
            Self::Log => low * (high / low).powf(share),
        }
    }
}

impl std::fmt::Display for Scale {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.as_str())
    }
}

impl std::str::FromStr for Scale {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let found = Self::ALL.into_iter().find(|scale| scale.as_str() == s);
        found.ok_or_else(|| ContractError::invalid("scale", s, "linear or log"))
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "these values are exact")]
mod tests {
    use super::*;

    #[test]
    fn equal_ratios_are_equally_far_apart_on_a_logarithmic_scale() {
        let at = |value: f64| Scale::Log.spread(value);
        assert!((at(1.0) - at(0.1) - (at(10.0) - at(1.0))).abs() < 1e-12);
        assert!(at(0.0) < at(1e-300) && at(-5.0) == at(0.0) && at(f64::NAN).is_nan());
        assert!((Scale::Log.between(0.01, 100.0, 0.25) - 0.1).abs() < 1e-12);
        assert_eq!(Scale::Linear.between(1.0, 3.0, 0.25), 1.5);
    }

    #[test]
    fn words_are_read_as_they_are_written() {
        for scale in Scale::ALL {
            assert_eq!(scale.to_string().parse::<Scale>().unwrap(), scale);
            assert_eq!(serde_json::to_value(scale).unwrap(), scale.as_str());
        }
        assert!(
            "ln".parse::<Scale>()
                .unwrap_err()
                .to_string()
                .contains("linear or log")
        );
    }
}
