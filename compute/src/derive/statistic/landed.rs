//! Statistics landed: every block of cells computed, fields and domain stored.

use std::ops::Range;
use std::sync::Arc;

use contract::ContractError;
use contract::analysis::{CorrelationStatistic, MapStatistic};
use contract::manifest::{MANIFEST_SCHEMA, Manifest, Step};
use contract::product::ProductId;
use contract::time::Period;
use rayon::prelude::*;
use storage::{domain, fields};

use super::super::{DeriveProgress, Progress};
use super::blocks::{Blocks, Reading};
use super::cells::OfCells;
use super::plan::{Output, Plan};
use super::sources::{Sources, SourcesOf};
use super::wanted::Wanted;
use crate::{ComputeError, Engine};

/// Share of the memory for work that the values of all outputs take.
const COMPUTED_SHARE: usize = 2;

/// A statistic that was computed, to be stored.
pub(super) struct Landing<'a> {
    pub(super) engine: &'a Engine,
    pub(super) sources: SourcesOf<'a>,
    pub(super) target: &'a ProductId,
    pub(super) plan: &'a Plan,
    pub(super) wanted: &'a Wanted,
}

/// Statistics of every cell that is wanted, by statistic `[output][row, col]`, stored unit, NaN where there is none.
pub(super) async fn computed(
    engine: &Engine,
    sources: &Sources,
    plans: &[Plan],
    wanted: &Wanted,
    progress: &Progress<'_>,
) -> Result<Vec<Vec<Vec<f64>>>, ComputeError> {
    if plans.is_empty() {
        return Ok(vec![]);
    }
    let source = &sources.first;
    let periods: Vec<Period> = source.steps.iter().map(|step| step.period).collect();
    let of_cells = Arc::new(OfCells::new(plans, &periods));
    let counts = of_cells.output_counts();
    let outputs: usize = counts.iter().sum();
    let cell_count = source.grid.cell_count();
    check_room(engine, plans, [outputs, cell_count])?;
    let mut all = vec![vec![f64::NAN; cell_count]; outputs];
    let readings = readings(engine, sources, plans).await?;
    let steps_of: Vec<usize> = readings.iter().map(|it| it.manifest.steps.len()).collect();
    let steps_of_all = steps_of.iter().sum();
    let blocks = Blocks::of(&source.grid, wanted, steps_of_all, engine.memory_bytes());
    let all_cells = wanted.count(0..cell_count);
    let mut done = 0;
    for run in blocks.runs() {
        let mut places = vec![];
        let mut values = vec![];
        for reading in &readings {
            let cells = blocks.read(reading, run.clone()).await?;
            places = cells.places;
            values.push(cells.values);
        }
        let (of_cells, steps_of) = (Arc::clone(&of_cells), steps_of.clone());
        let is_wanted: Vec<bool> = places.iter().map(|place| wanted.is(*place)).collect();
        let computing = move || {
            let mut found = vec![f64::NAN; places.len() * outputs];
            let each = found.par_chunks_mut(outputs).zip(&is_wanted).enumerate();
            each.filter(|(_, (_, is_wanted))| **is_wanted)
                .for_each(|(at, (out, _))| {
                    let of_side = |side: usize| match (values.get(side), steps_of.get(side)) {
                        (Some(values), Some(steps)) => &values[at * steps..][..*steps],
                        _ => &[],
                    };
                    of_cells.write([of_side(0), of_side(1)], out);
                });
            (places, found)
        };
        let computed = tokio::task::spawn_blocking(computing).await;
        let (places, found) = computed.map_err(|e| ComputeError::inconsistent("a statistic", e))?;
        for (place, found) in places.iter().zip(found.chunks_exact(outputs)) {
            for (output, value) in all.iter_mut().zip(found) {
                output[*place] = *value;
            }
        }
        done += wanted.count(places.into_iter());
        progress(DeriveProgress {
            done_steps: done,
            all_steps: all_cells,
        });
    }
    let mut all = all.into_iter();
    let by_plan = counts
        .into_iter()
        .map(|count| all.by_ref().take(count).collect());
    Ok(by_plan.collect())
}

/// Is there room for the values of all outputs?
fn check_room(
    engine: &Engine,
    plans: &[Plan],
    [outputs, cell_count]: [usize; 2],
) -> Result<(), ContractError> {
    let most = engine.memory_bytes() / COMPUTED_SHARE / size_of::<f64>();
    if outputs.saturating_mul(cell_count) <= most {
        return Ok(());
    }
    let reason = format!(
        "{outputs} steps of {cell_count} cells are more than the {most} values that are held at once: ask for fewer at a time, or give it more memory (--memory-mib)"
    );
    let name = plans[0].statistic.to_string();
    Err(ContractError::invalid("statistic", &name, reason))
}

