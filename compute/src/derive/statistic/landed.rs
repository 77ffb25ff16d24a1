//! Statistics landed: every block of cells computed, fields and domain stored.

use std::sync::Arc;

use contract::ContractError;
use contract::analysis::MapStatistic;
use contract::manifest::{MANIFEST_SCHEMA, Manifest, Step};
use contract::product::ProductId;
use rayon::prelude::*;
use storage::{Store, domain, fields};

use super::super::{DeriveProgress, Progress};
use super::blocks::Blocks;
use super::cells::OfCell;
use super::plan::Plan;
use crate::{ComputeError, Engine};

/// Values of all steps that are computed together: 512 MiB of f64.
const MOST_VALUES: usize = 64 << 20;

/// Computes and stores everything but the manifest, which is returned with number 0.
pub(super) async fn land(
    engine: &Engine,
    source: &Manifest,
    target: &ProductId,
    plan: &Plan,
    progress: &Progress<'_>,
) -> Result<Manifest, ComputeError> {
    let all = computed(engine, source, plan, progress).await?;
    // Bins are kept in the order of the calendar, which is that of their periods.
    let store = engine.store();
    let mut steps = vec![];
    let mut found = Found::nothing(source.grid.cell_count());
    for (output, values) in plan.outputs.iter().zip(all) {
        let values: Vec<f32> = values
            .iter()
            .map(|value| (value * plan.factor) as f32)
            .collect();
        steps.push(step(store, source, target, output, &values).await?);
        found.add(&values);
    }
    manifest(store, source, target, plan, steps, &found).await
}

/// A statistic of every cell, `[output][row, col]`, stored unit, NaN where there is none.
pub(super) async fn computed(
    engine: &Engine,
    source: &Manifest,
    plan: &Plan,
    progress: &Progress<'_>,
) -> Result<Vec<Vec<f64>>, ComputeError> {
    let periods = source.steps[plan.read.clone()]
        .iter()
        .map(|step| step.period);
    let of_cell = Arc::new(OfCell::new(plan, periods.collect()));
    let outputs = of_cell.output_count();
    let cell_count = source.grid.cell_count();
    if outputs.saturating_mul(cell_count) > MOST_VALUES {
        let reason = format!(
            "{outputs} steps of {cell_count} cells are more than the {MOST_VALUES} values that are held at once"
        );
        let name = plan.statistic.as_str();
        return Err(ContractError::invalid("statistic", name, reason).into());
    }
    let mut all = vec![vec![f64::NAN; cell_count]; outputs];
    let blocks = Blocks::of(source);
    let values = engine.values(source, &source.id()).await?;
    let step_count = source.steps.len();
    let mut done = 0;
    for run in blocks.runs() {
        let cells = blocks.read(&values, source, run).await?;
        let (of_cell, read) = (Arc::clone(&of_cell), plan.read.clone());
        let computing = move || {
            let mut found = vec![f64::NAN; cells.places.len() * outputs];
            let each = found.par_chunks_mut(outputs);
            each.zip(cells.values.par_chunks(step_count))
                .for_each(|(out, values)| of_cell.write(&values[read.clone()], out));
            (cells.places, found)
        };
        let computed = tokio::task::spawn_blocking(computing).await;
        let (places, found) = computed.map_err(|e| ComputeError::inconsistent("a statistic", e))?;
        for (place, found) in places.iter().zip(found.chunks_exact(outputs)) {
            for (output, value) in all.iter_mut().zip(found) {
                output[*place] = *value;
            }
        }
        done += places.len();
        progress(DeriveProgress {
            done_steps: done,
            all_steps: cell_count,
        });
    }
    Ok(all)
}

/// Stores one step.
pub(super) async fn step(
    store: &Store,
    source: &Manifest,
    target: &ProductId,
    output: &super::plan::Output,
    values: &[f32],
) -> Result<Step, ComputeError> {
    Ok(Step {
        masked: None,
        period: output.period,
        field: fields::write(store, target, &source.grid, values, output.period).await?,
        raw_sha256: output.made_of,
        origin: output.origin.clone(),
        valid_cells: values.iter().filter(|value| !value.is_nan()).count() as u64,
        contributed: None,
    })
}

/// What all steps together hold.
pub(super) struct Found {
    /// Cells that hold data in some step.
    cells: Vec<bool>,
    /// Lowest and highest value.
    range: [f64; 2],
}

impl Found {
    pub(super) fn nothing(cell_count: usize) -> Self {
        Self {
            cells: vec![false; cell_count],
            range: [f64::INFINITY, f64::NEG_INFINITY],
        }
    }

    pub(super) fn add(&mut self, values: &[f32]) {
        for (cell, value) in self.cells.iter_mut().zip(values) {
            if !value.is_nan() {
                *cell = true;
                let [low, high] = self.range;
                self.range = [low.min(f64::from(*value)), high.max(f64::from(*value))];
            }
        }
    }
}

/// The manifest of a statistic, with number 0.
pub(super) async fn manifest(
    store: &Store,
    source: &Manifest,
    target: &ProductId,
    plan: &Plan,
    steps: Vec<Step>,
    found: &Found,
) -> Result<Manifest, ComputeError> {
    if !found.cells.contains(&true) {
        let reason = match plan.statistic {
            MapStatistic::Trend | MapStatistic::TrendPValue => {
                "no cell has the ten values and five years that a trend needs"
            }
            MapStatistic::Amplitude | MapStatistic::Phase => {
                "no cell has the eight values in different parts of a year that a season needs"
            }
            _ => "no cell holds data in as much of the time as is asked for",
        };
        let name = plan.statistic.as_str();
        return Err(ContractError::invalid("statistic", name, reason).into());
    }
    Ok(Manifest {
        schema: MANIFEST_SCHEMA,
        product: target.clone(),
        number: 0,
        title: format!("{}, {}", source.title, plan.title),
        quantity: plan.quantity.over(found.range)?,
        synthetic: source.synthetic,
        source: source.source.clone(),
        grid: source.grid,
        steps,
        domain: domain::write(store, target, &found.cells).await?,
        series: vec![],
        derived_from: Some(source.id()),
        computed: None,
        notices: vec![],
    })
}
