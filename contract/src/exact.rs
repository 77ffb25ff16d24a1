//! Numbers as decimal text: what is read is bit for bit what was written, whatever reads it.
//!
//! JSON numbers are not enough where a digest must come out the same on both sides: readers may be wrong in the last
//! bit. For `#[serde(with = "crate::exact")]`; [`grid`] does the same for a whole grid.

use serde::{Deserialize, Deserializer, Serializer};

/// Longest text read: far more than any shortest decimal form needs.
const MAX_BYTES: usize = 400;

pub(crate) fn serialize<S: Serializer>(number: &f64, to: S) -> Result<S::Ok, S::Error> {
    // The shortest text that reads as this number.
    to.collect_str(number)
}

pub(crate) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    let text = String::deserialize(from)?;
    let number = if text.len() <= MAX_BYTES {
        text.parse().ok()
    } else {
        None
    };
    number.ok_or_else(|| serde::de::Error::custom("a number as decimal text is wanted"))
}

/// A grid with exact numbers.
pub(crate) mod grid {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    use crate::grid::Grid;

    #[derive(Serialize, Deserialize)]
    #[serde(remote = "Grid", deny_unknown_fields)]
    struct Exact {
        rows: u32,
        cols: u32,
        #[serde(with = "crate::exact")]
        north_deg: f64,
        #[serde(with = "crate::exact")]
        west_deg: f64,
        #[serde(with = "crate::exact")]
        dlat_deg: f64,
        #[serde(with = "crate::exact")]
        dlon_deg: f64,
    }

    pub(crate) fn serialize<S: Serializer>(grid: &Grid, to: S) -> Result<S::Ok, S::Error> {
        Exact::serialize(grid, to)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Grid, D::Error> {
        Exact::deserialize(from)
    }
}

#[cfg(test)]
mod tests {
    use serde::{Deserialize, Serialize};

    #[derive(Serialize, Deserialize)]
    struct One(#[serde(with = "super")] f64);

    proptest::proptest! {
        #[test]
        fn every_number_is_read_as_it_was_written(number in proptest::num::f64::NORMAL) {
            let text = serde_json::to_string(&One(number)).unwrap();
            let One(back) = serde_json::from_str(&text).unwrap();
            proptest::prop_assert_eq!(back.to_bits(), number.to_bits());
        }
    }

    #[test]
    fn what_is_no_number_is_refused() {
        for text in ["1.0", "\"\"", "\"one\"", "\"1,0\"", "null"] {
            assert!(serde_json::from_str::<One>(text).is_err(), "{text}");
        }
        let long = format!("\"{}\"", "1".repeat(500));
        assert!(serde_json::from_str::<One>(&long).is_err());
    }
}
