//! The header of NetCDF classic files (CDF-1, CDF-2 and CDF-5): bytes in, dimensions, variables and offsets out.
//!
//! Our own reader, because the crate `netcdf3` 0.6.1 does not suit hostile files: it parses the header anew for every
//! further KiB of it, ignores short reads, multiplies declared lengths unchecked, and allocates a variable before it
//! looks whether the file is long enough. Here every count is compared with the bytes that are left before it is used.
//!
//! Format: NetCDF Users Guide, appendix "File Format Specifications".

use super::corrupt;
use super::description::{
    AttributeValue, Attributes, Kind, MAX_ATTRIBUTE_NUMBERS, MAX_ATTRIBUTE_TEXT_BYTES,
    MAX_ATTRIBUTES, MAX_NAME_BYTES, MAX_RANK, MAX_VARIABLES,
};
use crate::error::Rejection;

/// Most dimensions a file may declare.
const MAX_DIMENSIONS: u64 = 4096;
/// Count of records of a file whose writer did not go back to fill it in.
const STREAMING_32: u64 = 0xffff_ffff;

const TAG_DIMENSIONS: u32 = 10;
const TAG_VARIABLES: u32 = 11;
const TAG_ATTRIBUTES: u32 = 12;

/// Which widths counts and offsets have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Version {
    /// CDF-1: 32-bit offsets.
    Classic,
    /// CDF-2: 64-bit offsets.
    Offset64,
    /// CDF-5: 64-bit offsets and counts.
    Data64,
}

impl Version {
    pub(super) fn of_magic(first: &[u8]) -> Option<Self> {
        match first.strip_prefix(b"CDF")?.first()? {
            1 => Some(Self::Classic),
            2 => Some(Self::Offset64),
            5 => Some(Self::Data64),
            _ => None,
        }
    }
}

/// The header of a file.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Header {
    /// Number of records; none if the writer left it open.
    pub(super) record_count: Option<u64>,
    pub(super) dimensions: Vec<(String, u64)>,
    pub(super) attributes: Attributes,
    pub(super) variables: Vec<HeaderVariable>,
}

/// A variable as the header has it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct HeaderVariable {
    pub(super) name: String,
    /// Indices into the dimensions of the file.
    pub(super) dimension_ids: Vec<usize>,
    pub(super) attributes: Attributes,
    pub(super) external: ExternalType,
    pub(super) begin_bytes: u64,
}

/// A type as it is stored, big-endian.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ExternalType {
    Char,
    Number(Kind),
}

impl ExternalType {
    fn of_code(code: u32) -> Option<Self> {
        Some(match code {
            1 => Self::Number(Kind::Integer(1)),
            2 => Self::Char,
            3 => Self::Number(Kind::Integer(2)),
            4 => Self::Number(Kind::Integer(4)),
            5 => Self::Number(Kind::Float(4)),
            6 => Self::Number(Kind::Float(8)),
            7 => Self::Number(Kind::Unsigned(1)),
            8 => Self::Number(Kind::Unsigned(2)),
            9 => Self::Number(Kind::Unsigned(4)),
            10 => Self::Number(Kind::Integer(8)),
            11 => Self::Number(Kind::Unsigned(8)),
            _ => return None,
        })
    }

    pub(super) fn size_bytes(self) -> u64 {
        match self {
            Self::Char | Self::Number(Kind::Text(_) | Kind::Other) => 1,
            Self::Number(Kind::Integer(n) | Kind::Unsigned(n) | Kind::Float(n)) => u64::from(n),
        }
    }

    pub(super) fn kind(self) -> Kind {
        match self {
            Self::Char => Kind::Text(1),
            Self::Number(kind) => kind,
        }
    }

