//! `fluxglobe generate`: a size and a seed in, a synthetic file out.

use anyhow::{Result, ensure};
use ingest::GeneratedSteps;

use crate::cli::Generate;
use crate::progress;

pub(crate) fn run(options: Generate) -> Result<()> {
    let Generate::ChinaSea {
        scale,
        seed,
        days,
        output,
    } = options;
    ensure!(
        (0.01..=1.0).contains(&scale),
        "--scale {scale}: give 0.01 to 1"
    );
    let steps = days.map_or(GeneratedSteps::Months, GeneratedSteps::Days);
    china_sea(&output, scale, seed, steps)?;
    progress::result(&output.display().to_string())
}

/// Writes the synthetic China Sea with a progress bar.
pub(crate) fn china_sea(
    output: &std::path::Path,
    scale: f64,
    seed: u64,
    steps: GeneratedSteps,
) -> Result<()> {
    let bar = progress::bar("generate China Sea", 12);
    ingest::generate_china_sea(output, scale, seed, steps, &|done, all| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
    })?;
    progress::done(&bar, &format!("SYNTHETIC data in {}", output.display()));
    Ok(())
}
