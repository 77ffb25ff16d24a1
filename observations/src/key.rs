//! What names an observation, and the one order that all answers are in.

use std::cmp::Ordering;

use contract::ContractError;
use contract::observation::Observation;
use contract::product::ProductId;
use contract::time::TimeMs;
use serde::{Deserialize, Serialize};

/// Longest text of a key, bytes.
const MAX_TEXT_BYTES: usize = 1024;

/// The natural key; keys are ordered by time, dataset, platform, property, depth, texts by their bytes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Key {
    pub(crate) time: TimeMs,
    pub(crate) dataset: ProductId,
    pub(crate) platform: String,
    pub(crate) property: String,
    pub(crate) depth_m: f64,
}

impl Key {
    pub(crate) fn of(observation: &Observation) -> Self {
        Self {
            time: observation.time,
            dataset: observation.dataset.clone(),
            platform: observation.platform.clone(),
            property: observation.property.clone(),
            depth_m: observation.depth_m,
        }
    }
}

/// The `next` of a page: its JSON as hexadecimal text.
impl std::fmt::Display for Key {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let json = serde_json::to_string(self).map_err(|_never| std::fmt::Error)?;
        json.bytes().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl std::str::FromStr for Key {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let bad = || ContractError::invalid("page token", s, "the `next` of an answer");
        if s.len() > MAX_TEXT_BYTES || !s.len().is_multiple_of(2) || !s.is_ascii() {
            return Err(bad());
        }
        let byte = |at: usize| u8::from_str_radix(&s[at..at + 2], 16);
        let json: Result<Vec<u8>, _> = (0..s.len()).step_by(2).map(byte).collect();
        let json = json.map_err(|_no_hex| bad())?;
        serde_json::from_slice(&json).map_err(|_no_key| bad())
    }
}

impl Eq for Key {}

impl Ord for Key {
    fn cmp(&self, other: &Self) -> Ordering {
        (self.time, &self.dataset, &self.platform, &self.property)
            .cmp(&(other.time, &other.dataset, &other.platform, &other.property))
            .then(self.depth_m.total_cmp(&other.depth_m))
    }
}

impl PartialOrd for Key {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// The order of two observations, that of their keys.
pub(crate) fn order(a: &Observation, b: &Observation) -> Ordering {
    (a.time, &a.dataset, &a.platform, &a.property)
        .cmp(&(b.time, &b.dataset, &b.platform, &b.property))
        .then(a.depth_m.total_cmp(&b.depth_m))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_comes_first_and_depth_last() {
        let key = |time: &str, platform: &str, depth_m| Key {
            time: time.parse().unwrap(),
            dataset: "d".parse().unwrap(),
            platform: platform.to_owned(),
            property: "p".to_owned(),
            depth_m,
        };
        let sorted = [
            key("2000", "a", 5.0),
            key("2000", "b", -3.0),
            key("2000", "b", 0.0),
            key("2001", "a", 0.0),
        ];
        assert!(sorted.is_sorted());
        assert!(!sorted.windows(2).any(|pair| pair[0] == pair[1]));
    }
}
