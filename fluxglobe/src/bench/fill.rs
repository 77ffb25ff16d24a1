//! `fluxglobe bench fill`: how long gap filling takes on this machine's device (or with --cpu the twins), every form,
//! small grids first.

use std::time::Duration;

use anyhow::Result;
use render::gpu::Gpu;
use render::stages::fill::{Fill, Sources};
use render_proof::fill::timing::{self, Timing};
use serde::Serialize;

use crate::cli::{BenchFill, Settings};
use crate::progress;

/// One line.
#[derive(Serialize)]
struct Row {
    form: &'static str,
    rows: u32,
    cols: u32,
    missing: usize,
    gap_cells: u32,
    runs: usize,
    median_ms: f64,
    p99_ms: f64,
    /// Largest difference from all pairs in float64, share of the range.
    from_all_pairs: Option<f64>,
    /// Root mean square error of hidden values over their standard deviation.
    rmse_over_spread: Option<f64>,
    /// Equal on two devices where all bits of the filled values are.
    digest: Option<String>,
    adapter: String,
}

pub(crate) fn run(settings: &Settings, options: &BenchFill) -> Result<()> {
    let gpu = if settings.cpu {
        None
    } else {
        Some(Gpu::open()?)
    };
    let on_gpu = gpu
        .as_ref()
        .map(|gpu| (gpu, Fill::new(gpu, Sources::default())));
    let adapter = gpu.as_ref().map_or("CPU twins", Gpu::adapter_name);
    let limit = Duration::from_secs(options.limit_s);
    let runs = options.runs.get() as usize;
    progress::say(&format!(
        "gap filling on {adapter}; a whole field, without upload and read-back"
    ));
    if !options.json {
        progress::result(HEADER)?;
    }
    for case in timing::cases([options.size[0], options.size[1]], options.share) {
        for form in options.forms.iter().map(|form| form.form()) {
            let timing = match &on_gpu {
                Some((gpu, fill)) => timing::bench_fill(gpu, fill, case, form, runs, limit),
                None => timing::bench_twin(case, form, runs, limit),
            };
            match timing {
                Ok(timing) => print(options, &Row::new(&timing, adapter))?,
                Err(error) if error.is_bad_request() => {
                    let (rows, cols) = (case.rows, case.cols);
                    progress::say(&format!("{} of {rows} x {cols}: {error}", form.name()));
                }
                Err(error) => return Err(error.into()),
            }
        }
    }
    Ok(())
}

const HEADER: &str = "form         rows   cols  missing  gap  runs   median ms      p99 ms  from all pairs  RMSE/spread    digest";

impl Row {
    fn new(timing: &Timing, adapter: &str) -> Self {
        let runs = timing.seconds.len();
        Self {
            form: timing.form.name(),
            rows: timing.case.rows,
            cols: timing.case.cols,
            missing: timing.gaps,
            gap_cells: timing.case.missing.side_cells,
            runs,
            median_ms: timing.median_s() * 1e3,
            p99_ms: timing.seconds[(runs * 99 / 100).min(runs - 1)] * 1e3,
            from_all_pairs: timing.from_all_pairs,
            rmse_over_spread: timing.rmse_of_hidden,
            digest: timing.values_digest.map(|digest| digest.short()),
            adapter: adapter.to_owned(),
        }
    }
}

fn print(options: &BenchFill, row: &Row) -> Result<()> {
    if options.json {
        return progress::result(&serde_json::to_string(row)?);
    }
    let apart = row
        .from_all_pairs
        .map_or_else(|| "-".to_owned(), |apart| format!("{apart:.1e}"));
    let rmse = row
        .rmse_over_spread
        .map_or_else(|| "-".to_owned(), |rmse| format!("{rmse:.4}"));
    progress::result(&format!(
        "{:<11} {:>5} {:>6} {:>8} {:>4} {:>5} {:>11.3} {:>11.3} {:>15} {:>12}  {}",
        row.form,
        row.rows,
        row.cols,
        row.missing,
        row.gap_cells,
        row.runs,
        row.median_ms,
        row.p99_ms,
        apart,
        rmse,
        row.digest.as_deref().unwrap_or("-"),
    ))
}
