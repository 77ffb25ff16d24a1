//! `fluxglobe generate`: a size and a seed in, a synthetic file out, or one a year.

use std::path::{Path, PathBuf};

use anyhow::{Result, ensure};
use ingest::{GeneratedSteps, IngestError};

use crate::cli::{Generate, GeneratedFile};
use crate::progress;

/// The first year that is made up.
const FIRST_YEAR: u16 = 2009;

pub(crate) fn run(options: Generate) -> Result<()> {
    match options {
        Generate::ChinaSea {
            scale,
            file,
            output,
        } => {
            ensure!(
                (0.01..=1.0).contains(&scale),
                "--scale {scale}: give 0.01 to 1"
            );
            files(file, &output, |own, steps| {
                china_sea(own, scale, file.seed, steps)
            })
        }
        Generate::Globe {
            degrees,
            file,
            output,
        } => files(file, &output, |own, steps| {
            globe(own, degrees, file.seed, steps)
        }),
    }
}

/// Writes the file that is asked for, or one a year, and prints their names; nothing if one of them is there.
fn files(
    asked: GeneratedFile,
    output: &Path,
    write: impl Fn(&Path, GeneratedSteps) -> Result<()>,
) -> Result<()> {
    let all = asked_for(asked, output);
    // Before the first is written: the last of many years is long after it.
    for (own, _steps) in &all {
        ensure!(
            !own.exists(),
            "{} is there, and nothing was written: give another --output, or remove it",
            own.display()
        );
    }
    for (own, steps) in all {
        write(&own, steps)?;
        progress::result(&own.display().to_string())?;
    }
    Ok(())
}

/// The files, each with its steps.
fn asked_for(asked: GeneratedFile, output: &Path) -> Vec<(PathBuf, GeneratedSteps)> {
    if let Some(count) = asked.years {
        return (FIRST_YEAR..FIRST_YEAR + count)
            .map(|year| (of_year(output, year), GeneratedSteps::Year(year)))
            .collect();
    }
    let steps = asked
        .days
        .map_or(GeneratedSteps::Months, GeneratedSteps::Days);
    vec![(output.to_owned(), steps)]
}

/// `china-sea.h5` and 2010 make `china-sea-2010.h5`.
fn of_year(output: &Path, year: u16) -> PathBuf {
    let stem = output.file_stem().unwrap_or_default().to_string_lossy();
    let mut name = format!("{stem}-{year}");
    if let Some(ending) = output.extension() {
        name = format!("{name}.{}", ending.to_string_lossy());
    }
    output.with_file_name(name)
}

/// Writes the synthetic China Sea with a progress bar.
pub(crate) fn china_sea(output: &Path, scale: f64, seed: u64, steps: GeneratedSteps) -> Result<()> {
    with_bar("generate China Sea", output, |told| {
        ingest::generate_china_sea(output, scale, seed, steps, told)
    })
}

/// Writes the synthetic globe with a progress bar.
fn globe(output: &Path, degrees: f64, seed: u64, steps: GeneratedSteps) -> Result<()> {
    with_bar("generate globe", output, |told| {
        ingest::generate_globe(output, degrees, seed, steps, told)
    })
}

fn with_bar(
    what: &'static str,
    output: &Path,
    generate: impl Fn(&dyn Fn(usize, usize)) -> Result<(), IngestError>,
) -> Result<()> {
    let bar = progress::bar(what, 1);
    generate(&|done, all| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
    })?;
    progress::done(&bar, &format!("SYNTHETIC data in {}", output.display()));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::RefCell;

    #[test]
    fn of_many_years_none_is_written_if_one_is_there() {
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("sea.h5");
        let kept = folder.path().join("sea-2011.h5");
        std::fs::write(&kept, "mine").unwrap();
        let asked = GeneratedFile {
            seed: 1,
            days: None,
            years: Some(3),
        };
        let written = RefCell::new(vec![]);
        let write = |own: &Path, _steps: GeneratedSteps| {
            written.borrow_mut().push(own.to_owned());
            Ok(())
        };
        let refused = files(asked, &output, write).unwrap_err().to_string();
        assert!(refused.contains("sea-2011.h5 is there"), "{refused}");
        assert!(written.borrow().is_empty(), "{written:?}");

        std::fs::remove_file(&kept).unwrap();
        files(asked, &output, write).unwrap();
        let own = [2009, 2010, 2011].map(|year| of_year(&output, year));
        assert_eq!(*written.borrow(), own);

        let months = GeneratedFile {
            years: None,
            ..asked
        };
        std::fs::write(&output, "mine").unwrap();
        let refused = files(months, &output, write).unwrap_err().to_string();
        assert!(refused.contains("sea.h5 is there"), "{refused}");
        assert_eq!(written.borrow().len(), 3);
    }
}
