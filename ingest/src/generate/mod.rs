//! The generators of synthetic products: a size and a seed in, an HDF5 file out, the same bytes each time.
//!
//! The China Sea (12 months of 2009, or days of it) and the whole sea, with coasts, clouds and seasons that look right on a
//! globe. They are made up: every file says `synthetic = 1`.

mod china_sea;
mod clouds;
mod globe;
mod grid;
mod land;
mod product;
mod steps;
mod writer;

use std::path::Path;

use crate::error::IngestError;

use china_sea::ChinaSea;
use globe::Globe;
use product::{KeptMonth, MadeUp};
pub use steps::GeneratedSteps;

/// Is told of steps done, and of steps in all.
type Progress<'a> = &'a dyn Fn(usize, usize);

/// Writes the synthetic China Sea product. `scale` is 1 for 1800 x 2460 cells, 0.1 for 180 x 246.
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
pub fn generate_globe(
    path: &Path,
    degrees: f64,
    seed: u64,
    steps: GeneratedSteps,
    progress: Progress<'_>,
) -> Result<(), IngestError> {
    whole(path, Globe::new(degrees, seed), steps, progress)
}

/// Writes the file, whole or not at all.
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
    let edges = steps.edges_days();
    let step_count = edges.len() - 1;
    // A reader never sees half a file.
    let part = path.with_extension("part");
    let mut kept = KeptMonth::default();
    let texts = (made_up.texts(), steps.title());
    let written = writer::write(&part, made_up.grid(), texts, &edges, |step, rows| {
        progress(step, step_count);
        kept.day_values(&made_up, steps.month_and_strength(step), rows)
    });
    written.map_err(|e| failed(e.to_string()))?;
    std::fs::rename(&part, path).map_err(|e| failed(e.to_string()))?;
    progress(step_count, step_count);
    Ok(())
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
}
