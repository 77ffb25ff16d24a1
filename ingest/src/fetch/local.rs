//! Files on this machine's disks: any for the command line, those inside allowed folders for the service.

use std::fs::File;
use std::io::{self, Read as _};
use std::os::fd::AsRawFd as _;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use contract::event::RejectReason;

use super::checksum::{Check, Expected, wrong_size};
use super::location::file_name;
use super::raw::{Held, RawGranule, Stamp};
use super::retry::Miss;
use crate::error::{Rejection, Stop};
use crate::limits::Limits;

/// Bytes read at a time.
const READ_BYTES: usize = 1 << 20;

/// Reads any file, as its owner on the command line may.
pub(super) fn any(path: &Path, expected: &Expected, limits: Limits) -> Result<RawGranule, Stop> {
    // Asked before it is opened: opening a pipe waits for a writer.
    check_regular(path).map_err(|e| unreadable(&e))??;
    let file = File::open(path).map_err(|e| unreadable(&e))?;
    taken(file, path.to_owned(), file_name(path), expected, limits)
}

/// Reads a file that is inside one of some folders, links followed.
///
/// What was checked is what is read: the file is opened once, its true place is looked up from the open file, and the
/// reader process opens it through this process's handle, so that a link that changes meanwhile changes nothing.
pub(super) fn inside(
    folders: &[PathBuf],
    path: &Path,
    expected: &Expected,
    limits: Limits,
) -> Result<RawGranule, Miss> {
    let outside = || {
        let detail = "is not inside an allowed folder; put the file there, or allow its folder with --allow-folder";
        Stop::from(Rejection::new(RejectReason::Location, "path", detail))
    };
    let is_inside = |path: &Path| folders.iter().any(|folder| path.starts_with(folder));
    let is_plain =
        path.is_absolute() && !path.components().any(|part| part == Component::ParentDir);
    let real = match std::fs::canonicalize(path) {
        Ok(real) if is_inside(&real) => real,
        // Whether a file outside is there or not is nobody's business.
        Err(e) if is_plain && is_inside(path) => return Err(missed(&e)),
        Ok(_) | Err(_) => return Err(outside().into()),
    };
    check_regular(&real).map_err(|e| missed(&e))??;
    let file = File::open(&real).map_err(|e| missed(&e))?;
    let handle = format!("/proc/{}/fd/{}", std::process::id(), file.as_raw_fd());
    let handle = PathBuf::from(handle);
    let opened = std::fs::canonicalize(&handle).map_err(|e| missed(&e))?;
    if !is_inside(&opened) {
        return Err(outside().into());
    }
    Ok(taken(file, handle, file_name(path), expected, limits)?)
}

fn missed(error: &io::Error) -> Miss {
    match error.kind() {
        io::ErrorKind::NotFound | io::ErrorKind::PermissionDenied => {
            Miss::Absent(format!("it cannot be read: {error}"))
        }
        _ => Miss::Away(format!("it cannot be read: {error}")),
    }
}

fn unreadable(e: &io::Error) -> Rejection {
    Rejection::new(
        RejectReason::Unreadable,
        "file",
        format!("cannot be read: {e}"),
    )
}

/// What lies at the top of a store of Zarr 3, of Zarr 2, of Icechunk.
const OF_STORES: [&str; 5] = ["zarr.json", ".zgroup", ".zmetadata", ".zarray", "repo"];

fn check_regular(path: &Path) -> io::Result<Result<(), Rejection>> {
    let metadata = std::fs::metadata(path)?;
    if metadata.is_file() {
        return Ok(Ok(()));
    }
    let detail = if !metadata.is_dir() {
        "is no regular file; give a file"
    } else if OF_STORES.iter().any(|name| path.join(name).exists()) {
        "is a folder of a Zarr or Icechunk store; attach it with `fluxglobe attach`"
    } else {
        "is a folder and no regular file; give the files in it"
    };
    Ok(Err(Rejection::new(
        RejectReason::Unreadable,
        "file",
        detail,
    )))
}

/// Takes the digest of an open file.
fn taken(
    mut file: File,
    path: PathBuf,
    file_name: String,
    expected: &Expected,
    limits: Limits,
) -> Result<RawGranule, Stop> {
    let metadata = file.metadata().map_err(|e| unreadable(&e))?;
    if metadata.len() > limits.file_bytes {
        return Err(too_large(metadata.len(), limits.file_bytes).into());
    }
    if let Some(refused) = wrong_size(expected, metadata.len()) {
        return Err(refused.into());
    }
    let stamp = Stamp::of(&metadata);
    let mut check = Check::of(expected)?;
    let mut buffer = vec![0; READ_BYTES];
    loop {
        let count = file.read(&mut buffer).map_err(|e| unreadable(&e))?;
        if count == 0 {
            break;
        }
        check.update(&buffer[..count])?;
        if check.size_bytes() > limits.file_bytes {
            return Err(too_large(check.size_bytes(), limits.file_bytes).into());
        }
    }
    if check.size_bytes() != metadata.len() {
        return Err(crate::error::IngestError::Changed { file: path }.into());
    }
    let sha256 = check.finish(expected)??;
    let held = Held::Theirs(Arc::new(file));
    Ok(RawGranule::new(path, file_name, sha256, stamp, held))
}

/// The refusal of a file that is too large.
pub(super) fn too_large(bytes: u64, limit_bytes: u64) -> Rejection {
    let detail =
        format!("has {bytes} bytes, at most {limit_bytes} are read; give it in smaller pieces");
    Rejection::new(RejectReason::TooLarge, "file", detail)
}
