//! What a render worker and its callers agree on: messages, their limits and the versions that understand each other.

use std::time::Duration;

use contract::ContractError;
use contract::encoding::Encoding;
use contract::job::RENDERER_VERSION;
use render::plan::Part;
use tonic::metadata::MetadataMap;

use crate::desk::Storing;

pub mod proto {
    //! Types made from `proto/render.proto`.
    #![expect(
        clippy::pedantic,
        clippy::allow_attributes_without_reason,
        reason = "generated code keeps its generator's style"
    )]
    tonic::include_proto!("fluxglobe.render.v1");
}

/// Largest request; a job's JSON takes about a kilobyte.
pub const MOST_REQUEST_BYTES: usize = 64 << 10;
/// Largest reply: a picture of 7680 x 4320 pixels that does not compress at all.
pub const MOST_REPLY_BYTES: usize = 160 << 20;
/// Metadata of a refusal: when to ask again, milliseconds.
const RETRY_AFTER: &str = "retry-after-ms";
/// A hint that is longer than this is a mistake or a trick.
const LONGEST_HINT: Duration = Duration::from_mins(1);

/// What two processes must have in common to exchange pictures.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Version {
    /// Version of the program.
    pub program: String,
    /// [`RENDERER_VERSION`].
    pub renderer: u32,
}

impl Version {
    /// Of this program.
    pub fn own() -> Self {
        Self {
            program: env!("CARGO_PKG_VERSION").to_owned(),
            renderer: RENDERER_VERSION,
        }
    }

    /// Why this one does not understand the other; none if it does.
    pub(crate) fn quarrel(&self, other: Option<&proto::Version>) -> Option<String> {
        let Some(other) = other else {
            return Some(format!("it names no version, this one is {self}"));
        };
        let other = Self {
            program: other.program.chars().take(64).collect(),
            renderer: other.renderer,
        };
        (other != *self).then(|| {
            format!("it is {other}, this one is {self}; run one version of fluxglobe everywhere")
        })
    }
}

impl std::fmt::Display for Version {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "program {} with renderer {}",
            self.program, self.renderer
        )
    }
}

impl From<Version> for proto::Version {
    fn from(version: Version) -> Self {
        Self {
            program: version.program,
            renderer: version.renderer,
        }
    }
}

impl From<Storing> for proto::Storing {
    fn from(storing: Storing) -> Self {
        match storing {
            Storing::LookUpAndKeep => Self::Unspecified,
            Storing::Keep => Self::Keep,
            Storing::Nothing => Self::Nothing,
        }
    }
}

impl From<proto::Storing> for Storing {
    fn from(code: proto::Storing) -> Self {
        match code {
            proto::Storing::Unspecified => Self::LookUpAndKeep,
            proto::Storing::Keep => Self::Keep,
            proto::Storing::Nothing => Self::Nothing,
        }
    }
}

impl From<Part> for proto::Part {
    fn from(part: Part) -> Self {
        let ([left, top], [width, height]) = (part.origin_px, part.size_px);
        Self {
            left,
            top,
            width,
            height,
        }
    }
}

impl From<proto::Part> for Part {
    fn from(part: proto::Part) -> Self {
        Self {
            origin_px: [part.left, part.top],
            size_px: [part.width, part.height],
        }
    }
}

/// An encoding as a number: 0 or the quality of a JPEG.
pub(crate) fn jpeg_quality(encoding: Encoding) -> u32 {
    match encoding {
        Encoding::Png => 0,
        Encoding::Jpeg { quality } => quality.into(),
    }
}

/// The encoding of such a number.
pub(crate) fn read_encoding(jpeg_quality: u32) -> Result<Encoding, ContractError> {
    match jpeg_quality {
        0 => Ok(Encoding::Png),
        quality => Encoding::jpeg(quality.try_into().unwrap_or(u8::MAX)),
    }
}

/// Metadata that says when to ask again.
pub(crate) fn retry_after(wait: Duration) -> MetadataMap {
    let mut metadata = MetadataMap::new();
    metadata.insert(RETRY_AFTER, (wait.as_millis() as u64).into());
    metadata
}

/// When to ask again, if metadata says so.
pub(crate) fn read_retry_after(metadata: &MetadataMap) -> Option<Duration> {
    let text = metadata.get(RETRY_AFTER)?.to_str().ok()?;
    let wait = Duration::from_millis(text.parse().ok()?);
    Some(wait.min(LONGEST_HINT))
}

/// The time that a caller gives, from the metadata of the gRPC specification: digits and a unit.
pub(crate) fn read_timeout(metadata: &MetadataMap) -> Option<Duration> {
    let text = metadata.get("grpc-timeout")?.to_str().ok()?;
    let (digits, unit) = text.split_at_checked(text.len().checked_sub(1)?)?;
    // At most eight digits, says the specification.
    if digits.len() > 8 {
        return None;
    }
    let count: u64 = digits.parse().ok()?;
    Some(match unit {
        "H" => Duration::from_secs(count * 3600),
        "M" => Duration::from_secs(count * 60),
        "S" => Duration::from_secs(count),
        "m" => Duration::from_millis(count),
        "u" => Duration::from_micros(count),
        "n" => Duration::from_nanos(count),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn timeouts_are_read_in_every_unit_and_nonsense_is_none() {
        let read = |text: &str| {
            let mut metadata = MetadataMap::new();
            metadata.insert("grpc-timeout", text.parse().unwrap());
            read_timeout(&metadata)
        };
        assert_eq!(read("3H"), Some(Duration::from_hours(3)));
        assert_eq!(read("250m"), Some(Duration::from_millis(250)));
        assert_eq!(read("30000000u"), Some(Duration::from_secs(30)));
        for nonsense in ["", "m", "1", "-1S", "999999999S", "1x", "1.5S"] {
            assert_eq!(read(nonsense), None, "{nonsense:?}");
        }
    }

    #[test]
    fn a_hint_travels_and_an_absurd_one_is_bounded() {
        let wait = Duration::from_millis(1500);
        assert_eq!(read_retry_after(&retry_after(wait)), Some(wait));
        let year = retry_after(Duration::from_hours(8760));
        assert_eq!(read_retry_after(&year), Some(LONGEST_HINT));
    }

    #[test]
    fn versions_that_differ_are_both_named() {
        let own = Version::own();
        let same = proto::Version::from(own.clone());
        assert_eq!(own.quarrel(Some(&same)), None);
        let other = proto::Version {
            program: "9.9.9".to_owned(),
            renderer: own.renderer + 1,
        };
        let text = own.quarrel(Some(&other)).unwrap();
        assert!(
            text.contains("9.9.9") && text.contains(&own.program),
            "{text}"
        );
        assert!(own.quarrel(None).is_some());
    }
}