    /// One stored number; `bytes` has [`ExternalType::size_bytes`] bytes.
    pub(super) fn number(self, bytes: &[u8]) -> f64 {
        match (self, bytes) {
            (Self::Number(Kind::Integer(_)), &[a]) => f64::from(a as i8),
            (Self::Char | Self::Number(_), &[a]) => f64::from(a),
            (Self::Number(Kind::Integer(_)), &[a, b]) => f64::from(i16::from_be_bytes([a, b])),
            (_, &[a, b]) => f64::from(u16::from_be_bytes([a, b])),
            (Self::Number(Kind::Integer(_)), &[a, b, c, d]) => {
                f64::from(i32::from_be_bytes([a, b, c, d]))
            }
            (Self::Number(Kind::Unsigned(_)), &[a, b, c, d]) => {
                f64::from(u32::from_be_bytes([a, b, c, d]))
            }
            (_, &[a, b, c, d]) => f64::from(f32::from_be_bytes([a, b, c, d])),
            (_, bytes) => match (self, <[u8; 8]>::try_from(bytes)) {
                (Self::Number(Kind::Integer(_)), Ok(bytes)) => i64::from_be_bytes(bytes) as f64,
                (Self::Number(Kind::Unsigned(_)), Ok(bytes)) => u64::from_be_bytes(bytes) as f64,
                (_, Ok(bytes)) => f64::from_be_bytes(bytes),
                (_, Err(_wrong_length)) => f64::NAN,
            },
        }
    }
}

/// Parses a header. `bytes` are the first bytes of the file, as many as may be header at all.
pub(super) fn parse(bytes: &[u8], version: Version) -> Result<Header, Rejection> {
    let mut cursor = Cursor {
        bytes,
        at: 4,
        version,
    };
    let record_count = cursor.count("the number of records")?;
    let streaming = if version == Version::Data64 {
        u64::MAX
    } else {
        STREAMING_32
    };
    let dimensions = cursor.dimensions()?;
    let attributes = cursor.attributes("file")?;
    let variables = cursor.variables(dimensions.len())?;
    let record_count = (record_count != streaming).then_some(record_count);
    Ok(Header {
        record_count,
        dimensions,
        attributes,
        variables,
    })
}

struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
    version: Version,
}

