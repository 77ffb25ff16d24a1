//! The generators of synthetic products: a size and a seed in, an HDF5 file out, the same bytes each time.
//!
//! The China Sea (12 months of 2009, or days of it) and the whole sea, with coasts, clouds and seasons that look right on a
//! globe. They are made up: every file says `synthetic = 1`. A file is whole or not there, and takes the place of nothing.

mod china_sea;
mod clouds;
mod globe;
mod grid;
mod land;
mod product;
mod steps;
mod writer;

use std::io::ErrorKind;
use std::path::Path;

use tempfile::NamedTempFile;

use crate::error::IngestError;

use china_sea::ChinaSea;
use globe::Globe;
use product::{KeptMonth, MadeUp};
pub use steps::GeneratedSteps;

/// Why a file is not written over, which may be the only one of its data.
const EXISTS: &str = "something is there: give another name, or remove it";

/// Is told of steps done, and of steps in all.
type Progress<'a> = &'a dyn Fn(usize, usize);

/// Writes the synthetic China Sea product. `scale` is 1 for 1800 x 2460 cells, 0.1 for 180 x 246.
///
/// # Errors
/// It cannot be made so, it cannot be written there, or something is there.
pub fn generate_china_sea(
    path: &Path,
    scale: f64,
    seed: u64,
    steps: GeneratedSteps,
    progress: Progress<'_>,
) -> Result<(), IngestError> {
    let china_sea = ChinaSea::new(scale, seed)
        .ok_or_else(|| format!("scale {scale} is not above 0.005 and at most 1"));
    whole(path, china_sea, steps, progress)
}

/// Writes the synthetic product of the whole sea, in cells of so many degrees, 0.01 to 5.
///
/// # Errors
/// It cannot be made so, it cannot be written there, or something is there.
pub fn generate_globe(
    path: &Path,
    degrees: f64,
    seed: u64,
    steps: GeneratedSteps,
    progress: Progress<'_>,
) -> Result<(), IngestError> {
    whole(path, Globe::new(degrees, seed), steps, progress)
}

/// Writes the file, whole or not at all, where nothing is.
fn whole(
    path: &Path,
    made_up: Result<impl MadeUp, String>,
    steps: GeneratedSteps,
    progress: Progress<'_>,
) -> Result<(), IngestError> {
    let failed = |detail: String| IngestError::Generate {
        file: path.to_owned(),
        detail,
    };
    let made_up = made_up.map_err(failed)?;
    if let Some(refusal) = steps.refusal() {
        return Err(failed(refusal));
    }
    if path.exists() {
        return Err(failed(EXISTS.to_owned()));
    }
    let edges = steps.edges_days();
    let step_count = edges.len() - 1;
    // A reader never sees half a file.
    let part = part_of(path).map_err(|e| failed(e.to_string()))?;
    let part = part.into_temp_path();
    let mut kept = KeptMonth::default();
    let texts = (made_up.texts(), steps.title());
    let written = writer::write(&part, made_up.grid(), texts, &edges, |step, rows| {
        progress(step, step_count);
        kept.day_values(&made_up, steps.month_and_strength(step), rows)
    });
    written.map_err(|e| failed(e.to_string()))?;
    part.persist_noclobber(path)
        .map_err(|e| match e.error.kind() {
            ErrorKind::AlreadyExists => failed(EXISTS.to_owned()),
            _ => failed(e.error.to_string()),
        })?;
    progress(step_count, step_count);
    Ok(())
}

/// An unfinished file beside what it will be, which goes if it is never finished.
fn part_of(path: &Path) -> std::io::Result<NamedTempFile> {
    let folder = path.parent().filter(|own| !own.as_os_str().is_empty());
    let mut builder = tempfile::Builder::new();
    builder.prefix(".generate-");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        // Like any other file, as far as the user's mask lets it.
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder.unwrap_or(Path::new(".")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bytes(seed: u64, generate: impl Fn(&Path, u64) -> Result<(), IngestError>) -> Vec<u8> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("made-up.nc");
        generate(&path, seed).unwrap();
        std::fs::read(path).unwrap()
    }

    #[test]
    fn the_same_seed_gives_the_same_bytes_and_another_one_others() {
        let china_sea = |path: &Path, seed| {
            generate_china_sea(path, 0.02, seed, GeneratedSteps::Months, &|_, _| {})
        };
        let globe = |path: &Path, seed| {
            generate_globe(path, 5.0, seed, GeneratedSteps::Days(2), &|_, _| {})
        };
        let first = (bytes(1, china_sea), bytes(1, globe));
        std::thread::sleep(std::time::Duration::from_millis(1100)); // past a second, in case a time stamp were written
        assert!(first == (bytes(1, china_sea), bytes(1, globe)));
        assert!(first.0 != bytes(2, china_sea) && first.1 != bytes(2, globe));
    }

    #[test]
    fn what_cannot_be_made_is_refused_and_leaves_no_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("none.nc");
        let none = generate_china_sea(&path, 0.02, 1, GeneratedSteps::Days(0), &|_, _| {});
        assert!(none.unwrap_err().to_string().contains("0 days"));
        let seven = generate_globe(&path, 7.0, 1, GeneratedSteps::Months, &|_, _| {});
        assert!(seven.unwrap_err().to_string().contains("7 degrees"));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    /// Names in a folder, with the bytes of each.
    fn held(folder: &Path) -> Vec<(std::ffi::OsString, Vec<u8>)> {
        let entries = std::fs::read_dir(folder).unwrap();
        let mut held: Vec<_> = entries
            .map(|entry| {
                let entry = entry.unwrap();
                (entry.file_name(), std::fs::read(entry.path()).unwrap())
            })
            .collect();
        held.sort();
        held
    }

    #[test]
    fn a_file_takes_the_place_of_nothing_and_touches_nothing_beside_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mine.nc");
        std::fs::write(&path, "a year of measurements").unwrap();
        std::fs::write(folder.path().join("mine.part"), "a part of them").unwrap();
        let before = held(folder.path());
        let made = |path: &Path, told: Progress<'_>| {
            generate_china_sea(path, 0.02, 1, GeneratedSteps::Days(2), told)
        };
        let refused = made(&path, &|_, _| {}).unwrap_err().to_string();
        assert!(refused.contains("mine.nc"), "{refused}");
        assert!(refused.contains("something is there"), "{refused}");
        assert_eq!(held(folder.path()), before);
        // Nor of what has come while it was made.
        std::fs::remove_file(&path).unwrap();
        let comes = |_: usize, _: usize| std::fs::write(&path, "a year of measurements").unwrap();
        let refused = made(&path, &comes).unwrap_err().to_string();
        assert!(refused.contains("something is there"), "{refused}");
        assert_eq!(held(folder.path()), before);
        // Where nothing is, the file alone comes to be there.
        std::fs::remove_file(&path).unwrap();
        made(&path, &|_, _| {}).unwrap();
        assert_eq!(held(folder.path()).len(), 2);
    }

    #[test]
    fn what_ends_in_the_middle_leaves_nothing_behind() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("half.nc");
        let ended = std::panic::catch_unwind(|| {
            generate_china_sea(&path, 0.02, 1, GeneratedSteps::Days(2), &|done, _| {
                assert_eq!(done, 0, "the second step ends it");
            })
        });
        assert!(ended.is_err());
        assert_eq!(held(folder.path()), []);
    }
}
