//! Keys of stored objects: one function for each kind, so that no two services spell a path in two ways.

use std::fmt::{Display, Formatter};

use serde::{Deserialize, Serialize};

use crate::ContractError;
use crate::digest::Digest;
use crate::product::ProductId;

/// The key of an object: `/`-separated parts of `A-Z a-z 0-9 . _ -`, none of them `.` or `..`.
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct ObjectKey(String);

impl ObjectKey {
    /// An input file as it came.
    pub fn raw(product: &ProductId, sha256: &Digest) -> Self {
        Self(format!("raw/{product}/{sha256}"))
    }

    /// Begins the names of objects that are named by the digest of their values. Those that came before them are named
    /// by the digest of their bytes alone.
    pub(crate) const OF_VALUES: &str = "v2-";

    /// One time step as map-major chunks, named by its values: other bytes for the same values are the same field.
    pub fn field(product: &ProductId, values_sha256: &Digest) -> Self {
        let of_values = Self::OF_VALUES;
        Self(format!(
            "frames/{product}/{of_values}{values_sha256}.parquet"
        ))
    }

    /// One segment of time as time-major chunks, named by its values.
    pub fn series(product: &ProductId, values_sha256: &Digest) -> Self {
        let of_values = Self::OF_VALUES;
        Self(format!(
            "series/{product}/{of_values}{values_sha256}.parquet"
        ))
    }

    /// Steps and time that each cell's sum after a step of accumulated carbon holds, named by its numbers.
    pub fn contributed(product: &ProductId, sha256: &Digest) -> Self {
        Self(format!("contributed/{product}/{sha256}.parquet"))
    }

    /// The cells that hold data in some step, named by its bytes.
    pub fn domain(product: &ProductId, sha256: &Digest) -> Self {
        Self(format!("domain/{product}/{sha256}"))
    }

    /// A numbered manifest; numbers are zero-padded so that names sort as numbers do.
    pub fn manifest(product: &ProductId, number: u64) -> Self {
        Self(format!("manifests/{product}/{number:010}.json"))
    }

    /// Some consecutive steps of manifests, named by the digest of their JSON.
    pub fn manifest_page(product: &ProductId, sha256: &Digest) -> Self {
        Self(format!("manifest-pages/{product}/{sha256}.json"))
    }

    /// The hint of a product's newest number: where whoever has not seen the product begins to ask.
    pub fn newest(product: &ProductId) -> Self {
        Self(format!("newest/{product}/number.json"))
    }

    /// The pin of a version: that clean-up leaves the manifest of this number and what it names.
    pub fn pin(product: &ProductId, number: u64) -> Self {
        Self(format!("pins/{product}/{number:010}.json"))
    }

    /// Areas of a region's share of every cell, named by grid, region and earth.
    pub fn weights(job: &Digest) -> Self {
        Self(format!("weights/{job}.parquet"))
    }

    /// Observations of one dataset and month as GeoParquet, named by its content.
    pub fn observations(dataset: &ProductId, sha256: &Digest) -> Self {
        Self(format!("observations/{dataset}/{sha256}.parquet"))
    }

    /// A comparison with published values, named by what was compared.
    pub fn check(job: &Digest) -> Self {
        Self(format!("checks/{job}.json"))
    }

    /// A drawn picture under the hash of its job.
    pub fn tile(job: &Digest) -> Self {
        let text = job.to_string();
        Self(format!("tiles/{}/{text}.png", &text[..2]))
    }

    /// Is it the key of an object in a top-level folder?
    pub fn is_in(&self, folder: &str) -> bool {
        let rest = self.0.strip_prefix(folder);
        rest.is_some_and(|rest| rest.starts_with('/'))
    }

    /// The key as text.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl std::str::FromStr for ObjectKey {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        s.to_owned().try_into()
    }
}

impl TryFrom<String> for ObjectKey {
    type Error = ContractError;

    fn try_from(s: String) -> Result<Self, Self::Error> {
        let part_is_safe = |part: &str| {
            !matches!(part, "" | "." | "..")
                && part
                    .bytes()
                    .all(|b| b.is_ascii_alphanumeric() || matches!(b, b'.' | b'_' | b'-'))
        };
        if s.len() <= 512 && s.split('/').all(part_is_safe) {
            Ok(Self(s))
        } else {
            Err(ContractError::invalid(
                "object key",
                &s,
                "parts of A-Z a-z 0-9 . _ - joined by /",
            ))
        }
    }
}

impl From<ObjectKey> for String {
    fn from(key: ObjectKey) -> Self {
        key.0
    }
}

impl Display for ObjectKey {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_made_key_parses_as_itself() {
        let (product, digest) = ("a-b".parse().unwrap(), Digest::of(b"x"));
        for key in [
            ObjectKey::raw(&product, &digest),
            ObjectKey::field(&product, &digest),
            ObjectKey::series(&product, &digest),
            ObjectKey::contributed(&product, &digest),
            ObjectKey::domain(&product, &digest),
            ObjectKey::manifest(&product, 7),
            ObjectKey::manifest_page(&product, &digest),
            ObjectKey::newest(&product),
            ObjectKey::pin(&product, 7),
            ObjectKey::weights(&digest),
            ObjectKey::observations(&product, &digest),
            ObjectKey::check(&digest),
            ObjectKey::tile(&digest),
        ] {
            assert_eq!(key.as_str().parse::<ObjectKey>().unwrap(), key);
        }
    }

    #[test]
    fn keys_that_leave_their_folder_are_refused() {
        for s in [
            "",
            "/etc/passwd",
            "a/../b",
            "a//b",
            "a/./b",
            "a\\b",
            "a/b\0",
            "a b",
        ] {
            assert!(s.parse::<ObjectKey>().is_err(), "{s:?}");
        }
    }
}
