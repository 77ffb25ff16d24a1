//! Which index is read of a dimension beside time, latitude and longitude: a depth, a height, a member.

use std::fmt::{Display, Formatter};
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::ContractError;

/// Longest name of a dimension, bytes (the limit of NetCDF).
const MAX_NAME_BYTES: usize = 256;

/// The index that is read of one dimension. Written as `depth=0`.
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct DimensionIndex {
    /// Name of the dimension.
    pub dimension: String,
    /// Which of its levels, from 0 on.
    pub index: u64,
}

impl DimensionIndex {
    /// In the order of their dimensions, in which they are kept and compared.
    ///
    /// # Errors
    /// A dimension is named twice.
    pub fn sorted(mut indexes: Vec<Self>) -> Result<Vec<Self>, ContractError> {
        indexes.sort();
        let twice = indexes
            .windows(2)
            .find(|two| two[0].dimension == two[1].dimension);
        match twice {
            None => Ok(indexes),
            Some(two) => Err(ContractError::invalid(
                "index",
                &two[1].to_string(),
                "one index of each dimension; of another one another product is made",
            )),
        }
    }

    /// The words that say them on a command line, each with a space before it.
    pub fn words(indexes: &[Self]) -> String {
        indexes
            .iter()
            .fold(String::new(), |text, one| format!("{text} --index {one}"))
    }
}

impl Display for DimensionIndex {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}={}", self.dimension, self.index)
    }
}

impl FromStr for DimensionIndex {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let bad = || {
            let expected = "DIMENSION=INDEX, an index from 0 on, such as depth=0";
            ContractError::invalid("index", s, expected)
        };
        let (dimension, index) = s.rsplit_once('=').ok_or_else(bad)?;
        let is_name = (1..=MAX_NAME_BYTES).contains(&dimension.len())
            && !dimension.chars().any(char::is_control);
        if !is_name {
            return Err(bad());
        }
        Ok(Self {
            dimension: dimension.to_owned(),
            index: index.parse().map_err(|_unparsed| bad())?,
        })
    }
}

impl TryFrom<String> for DimensionIndex {
    type Error = ContractError;

    fn try_from(s: String) -> Result<Self, Self::Error> {
        s.parse()
    }
}

impl From<DimensionIndex> for String {
    fn from(index: DimensionIndex) -> Self {
        index.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn indexes(texts: &[&str]) -> Vec<DimensionIndex> {
        texts.iter().map(|text| text.parse().unwrap()).collect()
    }

    #[test]
    fn an_index_is_written_as_on_the_command_line() {
        let depth: DimensionIndex = "depth=12".parse().unwrap();
        assert_eq!((depth.dimension.as_str(), depth.index), ("depth", 12));
        let json = serde_json::to_string(&depth).unwrap();
        assert_eq!(json, r#""depth=12""#);
        assert_eq!(
            serde_json::from_str::<DimensionIndex>(&json).unwrap(),
            depth
        );
        for bad in ["depth", "=1", "depth=", "depth=-1", "depth=1.5", "a\u{7}=1"] {
            assert!(bad.parse::<DimensionIndex>().is_err(), "{bad}");
        }
    }

    #[test]
    fn indexes_are_compared_in_one_order_and_one_of_a_dimension_is_read() {
        let both = DimensionIndex::sorted(indexes(&["member=3", "depth=0"])).unwrap();
        assert_eq!(both, indexes(&["depth=0", "member=3"]));
        assert_eq!(
            DimensionIndex::words(&both),
            " --index depth=0 --index member=3"
        );
        let twice = DimensionIndex::sorted(indexes(&["depth=0", "depth=1"]));
        assert!(twice.unwrap_err().to_string().contains("depth=1"));
    }
}
