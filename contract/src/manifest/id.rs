//! Names of manifests.

use std::fmt::{Display, Formatter};

use serde::{Deserialize, Serialize};

use crate::ContractError;
use crate::product::ProductId;

/// Name of one manifest: `product@number-digest`, with the first eight digits of its digest.
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct ManifestId {
    /// Product.
    pub product: ProductId,
    /// Number.
    pub number: u64,
    /// First eight digits of the digest of the manifest's canonical JSON.
    short_sha256: String,
}

impl ManifestId {
    /// `short_sha256` are the first eight digits of the manifest's digest.
    pub(super) fn new(product: ProductId, number: u64, short_sha256: String) -> Self {
        Self {
            product,
            number,
            short_sha256,
        }
    }
}

impl Display for ManifestId {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}@{}-{}", self.product, self.number, self.short_sha256)
    }
}

impl std::str::FromStr for ManifestId {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let bad = || {
            ContractError::invalid(
                "manifest",
                s,
                "product@number-digest, such as takahashi09-flux@12-0a1b2c3d",
            )
        };
        let (product, rest) = s.split_once('@').ok_or_else(bad)?;
        let (number, short) = rest.split_once('-').ok_or_else(bad)?;
        if short.len() != 8
            || !short
                .bytes()
                .all(|b| matches!(b, b'0'..=b'9' | b'a'..=b'f'))
        {
            return Err(bad());
        }
        let number = version_number(number).map_err(|advice| {
            advice.map_or_else(bad, |advice| ContractError::invalid("manifest", s, advice))
        })?;
        Ok(Self {
            product: product.parse()?,
            number,
            short_sha256: short.to_owned(),
        })
    }
}

/// The number of a version as its name has it: a version has one name, and an answer repeats it.
///
/// # Errors
/// How the number is written, where the text is one that is written otherwise; nothing where it is none.
pub(super) fn version_number(text: &str) -> Result<u64, Option<String>> {
    let is_number = !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    let number: Option<u64> = text.parse().ok().filter(|_| is_number);
    match number {
        Some(number) if number.to_string() == text => Ok(number),
        Some(number) => Err(Some(format!(
            "write the number without zeros before it: @{number}"
        ))),
        None => Err(None),
    }
}

impl TryFrom<String> for ManifestId {
    type Error = ContractError;

    fn try_from(s: String) -> Result<Self, Self::Error> {
        s.parse()
    }
}

impl From<ManifestId> for String {
    fn from(id: ManifestId) -> Self {
        id.to_string()
    }
}