/// Versions that are read, the first product's and, where any plan is of two, the second's, and their steps that any plan needs.
async fn readings<'a>(
    engine: &Engine,
    sources: &'a Sources,
    plans: &[Plan],
) -> Result<Vec<Reading<'a>>, ComputeError> {
    let mut readings = vec![];
    for (side, manifest) in sources.all().enumerate() {
        let reads: Vec<Range<usize>> = plans.iter().filter_map(|plan| plan.reads(side)).collect();
        let first = reads.iter().map(|steps| steps.start).min();
        let end = reads.iter().map(|steps| steps.end).max();
        let Some(steps) = first.zip(end).map(|(first, end)| first..end) else {
            continue;
        };
        let values = engine.values(manifest, &manifest.id()).await?;
        readings.push(Reading {
            manifest,
            values,
            steps,
        });
    }
    Ok(readings)
}

impl Landing<'_> {
    /// Stores everything but the manifest, which is returned with number 0; of bins one after the other, in the order of the
    /// calendar, which is that of their periods.
    pub(super) async fn each(&self, all: Vec<Vec<f64>>) -> Result<Manifest, ComputeError> {
        let mut steps = vec![];
        let mut found = Found::nothing(self.sources.first.grid.cell_count());
        for (output, values) in self.plan.outputs.iter().zip(all) {
            let values: Vec<f32> = values
                .iter()
                .map(|value| (value * self.plan.factor) as f32)
                .collect();
            steps.push(self.step(output, &values).await?);
            found.add(&values);
        }
        self.manifest(steps, &found).await
    }

    /// Stores one step.
    async fn step(&self, output: &Output, values: &[f32]) -> Result<Step, ComputeError> {
        let (store, grid) = (self.engine.store(), &self.sources.first.grid);
        let field = fields::write(store, self.target, grid, values, output.period).await?;
        let valid_cells = values.iter().filter(|value| !value.is_nan()).count();
        Ok(output.step(field, valid_cells as u64))
    }

    /// The manifest, with number 0.
    pub(super) async fn manifest(
        &self,
        steps: Vec<Step>,
        found: &Found,
    ) -> Result<Manifest, ComputeError> {
        let Self {
            sources,
            target,
            plan,
            ..
        } = *self;
        let source = sources.first;
        if !found.cells.contains(&true) {
            let name = plan.statistic.to_string();
            return Err(ContractError::invalid("statistic", &name, self.nothing()).into());
        }
        Ok(Manifest {
            schema: MANIFEST_SCHEMA,
            product: target.clone(),
            number: 0,
            title: format!("{}, {}", sources.title(), plan.title),
            quantity: plan.quantity.over(found.range)?,
            synthetic: sources.is_synthetic(),
            source: sources.citation(),
            grid: source.grid,
            steps,
            domain: domain::write(self.engine.store(), target, &found.cells).await?,
            series: vec![],
            derived_from: Some(source.id()),
            computed: Some(plan.computed.clone()),
            notices: vec![],
        })
    }

    /// Why no cell has a value.
    fn nothing(&self) -> String {
        let reason = match self.plan.statistic {
            MapStatistic::Trend
            | MapStatistic::TrendPValue
            | MapStatistic::LeastSquaresTrend
            | MapStatistic::LeastSquaresTrendPValue => {
                "has the ten values and five years that a trend needs"
            }
            MapStatistic::Amplitude | MapStatistic::Phase => {
                "has the eight values in different parts of a year that a season needs"
            }
            MapStatistic::Correlation(CorrelationStatistic::Pairs) => "holds data of both products",
            MapStatistic::Correlation(_) => {
                "has three pairs of values that vary, in as many of the common steps as is asked for"
            }
            _ => "holds data in as much of the time as is asked for",
        };
        let place = match self.wanted {
            Wanted::All => "",
            Wanted::Some(_) => " of the region",
        };
        format!("no cell{place} {reason}")
    }
}

/// What all steps together hold.
pub(super) struct Found {
    /// Cells that hold data in some step.
    cells: Vec<bool>,
    /// Lowest and highest value.
    range: [f64; 2],
    /// How many values there were.
    pub(super) valid_cells: u64,
}

impl Found {
    pub(super) fn nothing(cell_count: usize) -> Self {
        Self {
            cells: vec![false; cell_count],
            range: [f64::INFINITY, f64::NEG_INFINITY],
            valid_cells: 0,
        }
    }

    /// Adds a step; of how many cells it is told which hold data was said at first.
    pub(super) fn add(&mut self, values: &[f32]) {
        for (cell, value) in self.cells.iter_mut().zip(values) {
            *cell |= !value.is_nan();
        }
        let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
        for value in values {
            low = if *value < low { *value } else { low };
            high = if *value > high { *value } else { high };
        }
        let has_data = values.iter().filter(|value| !value.is_nan());
        self.merge(&Self {
            cells: vec![],
            range: [low, high].map(f64::from),
            valid_cells: has_data.count() as u64,
        });
    }

    /// A cell, by its place, holds data.
    pub(super) fn has_data(&mut self, place: usize) {
        self.cells[place] = true;
    }

    pub(super) fn merge(&mut self, other: &Self) {
        for (own, other) in self.cells.iter_mut().zip(&other.cells) {
            *own |= other;
        }
        self.valid_cells += other.valid_cells;
        let ([low, high], [other_low, other_high]) = (self.range, other.range);
        self.range = [low.min(other_low), high.max(other_high)];
    }
}
