//! `fluxglobe products fill-error`: a product in; how far filled values lie from hidden ones, for every step and size of
//! gap, out.

use std::path::Path;

use anyhow::{Context as _, Result, ensure};
use comfy_table::presets::NOTHING;
use comfy_table::{CellAlignment, Table};
use contract::manifest::Manifest;
use render::stages::fill::scaled::holds;
use render::{Image, Renderer};
use render_proof::fill::hold_out::{HoldOut, Score};
use serde::Serialize;

use crate::cli::{FillError, Settings};
use crate::figures::figures;
use crate::{deployment, progress};

/// Longest side of the picture, pixels.
const MOST_PX: u32 = 1600;

#[derive(Serialize)]
struct Report {
    product: String,
    manifest: String,
    synthetic: bool,
    form: &'static str,
    hidden_share: f64,
    seed: u32,
    unit: &'static str,
    adapter: String,
    /// Every step with every size of gap.
    steps: Vec<Row>,
    /// All steps together.
    all: Vec<Row>,
}

/// One line; numbers in the report's unit.
#[derive(Serialize)]
struct Row {
    /// First instant of the step; none for all steps together.
    step: Option<String>,
    gap_cells: u32,
    hidden_cells: u64,
    rmse: Option<f64>,
    bias: Option<f64>,
    /// Root mean square of the errors (1σ) that the filling itself estimates.
    estimated: Option<f64>,
    within_two_sigma: Option<f64>,
    /// Standard deviation of the hidden values.
    spread: Option<f64>,
}

impl Row {
    fn new(step: Option<String>, gap_cells: u32, score: &Score, factor: f64) -> Self {
        let shown = |number: Option<f64>| number.map(|number| number * factor);
        Self {
            step,
            gap_cells,
            hidden_cells: score.cells,
            rmse: shown(score.rmse()),
            bias: shown(score.bias()),
            estimated: shown(score.estimated()),
            within_two_sigma: score.within_two_sigma(),
            spread: shown(score.spread()),
        }
    }
}

/// A field with part of it hidden and filled again.
struct Trial {
    truth: Vec<f32>,
    filled: Vec<f32>,
    hidden: Vec<usize>,
    score: Score,
}

pub(crate) async fn run(settings: &Settings, options: &FillError) -> Result<()> {
    let store = deployment::store(settings)?;
    let manifest = deployment::manifest(&store, &options.product, &settings.data).await?;
    let cells = storage::domain::read_cells(&store, &manifest.domain).await?;
    ensure!(
        cells.map_count() == manifest.grid.cell_count(),
        "{} does not fill its product's grid",
        manifest.domain
    );
    let flags = cells.flags(0..cells.map_count());
    let domain: Vec<u32> = flags.into_iter().map(u32::from).collect();
    let backend = deployment::backend(settings)?;
    let renderer = tokio::task::spawn_blocking(move || Renderer::new(backend)).await??;
    let display = manifest.quantity.display();
    let (mut rows, mut all) = (vec![], vec![Score::default(); options.gap_cells.len()]);
    let steps = spread_evenly(manifest.steps.len(), options.steps.get() as usize);
    let bar = progress::bar("hide and fill", (steps.len() * all.len()) as u64);
    let mut last = None;
    for step in steps {
        let step = &manifest.steps[step];
        let truth = storage::fields::read(&store, &step.field, &manifest.grid).await?;
        for (side, all) in options.gap_cells.iter().zip(&mut all) {
            let hold_out = HoldOut {
                share: options.share,
                side_cells: side.get(),
                seed: options.seed,
            };
            let trial = tokio::task::block_in_place(|| {
                trial(
                    &renderer,
                    options,
                    &manifest,
                    &domain,
                    truth.clone(),
                    hold_out,
                )
            })?;
            *all = all.with(trial.score);
            let start = Some(step.period.start.to_string());
            rows.push(Row::new(start, side.get(), &trial.score, display.factor));
            last = Some(trial);
            bar.inc(1);
        }
    }
    progress::done(&bar, &format!("{} fields", rows.len()));
    if let (Some(path), Some(trial)) = (&options.picture, &last) {
        draw(path, &manifest, &domain, trial)?;
        progress::say(&format!("picture in {}", path.display()));
    }
    let all = options.gap_cells.iter().zip(&all);
    let report = Report {
        product: manifest.product.to_string(),
        manifest: manifest.id().to_string(),
        synthetic: manifest.synthetic,
        form: options.form.form().name(),
        hidden_share: options.share,
        seed: options.seed,
        unit: display.unit,
        adapter: renderer.name().to_owned(),
        all: all
            .map(|(side, score)| Row::new(None, side.get(), score, display.factor))
            .collect(),
        steps: rows,
    };
    if options.json {
        return progress::result(&serde_json::to_string_pretty(&report)?);
    }
    progress::result(&table(&report))
}

/// Indices of at most `most` of `count` steps, the last one among them.
fn spread_evenly(count: usize, most: usize) -> Vec<usize> {
    let wanted = count.min(most);
    (1..=wanted).map(|part| part * count / wanted - 1).collect()
}

