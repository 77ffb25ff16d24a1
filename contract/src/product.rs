//! Names of products: short, safe in paths, URLs and SQL.

use std::fmt::{Display, Formatter};

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::ContractError;

/// The name of a product, such as `takahashi09-flux`: 1 to 64 of `a-z 0-9 -`, starting with a letter.
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(try_from = "String", into = "String")]
#[schema(value_type = String)]
pub struct ProductId(String);

impl ProductId {
    /// The name as text.
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// The product of this one's carbon accumulated since its first step.
    ///
    /// # Errors
    /// The longer name would be too long.
    pub fn accumulated(&self) -> Result<Self, ContractError> {
        format!("{}-accumulated", self.0).parse()
    }

    /// The product of the northward part of a vector whose eastward part this one may be: `NAME-north` of `NAME-east`.
    pub fn northward(&self) -> Option<Self> {
        let name = self.0.strip_suffix("-east")?;
        format!("{name}-north").parse().ok()
    }

    /// The product whose northward part this one may be.
    pub fn eastward(&self) -> Option<Self> {
        let name = self.0.strip_suffix("-north")?;
        format!("{name}-east").parse().ok()
    }
}

impl std::str::FromStr for ProductId {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let valid = (1..=64).contains(&s.len())
            && s.starts_with(|c: char| c.is_ascii_lowercase())
            && s.bytes()
                .all(|b| matches!(b, b'a'..=b'z' | b'0'..=b'9' | b'-'));
        if valid {
            Ok(Self(s.to_owned()))
        } else {
            Err(ContractError::invalid(
                "product",
                s,
                "1 to 64 of a-z, 0-9 and -, starting with a letter",
            ))
        }
    }
}

impl TryFrom<String> for ProductId {
    type Error = ContractError;

    fn try_from(s: String) -> Result<Self, Self::Error> {
        s.parse()
    }
}

impl From<ProductId> for String {
    fn from(id: ProductId) -> Self {
        id.0
    }
}

impl Display for ProductId {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_could_leave_a_folder_are_refused() {
        for s in [
            "",
            "../etc",
            "a/b",
            "A",
            "1a",
            "a.b",
            "a b",
            "a'",
            &"a".repeat(65),
        ] {
            assert!(s.parse::<ProductId>().is_err(), "{s}");
        }
        assert!("takahashi09-flux".parse::<ProductId>().is_ok());
    }
}
