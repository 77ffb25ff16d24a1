//! `fluxglobe generate`: a size and a seed in, a synthetic file out, or one a year.

use std::path::{Path, PathBuf};

use anyhow::{Result, ensure};
use ingest::GeneratedSteps;

use crate::cli::Generate;
use crate::progress;

/// The first year that is made up.
const FIRST_YEAR: u16 = 2009;

pub(crate) fn run(options: Generate) -> Result<()> {
    let Generate::ChinaSea {
        scale,
        seed,
        days,
        years,
        output,
    } = options;
    ensure!(
        (0.01..=1.0).contains(&scale),
        "--scale {scale}: give 0.01 to 1"
    );
    if let Some(count) = years {
        for year in FIRST_YEAR..FIRST_YEAR + count {
            let own = of_year(&output, year);
            china_sea(&own, scale, seed, GeneratedSteps::Year(year))?;
            progress::result(&own.display().to_string())?;
        }
        return Ok(());
    }
    let steps = days.map_or(GeneratedSteps::Months, GeneratedSteps::Days);
    china_sea(&output, scale, seed, steps)?;
    progress::result(&output.display().to_string())
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
    let bar = progress::bar("generate China Sea", 12);
    ingest::generate_china_sea(output, scale, seed, steps, &|done, all| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
    })?;
    progress::done(&bar, &format!("SYNTHETIC data in {}", output.display()));
    Ok(())
}
