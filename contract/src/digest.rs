//! SHA-256 digests as lower-case hexadecimal text: the names of immutable things.

use std::fmt::{Display, Formatter};
use std::io;

use serde::de::Visitor;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use sha2::{Digest as _, Sha256};

use crate::ContractError;

/// A SHA-256 digest, shown as 64 lower-case hexadecimal digits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Digest([u8; 32]);

const DIGITS: &[u8; 16] = b"0123456789abcdef";

impl Digest {
    /// Digest of some bytes.
    pub fn of(bytes: &[u8]) -> Self {
        Self(Sha256::digest(bytes).into())
    }

    /// The digest that a hasher ended with, for content that is read in pieces.
    pub fn from_bytes(sha256: [u8; 32]) -> Self {
        Self(sha256)
    }

    /// Its 32 bytes.
    pub fn as_bytes(&self) -> &[u8; 32] {
        &self.0
    }

    /// Digest of a value's canonical JSON: fields in declaration order, no white space.
    ///
    /// # Panics
    /// Never: the types that are hashed have string keys only, which JSON can always hold.
    pub fn of_json<T: Serialize>(value: &T) -> Self {
        let mut hashing = Hashing::default();
        serde_json::to_writer(&mut hashing, value).expect("hashed types have string keys only");
        hashing.digest()
    }

    /// The first eight hexadecimal digits, for people.
    pub fn short(&self) -> String {
        self.to_string()[..8].to_owned()
    }
}

/// Bytes that are hashed together: less takes longer.
const HASHED_BYTES: usize = 16 << 10;

/// Hashes a text as it is written. That of a region of very many corners takes tens of megabytes, and is never held.
#[derive(Default)]
struct Hashing {
    sha256: Sha256,
    /// What is not hashed yet.
    written: Vec<u8>,
}

impl Hashing {
    fn digest(mut self) -> Digest {
        self.sha256.update(&self.written);
        Digest(self.sha256.finalize().into())
    }
}

impl io::Write for Hashing {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.written.extend_from_slice(bytes);
        if self.written.len() >= HASHED_BYTES {
            self.sha256.update(&self.written);
            self.written.clear();
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Digits of a digest. Manifests hold thousands: put by `write!` byte by byte they were most of the time of a long one.
struct HexText([u8; 64]);

impl HexText {
    fn of(digest: &Digest) -> Self {
        let mut text = [0; 64];
        for (pair, byte) in text.chunks_exact_mut(2).zip(digest.0) {
            pair[0] = DIGITS[usize::from(byte >> 4)];
            pair[1] = DIGITS[usize::from(byte & 15)];
        }
        Self(text)
    }

    fn as_str(&self) -> &str {
        str::from_utf8(&self.0).expect("digits are ASCII")
    }
}

impl Display for Digest {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str(HexText::of(self).as_str())
    }
}

impl std::str::FromStr for Digest {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let bad = || ContractError::invalid("digest", s, "64 lower-case hexadecimal digits");
        let digit = |byte: u8| match byte {
            b'0'..=b'9' => Some(byte - b'0'),
            b'a'..=b'f' => Some(byte - b'a' + 10),
            _ => None,
        };
        if s.len() != 64 {
            return Err(bad());
        }
        let mut bytes = [0; 32];
        for (byte, pair) in bytes.iter_mut().zip(s.as_bytes().chunks_exact(2)) {
            let [high, low] = [pair[0], pair[1]].map(digit);
            *byte = high
                .zip(low)
                .map(|(high, low)| high << 4 | low)
                .ok_or_else(bad)?;
        }
        Ok(Self(bytes))
    }
}

impl Serialize for Digest {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(HexText::of(self).as_str())
    }
}

impl<'de> Deserialize<'de> for Digest {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct OfText;
        impl Visitor<'_> for OfText {
            type Value = Digest;

            fn expecting(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
                f.write_str("64 lower-case hexadecimal digits")
            }

            fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<Digest, E> {
                text.parse().map_err(E::custom)
            }
        }
        deserializer.deserialize_str(OfText)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_empty_digest_is_the_published_one() {
        let text = Digest::of(b"").to_string();
        assert_eq!(
            text,
            "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"
        );
        assert_eq!(text.parse::<Digest>().unwrap(), Digest::of(b""));
    }

    #[test]
    fn json_of_any_length_has_the_digest_of_its_text() {
        for length in [0, 1, HASHED_BYTES - 3, HASHED_BYTES, 5 * HASHED_BYTES + 7] {
            let value = ("x".repeat(length), vec![-1.5e-7; length]);
            let text = serde_json::to_vec(&value).unwrap();
            assert_eq!(Digest::of_json(&value), Digest::of(&text), "{length}");
        }
    }

    #[test]
    fn json_holds_the_digits_and_nothing_else_is_taken() {
        for seed in 0..100_u8 {
            let digest = Digest::of(&[seed]);
            let byte_text = |byte: &u8| format!("{byte:02x}");
            let text: Vec<String> = digest.as_bytes().iter().map(byte_text).collect();
            let text = text.concat();
            assert_eq!(digest.to_string(), text);
            let json = serde_json::to_string(&digest).unwrap();
            assert_eq!(json, format!("\"{text}\""));
            assert_eq!(serde_json::from_str::<Digest>(&json).unwrap(), digest);
            for bad in [
                &text[1..],
                &format!("{text}0"),
                &text.to_uppercase(),
                &text.replace('0', "g"),
            ] {
                let is_same = bad == text;
                assert_eq!(bad.parse::<Digest>().is_ok(), is_same, "{bad}");
                let json = format!("\"{bad}\"");
                assert_eq!(
                    serde_json::from_str::<Digest>(&json).is_ok(),
                    is_same,
                    "{bad}"
                );
            }
        }
    }
}