impl<'a> Cursor<'a> {
    fn take(&mut self, count: u64, what: &str) -> Result<&'a [u8], Rejection> {
        let left = self.bytes.get(self.at..).unwrap_or_default();
        let taken = usize::try_from(count).ok().and_then(|n| left.get(..n)).ok_or_else(|| {
            corrupt(what, format!("the header ends within it (byte {}); the file is truncated or damaged, fetch it again", self.at))
        })?;
        self.at += taken.len();
        Ok(taken)
    }

    fn u32(&mut self, what: &str) -> Result<u32, Rejection> {
        let bytes = self.take(4, what)?;
        Ok(bytes
            .iter()
            .fold(0, |value, byte| value << 8 | u32::from(*byte)))
    }

    fn u64(&mut self, what: &str) -> Result<u64, Rejection> {
        let bytes = self.take(8, what)?;
        Ok(bytes
            .iter()
            .fold(0, |value, byte| value << 8 | u64::from(*byte)))
    }

    /// A count or length: 32 bits, or 64 in CDF-5.
    fn count(&mut self, what: &str) -> Result<u64, Rejection> {
        if self.version == Version::Data64 {
            self.u64(what)
        } else {
            self.u32(what).map(u64::from)
        }
    }

    /// Bytes and their padding to a multiple of four.
    fn padded(&mut self, count: u64, what: &str) -> Result<&'a [u8], Rejection> {
        let bytes = self.take(count, what)?;
        self.take((4 - count % 4) % 4, what)?;
        Ok(bytes)
    }

    fn name(&mut self, what: &str) -> Result<String, Rejection> {
        let len = self.count(what)?;
        if len > MAX_NAME_BYTES as u64 {
            return Err(corrupt(
                what,
                format!("its name is {len} bytes long, at most {MAX_NAME_BYTES} are read"),
            ));
        }
        Ok(String::from_utf8_lossy(self.padded(len, what)?).into_owned())
    }

    /// Tag and length of a list; an absent list has neither elements nor a tag.
    fn list(&mut self, tag: u32, limit: u64, what: &str) -> Result<u64, Rejection> {
        let (found, count) = (self.u32(what)?, self.count(what)?);
        match (found, count) {
            (0, 0) => Ok(0),
            (found, count) if found == tag && count <= limit => Ok(count),
            (found, count) if found == tag => Err(corrupt(
                what,
                format!("{count} of them, at most {limit} are read"),
            )),
            (found, _) => Err(corrupt(
                what,
                format!("tag {found} where {tag} belongs; the file is damaged, fetch it again"),
            )),
        }
    }

    fn dimensions(&mut self) -> Result<Vec<(String, u64)>, Rejection> {
        let what = "list of dimensions";
        let count = self.list(TAG_DIMENSIONS, MAX_DIMENSIONS, what)?;
        (0..count)
            .map(|_| Ok((self.name(what)?, self.count(what)?)))
            .collect()
    }

    fn attributes(&mut self, owner: &str) -> Result<Attributes, Rejection> {
        let count = self.list(TAG_ATTRIBUTES, MAX_ATTRIBUTES as u64, owner)?;
        (0..count).map(|_| self.attribute(owner)).collect()
    }

    fn attribute(&mut self, owner: &str) -> Result<(String, AttributeValue), Rejection> {
        let name = self.name(owner)?;
        let external = self.external(&name)?;
        let count = self.count(&name)?;
        let size_bytes = count.checked_mul(external.size_bytes()).ok_or_else(|| {
            corrupt(
                &name,
                format!("an attribute of {count} values; the file is damaged"),
            )
        })?;
        let bytes = self.padded(size_bytes, &name)?;
        let value = if external == ExternalType::Char {
            let kept = &bytes[..bytes.len().min(MAX_ATTRIBUTE_TEXT_BYTES)];
            AttributeValue::Text(String::from_utf8_lossy(kept).into_owned())
        } else {
            let numbers = bytes
                .chunks_exact(external.size_bytes() as usize)
                .take(MAX_ATTRIBUTE_NUMBERS);
            AttributeValue::Numbers {
                kind: external.kind(),
                bits: numbers.map(|b| external.number(b).into()).collect(),
            }
        };
        Ok((name, value))
    }

    fn external(&mut self, what: &str) -> Result<ExternalType, Rejection> {
        let code = self.u32(what)?;
        let known =
            ExternalType::of_code(code).filter(|_| self.version == Version::Data64 || code <= 6);
        known.ok_or_else(|| {
            corrupt(
                what,
                format!("type {code} does not exist; the file is damaged, fetch it again"),
            )
        })
    }

    fn variables(&mut self, dimension_count: usize) -> Result<Vec<HeaderVariable>, Rejection> {
        let count = self.list(TAG_VARIABLES, MAX_VARIABLES as u64, "list of variables")?;
        (0..count).map(|_| self.variable(dimension_count)).collect()
    }

    fn variable(&mut self, dimension_count: usize) -> Result<HeaderVariable, Rejection> {
        let name = self.name("list of variables")?;
        let rank = self.count(&name)?;
        if rank > MAX_RANK as u64 {
            return Err(corrupt(
                &name,
                format!("{rank} dimensions, at most {MAX_RANK} are read"),
            ));
        }
        let mut dimension_ids = Vec::new();
        for _ in 0..rank {
            let id = self.count(&name)?;
            let known = usize::try_from(id).ok().filter(|id| *id < dimension_count);
            dimension_ids.push(known.ok_or_else(|| {
                corrupt(
                    &name,
                    format!("dimension {id} does not exist; the file is damaged"),
                )
            })?);
        }
        let attributes = self.attributes(&name)?;
        let external = self.external(&name)?;
        self.count(&name)?; // its size in bytes, which old writers get wrong: computed from the shape instead
        let begin_bytes = if self.version == Version::Classic {
            self.u32(&name)?.into()
        } else {
            self.u64(&name)?
        };
        Ok(HeaderVariable {
            name,
            dimension_ids,
            attributes,
            external,
            begin_bytes,
        })
    }
}
