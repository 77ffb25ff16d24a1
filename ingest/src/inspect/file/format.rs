//! Which format a file has, from its first bytes.

use std::fs::File;
use std::io::{Read as _, Seek as _, SeekFrom};
use std::path::Path;

use contract::event::RejectReason;

use super::netcdf3_header::Version;
use crate::error::Rejection;

/// First bytes of an HDF5 superblock.
const HDF5_MAGIC: [u8; 8] = [0x89, b'H', b'D', b'F', b'\r', b'\n', 0x1a, b'\n'];
/// An HDF5 superblock may stand at 0, 512, 1024, ...; farther ones are not looked for.
const LAST_SUPERBLOCK_BYTES: u64 = 1 << 20;

/// A format that can be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Format {
    NetCdf3(Version),
    Hdf5,
}

/// Looks at the first bytes of a file.
pub(super) fn detect(path: &Path) -> Result<Format, Rejection> {
    let unreadable = |e: std::io::Error| {
        Rejection::new(
            RejectReason::Unreadable,
            "file",
            format!("cannot be read: {e}"),
        )
    };
    let mut file = File::open(path).map_err(unreadable)?;
    let mut first = Vec::new();
    (&mut file)
        .take(8)
        .read_to_end(&mut first)
        .map_err(unreadable)?;
    if let Some(version) = Version::of_magic(&first) {
        return Ok(Format::NetCdf3(version));
    }
    if first == HDF5_MAGIC {
        return Ok(Format::Hdf5);
    }
    let mut at_bytes = 512;
    while at_bytes <= LAST_SUPERBLOCK_BYTES {
        let mut magic = [0; 8];
        file.seek(SeekFrom::Start(at_bytes)).map_err(unreadable)?;
        if file.read_exact(&mut magic).is_err() {
            break;
        }
        if magic == HDF5_MAGIC {
            return Ok(Format::Hdf5);
        }
        at_bytes *= 2;
    }
    Err(Rejection::new(
        RejectReason::Unreadable,
        "file",
        explain(&first),
    ))
}

/// What the first bytes look like instead, and what to do.
fn explain(first: &[u8]) -> String {
    let advice = "give a NetCDF classic, NetCDF-4 or HDF5 file";
    if first.is_empty() {
        return "is empty; fetch it again".to_owned();
    }
    let known: [(&[u8], &str); 5] = [
        (b"\x1f\x8b", "is compressed with gzip; unpack it first"),
        (b"PK\x03\x04", "is a zip archive; unpack it first"),
        (
            b"\x0e\x03\x13\x01",
            "is HDF4, which is not read; convert it to NetCDF first",
        ),
        (
            b"GRIB",
            "is GRIB, which is not read; convert it to NetCDF first",
        ),
        (b"BZh", "is compressed with bzip2; unpack it first"),
    ];
    if let Some((_, text)) = known.iter().find(|(magic, _)| first.starts_with(magic)) {
        return (*text).to_owned();
    }
    let is_text = first
        .iter()
        .all(|b| b.is_ascii_graphic() || b.is_ascii_whitespace());
    if is_text {
        let start = String::from_utf8_lossy(first);
        return format!(
            "is text (it starts with {:?}), whatever its name says; {advice}",
            start.trim()
        );
    }
    format!("has no known format; {advice}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(bytes: &[u8]) -> Result<Format, Rejection> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("any-name.nc");
        std::fs::write(&path, bytes).unwrap();
        detect(&path)
    }

    #[test]
    fn the_first_bytes_decide_and_not_the_name() {
        assert_eq!(
            of(b"CDF\x01\0\0\0\0").unwrap(),
            Format::NetCdf3(Version::Classic)
        );
        assert_eq!(
            of(b"CDF\x02\0\0\0\0").unwrap(),
            Format::NetCdf3(Version::Offset64)
        );
        assert_eq!(of(&HDF5_MAGIC).unwrap(), Format::Hdf5);
        let mut behind_a_user_block = vec![b' '; 512];
        behind_a_user_block.extend(HDF5_MAGIC);
        assert_eq!(of(&behind_a_user_block).unwrap(), Format::Hdf5);
    }

    #[test]
    fn what_it_is_instead_is_said() {
        assert!(
            of(b"lat,lon,flux\n1,2,3\n")
                .unwrap_err()
                .detail
                .contains("is text")
        );
        assert!(of(b"").unwrap_err().detail.contains("empty"));
        assert!(of(b"\x1f\x8b\x08").unwrap_err().detail.contains("gzip"));
        assert!(
            of(&[0xff; 40])
                .unwrap_err()
                .detail
                .contains("no known format")
        );
    }
}
