//! The digest of values: the identity of what is stored, whatever bytes hold it.

use bytes::Bytes;
use contract::digest::Digest;
use sha2::{Digest as _, Sha256};

/// An object to store, and what names it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Encoded {
    /// Digest of its values.
    pub values_sha256: Digest,
    /// Its bytes.
    pub content: Bytes,
}

/// Values hashed at a time; their bytes fit the nearest cache.
const AT_ONCE: usize = 1024;

/// Hashes numbers as little-endian bytes, no-data as one bit pattern.
#[derive(Debug)]
pub(crate) struct ValuesDigest(Sha256);

impl ValuesDigest {
    /// Of objects of a kind; the name holds the version of what is hashed in which order.
    pub(crate) fn new(kind: &'static str) -> Self {
        let mut hasher = Sha256::new();
        hasher.update(kind);
        Self(hasher)
    }

    /// Adds what the values lie on.
    pub(crate) fn number(mut self, number: i64) -> Self {
        self.0.update(number.to_le_bytes());
        self
    }

    /// Adds values.
    pub(crate) fn values(mut self, values: &[f32]) -> Self {
        self.add(values);
        self
    }

    /// Adds the next values of many.
    pub(crate) fn add(&mut self, values: &[f32]) {
        let mut bytes = [0; 4 * AT_ONCE];
        for some in values.chunks(AT_ONCE) {
            for (to, value) in bytes.chunks_exact_mut(4).zip(some) {
                to.copy_from_slice(&no_data_alike(*value).to_le_bytes());
            }
            self.0.update(&bytes[..4 * some.len()]);
        }
    }

    /// The digest.
    pub(crate) fn finish(self) -> Digest {
        Digest::from_bytes(self.0.finalize().into())
    }
}

/// The value, but "no data" as the one bit pattern that stands for it.
pub(crate) fn no_data_alike(value: f32) -> f32 {
    if value.is_nan() { f32::NAN } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_digest_is_that_of_the_written_down_bytes() {
        let values: Vec<f32> = (0..3000).map(|i| i as f32 / 7.0).collect();
        let mut bytes = b"k".to_vec();
        bytes.extend(5i64.to_le_bytes());
        bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
        let found = ValuesDigest::new("k").number(5).values(&values).finish();
        assert_eq!(found, Digest::of(&bytes));
    }

    #[test]
    fn every_no_data_is_the_same_and_every_value_counts() {
        let of = |values: &[f32]| ValuesDigest::new("k").values(values).finish();
        assert_eq!(of(&[1.0, -f32::NAN]), of(&[1.0, f32::NAN]));
        assert_ne!(
            of(&[1.0, 2.0]),
            of(&[1.0, f32::from_bits(2.0f32.to_bits() ^ 1)])
        );
    }
}