fn trial(
    renderer: &Renderer,
    options: &FillError,
    manifest: &Manifest,
    domain: &[u32],
    truth: Vec<f32>,
    hold_out: HoldOut,
) -> Result<Trial> {
    let (kept, hidden) = hold_out.hide(&truth, manifest.grid.cols);
    let filled = renderer.fill(options.form.form(), &manifest.grid, &kept, domain)?;
    let score = Score::of(&truth, &filled.values, &filled.errors, &hidden);
    Ok(Trial {
        truth,
        filled: filled.values,
        hidden,
        score,
    })
}

fn table(report: &Report) -> String {
    let mut table = Table::new();
    table.load_preset(NOTHING);
    let unit = if report.unit.is_empty() {
        String::new()
    } else {
        format!(", {}", report.unit)
    };
    table.set_header([
        "step".to_owned(),
        "gap, cells".to_owned(),
        "hidden".to_owned(),
        format!("RMSE{unit}"),
        "bias".to_owned(),
        "estimated".to_owned(),
        "within 2σ".to_owned(),
        "spread".to_owned(),
    ]);
    let number =
        |number: Option<f64>| number.map_or_else(|| "-".to_owned(), |number| figures(number, 4));
    for row in report.steps.iter().chain(&report.all) {
        let step = row
            .step
            .as_ref()
            .map_or_else(|| "all".to_owned(), |step| step[..10].to_owned());
        let within = row
            .within_two_sigma
            .map_or_else(|| "-".to_owned(), |share| format!("{:.1} %", 100.0 * share));
        table.add_row([
            step,
            row.gap_cells.to_string(),
            row.hidden_cells.to_string(),
            number(row.rmse),
            number(row.bias),
            number(row.estimated),
            within,
            number(row.spread),
        ]);
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    let synthetic = if report.synthetic { "SYNTHETIC " } else { "" };
    format!(
        "{synthetic}{}, filled in the form {}, {} of the data hidden\n{table}",
        report.manifest, report.form, report.hidden_share
    )
}

/// Filled minus true of the hidden cells; where cells share a pixel, of the worst.
fn draw(path: &Path, manifest: &Manifest, domain: &[u32], trial: &Trial) -> Result<()> {
    let grid = &manifest.grid;
    let joined = grid.rows.max(grid.cols).div_ceil(MOST_PX);
    let (width, height) = (grid.cols.div_ceil(joined), grid.rows.div_ceil(joined));
    let at = |cell: usize| {
        let (row, col) = (
            cell as u32 / grid.cols / joined,
            cell as u32 % grid.cols / joined,
        );
        (row * width + col) as usize
    };
    let mut ground = vec![[40u8, 40, 44]; width as usize * height as usize];
    for (cell, _) in domain
        .iter()
        .enumerate()
        .filter(|(_, domain)| **domain != 0)
    {
        ground[at(cell)] = [190; 3];
    }
    let mut worst = vec![None; ground.len()];
    for &cell in trial
        .hidden
        .iter()
        .filter(|cell| holds(trial.filled[**cell]))
    {
        let apart = f64::from(trial.filled[cell]) - f64::from(trial.truth[cell]);
        let worst: &mut Option<f64> = &mut worst[at(cell)];
        if worst.is_none_or(|worst| apart.abs() > worst.abs()) {
            *worst = Some(apart);
        }
    }
    let full = 2.0 * trial.score.rmse().filter(|rmse| *rmse > 0.0).unwrap_or(1.0);
    let colour = |(ground, worst): (&[u8; 3], &Option<f64>)| {
        let [red, green, blue] =
            worst.map_or(*ground, |apart| diverging((apart / full).clamp(-1.0, 1.0)));
        [red, green, blue, 255]
    };
    let rgba8 = ground.iter().zip(&worst).flat_map(colour).collect();
    let png = Image {
        width,
        height,
        rgba8,
    }
    .encode_png()?;
    std::fs::write(path, &png).with_context(|| format!("cannot write {}", path.display()))
}

/// White at 0, blue at -1, red at 1.
fn diverging(place: f64) -> [u8; 3] {
    let end = if place < 0.0 {
        [33.0, 102.0, 172.0]
    } else {
        [178.0, 24.0, 43.0]
    };
    end.map(|end: f64| (255.0 + (end - 255.0) * place.abs()).round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_spread_evenly_and_end_with_the_last() {
        assert_eq!(spread_evenly(12, 12), (0..12).collect::<Vec<_>>());
        assert_eq!(spread_evenly(12, 4), [2, 5, 8, 11]);
        assert_eq!(spread_evenly(3, 12), [0, 1, 2]);
        assert_eq!(spread_evenly(0, 12), [0; 0]);
    }

    #[test]
    fn right_values_are_white_and_wrong_ones_blue_or_red() {
        assert_eq!(diverging(0.0), [255; 3]);
        let ([low_red, _, low_blue], [high_red, _, high_blue]) = (diverging(-1.0), diverging(1.0));
        assert!(low_blue > low_red && high_red > high_blue);
    }
}
