//! Digests that a sender gives with a file, and the comparison.

use contract::digest::Digest;
use contract::event::RejectReason;
use openssl::hash::{Hasher, MessageDigest};

use crate::error::{IngestError, Rejection};

/// What the sender says of a file.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Expected {
    pub(crate) sha256: Option<Digest>,
    pub(crate) size_bytes: Option<u64>,
    /// Another digest, as lower-case hexadecimal text.
    pub(crate) other: Option<(Method, String)>,
}

/// A way to take a digest, besides SHA-256.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Method {
    Md5,
    Sha1,
    Sha512,
}

impl Method {
    fn name(self) -> &'static str {
        match self {
            Self::Md5 => "MD5",
            Self::Sha1 => "SHA-1",
            Self::Sha512 => "SHA-512",
        }
    }

    fn digest(self) -> MessageDigest {
        match self {
            Self::Md5 => MessageDigest::md5(),
            Self::Sha1 => MessageDigest::sha1(),
            Self::Sha512 => MessageDigest::sha512(),
        }
    }
}

/// Takes the digests of a file while it goes by.
pub(super) struct Check {
    sha256: Hasher,
    other: Option<(Method, Hasher)>,
    size_bytes: u64,
}

impl Check {
    pub(super) fn of(expected: &Expected) -> Result<Self, IngestError> {
        let other = match expected.other {
            Some((method, _)) => Some((method, hasher(method.digest())?)),
            None => None,
        };
        Ok(Self {
            sha256: hasher(MessageDigest::sha256())?,
            other,
            size_bytes: 0,
        })
    }

    pub(super) fn size_bytes(&self) -> u64 {
        self.size_bytes
    }

    pub(super) fn update(&mut self, bytes: &[u8]) -> Result<(), IngestError> {
        self.size_bytes += bytes.len() as u64;
        self.sha256.update(bytes).map_err(failed)?;
        if let Some((_, hasher)) = &mut self.other {
            hasher.update(bytes).map_err(failed)?;
        }
        Ok(())
    }

    /// The digest, and the refusal of a file that is not the one its sender speaks of.
    pub(super) fn finish(
        mut self,
        expected: &Expected,
    ) -> Result<Result<Digest, Rejection>, IngestError> {
        let sha256 = hex(&self.sha256.finish().map_err(failed)?);
        let digest: Digest = sha256.parse()?;
        if let Some(refused) = wrong_size(expected, self.size_bytes) {
            return Ok(Err(refused));
        }
        if expected.sha256.is_some_and(|wanted| wanted != digest) {
            let wanted = expected.sha256.map(|wanted| wanted.to_string());
            return Ok(Err(mismatch(
                "SHA-256",
                &sha256,
                &wanted.unwrap_or_default(),
            )));
        }
        if let (Some((method, hasher)), Some((_, wanted))) = (&mut self.other, &expected.other) {
            let found = hex(&hasher.finish().map_err(failed)?);
            if found != *wanted {
                return Ok(Err(mismatch(method.name(), &found, wanted)));
            }
        }
        Ok(Ok(digest))
    }
}

/// The refusal of a file that has another size than its sender says.
pub(super) fn wrong_size(expected: &Expected, size_bytes: u64) -> Option<Rejection> {
    let wanted = expected.size_bytes.filter(|wanted| *wanted != size_bytes)?;
    let detail = format!(
        "has {size_bytes} bytes, its notice says {wanted}; send a notice of the file as it is"
    );
    Some(Rejection::new(RejectReason::Checksum, "file", detail))
}

fn mismatch(method: &str, found: &str, wanted: &str) -> Rejection {
    let detail = format!(
        "has the {method} digest {found}, its notice says {wanted}; send a notice of the file as it is"
    );
    Rejection::new(RejectReason::Checksum, "file", detail)
}

fn hasher(digest: MessageDigest) -> Result<Hasher, IngestError> {
    Hasher::new(digest).map_err(failed)
}

fn failed(source: openssl::error::ErrorStack) -> IngestError {
    IngestError::Digest { source }
}

fn hex(bytes: &[u8]) -> String {
    use std::fmt::Write as _;
    bytes.iter().fold(String::new(), |mut text, byte| {
        write!(text, "{byte:02x}").expect("a string takes everything");
        text
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(content: &[u8], expected: &Expected) -> Result<Digest, Rejection> {
        let mut check = Check::of(expected).unwrap();
        content.chunks(2).for_each(|c| check.update(c).unwrap());
        check.finish(expected).unwrap()
    }

    /// The digests of "abc" as RFC 1321 and FIPS 180-4 give them.
    #[test]
    fn digests_are_those_of_the_standards() {
        let others = [
            (Method::Md5, "900150983cd24fb0d6963f7d28e17f72"),
            (Method::Sha1, "a9993e364706816aba3e25717850c26c9cd0d89d"),
        ];
        for (method, text) in others {
            let expected = Expected {
                sha256: Some(Digest::of(b"abc")),
                size_bytes: Some(3),
                other: Some((method, text.to_owned())),
            };
            assert_eq!(of(b"abc", &expected).unwrap(), Digest::of(b"abc"));
            let refused = of(
                b"abd",
                &Expected {
                    sha256: None,
                    ..expected
                },
            )
            .unwrap_err();
            assert_eq!(refused.reason, RejectReason::Checksum);
            assert!(refused.detail.contains(text), "{refused}");
        }
        let expected = Expected {
            sha256: Some(Digest::of(b"abc")),
            ..Expected::default()
        };
        assert!(
            of(b"abd", &expected)
                .unwrap_err()
                .detail
                .contains("SHA-256")
        );
    }

    #[test]
    fn another_size_is_another_file() {
        let expected = Expected {
            size_bytes: Some(4),
            ..Expected::default()
        };
        assert_eq!(
            of(b"abc", &expected).unwrap_err().reason,
            RejectReason::Checksum
        );
    }
}
