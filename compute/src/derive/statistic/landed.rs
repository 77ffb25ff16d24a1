//! Statistics landed: every block of cells computed, fields and domain stored.

use std::ops::Range;
use std::sync::Arc;

use contract::ContractError;
use contract::analysis::{CorrelationStatistic, MapStatistic};
use contract::chunk::Window;
use contract::manifest::{MANIFEST_SCHEMA, Manifest, Step};
use contract::product::ProductId;
use contract::time::Period;
use futures::{FutureExt as _, StreamExt as _, TryStreamExt as _, stream};
use rayon::prelude::*;
use storage::domain::{self, Cells};
use storage::fields;

use super::super::{DeriveProgress, Progress};
use super::blocks::{Blocks, GROUPS_AT_ONCE, Pieces, Reading};
use super::cells::OfCells;
use super::encoded::Encoded;
use super::held::{Held, are_held};
use super::plan::{Output, Plan};
use super::runs::off_thread;
use super::sources::{Sources, SourcesOf};
use super::stored::Stored;
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
    pub(super) stored: &'a Stored,
}

/// What was computed of one statistic.
pub(super) struct Computed {
    /// `[output][row, col]` of the cells that are stored, of anomalies their normals; stored unit, NaN where there is none.
    pub(super) maps: Vec<Vec<f64>>,
    /// Anomalies, if they are few.
    pub(super) held: Option<Held>,
}

/// Statistics of every cell that is wanted, by statistic.
pub(super) async fn computed(
    engine: &Engine,
    sources: &Sources,
    plans: &[Plan],
    (wanted, stored): (&Arc<Wanted>, &Stored),
    progress: &Progress<'_>,
) -> Result<Vec<Computed>, ComputeError> {
    if plans.is_empty() {
        return Ok(vec![]);
    }
    let source = &sources.first;
    let cell_count = stored.grid.cell_count();
    let blocks = Blocks::of(engine, &source.grid, wanted, stored);
    let are_held = are_held(plans, &blocks, engine.memory_bytes());
    let periods: Vec<Period> = source.steps.iter().map(|step| step.period).collect();
    let of_cells = Arc::new(OfCells::new(plans, &are_held, &periods));
    let counts = of_cells.output_counts();
    let outputs: usize = counts.iter().sum();
    check_room(engine, plans, [outputs, cell_count])?;
    let mut all = vec![vec![f64::NAN; cell_count]; outputs];
    let room = |count| (count > 0).then(|| Held::nothing(count, blocks.cell_count()));
    let mut held: Vec<Option<Held>> = of_cells.anomaly_counts().map(room).collect();
    let readings = readings(engine, sources, plans, &are_held).await?;
    let all_cells = wanted.count(0..source.grid.cell_count());
    let mut done = 0;
    let steps_of_all = readings.iter().map(|it| it.manifest.steps.len()).sum();
    let groups = blocks.groups(steps_of_all);
    let mut found = stream::iter(groups.of_blocks())
        .map(|windows| found(&of_cells, wanted, &readings, (windows, groups.pieces)).boxed())
        .buffered(GROUPS_AT_ONCE)
        .map_ok(|found| stream::iter(found.into_iter().map(Ok::<OfBlocks, ComputeError>)))
        .try_flatten()
        .boxed();
    while let Some(found) = found.try_next().await? {
        for (cell, place) in found.places.iter().enumerate() {
            let values = &found.values[cell * outputs..][..outputs];
            for (output, value) in all.iter_mut().zip(values) {
                output[stored.place(*place)] = *value;
            }
        }
        let mut anomalies = found.anomalies.as_slice();
        while !anomalies.is_empty() {
            for held in held.iter_mut().flatten() {
                anomalies = held.take(anomalies);
            }
        }
        done += wanted.count(found.places.into_iter());
        progress(DeriveProgress {
            done_steps: done,
            all_steps: all_cells,
        });
    }
    drop(found);
    let mut all = all.into_iter();
    let by_plan = counts.into_iter().zip(held);
    let by_plan = by_plan.map(|(count, held)| Computed {
        maps: all.by_ref().take(count).collect(),
        held,
    });
    Ok(by_plan.collect())
}

/// Statistics of some blocks of cells.
struct OfBlocks {
    /// Place of each cell in the grid, row-major.
    places: Vec<usize>,
    /// `[cell, output]`.
    values: Vec<f64>,
    /// `[cell, anomaly]`, of all statistics of which anomalies are held.
    anomalies: Vec<f32>,
}

/// Reads some blocks and computes the statistics of their cells that are wanted, on all processors; piece by piece.
async fn found(
    of_cells: &Arc<OfCells>,
    wanted: &Arc<Wanted>,
    readings: &[Reading<'_>],
    (windows, pieces): (&[Window], Pieces),
) -> Result<Vec<OfBlocks>, ComputeError> {
    let mut sides = vec![];
    for Reading { values, steps, .. } in readings {
        sides.push(Encoded::find(values, windows.to_vec(), steps.clone()).await?);
    }
    let grid = readings[0].manifest.grid;
    let steps_of: Vec<usize> = readings.iter().map(|it| it.manifest.steps.len()).collect();
    let (of_cells, wanted) = (Arc::clone(of_cells), Arc::clone(wanted));
    let computing = move || {
        let sides: Vec<Vec<Encoded>> = sides
            .into_iter()
            .map(|own| own.split(pieces.each))
            .collect();
        let count = sides.first().map_or(0, Vec::len);
        let of_piece = |piece: usize| {
            let of_piece = sides.iter().zip(&steps_of).enumerate();
            let values = of_piece.map(|(side, (own, steps))| {
                let values = own[piece].values(&(0..*steps));
                values.map_err(|damaged| (side, piece, damaged))
            });
            let values: Vec<Vec<f32>> = values.collect::<Result<_, _>>()?;
            let places = sides[0][piece].windows().iter();
            let places = places.flat_map(|block| block.cell_indices(&grid)).collect();
            Ok(computed_of(
                &of_cells,
                &wanted,
                places,
                (&values, &steps_of),
            ))
        };
        let mut found = vec![];
        for first in (0..count).step_by(pieces.at_once.min(count).max(1)) {
            let some = first..count.min(first.saturating_add(pieces.at_once));
            let some: Result<Vec<OfBlocks>, _> = some.into_par_iter().map(of_piece).collect();
            match some {
                Ok(some) => found.extend(some),
                Err((side, piece, damaged)) => return Err((sides, (side, piece), damaged)),
            }
        }
        Ok(found)
    };
    match off_thread(computing).await? {
        Ok(found) => Ok(found),
        Err((sides, (side, piece), damaged)) => Err(sides[side][piece].error(damaged).await),
    }
}

/// The statistics of the cells at some places that are wanted; `sides` are the values of each product, `[cell, step]`, and its steps.
fn computed_of(
    of_cells: &OfCells,
    wanted: &Wanted,
    places: Vec<usize>,
    sides: (&[Vec<f32>], &[usize]),
) -> OfBlocks {
    let outputs: usize = of_cells.output_counts().iter().sum();
    let held: usize = of_cells.anomaly_counts().sum();
    let mut values = vec![f64::NAN; places.len() * outputs];
    let mut anomalies = vec![f32::NAN; places.len() * held];
    for (cell, _) in places
        .iter()
        .enumerate()
        .filter(|(_, place)| wanted.is(**place))
    {
        let of_side = |side: usize| match (sides.0.get(side), sides.1.get(side)) {
            (Some(values), Some(steps)) => &values[cell * steps..][..*steps],
            _ => &[],
        };
        let values = &mut values[cell * outputs..][..outputs];
        let anomalies = &mut anomalies[cell * held..][..held];
        of_cells.write([of_side(0), of_side(1)], values, anomalies);
    }
    OfBlocks {
        places,
        values,
        anomalies,
    }
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
    are_held: &[bool],
) -> Result<Vec<Reading<'a>>, ComputeError> {
    let mut readings = vec![];
    for (side, manifest) in sources.all().enumerate() {
        let of_statistics = plans.iter().filter_map(|plan| plan.reads(side));
        let of_anomalies = plans.iter().zip(are_held).filter(|(_, is_held)| **is_held);
        let of_anomalies = of_anomalies.filter_map(|(plan, _)| plan.anomaly_reads(side));
        let reads: Vec<Range<usize>> = of_statistics.chain(of_anomalies).collect();
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
        let mut found = Found::nothing(self.stored.grid.cell_count());
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
        let (store, grid) = (self.engine.store(), &self.stored.grid);
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
        if !found.cells.is_any() {
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
            grid: self.stored.grid,
            steps,
            domain: domain::write_cells(self.engine.store(), target, found.cells.clone()).await?,
            series: vec![],
            derived_from: Some(source.id()),
            computed: Some(plan.computed.clone()),
            notices: vec![],
            indexes: vec![],
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
    cells: Cells,
    /// Lowest and highest value.
    range: [f64; 2],
    /// How many values there were.
    pub(super) valid_cells: u64,
}

impl Found {
    pub(super) fn nothing(cell_count: usize) -> Self {
        Self {
            cells: Cells::none(cell_count),
            range: [f64::INFINITY, f64::NEG_INFINITY],
            valid_cells: 0,
        }
    }

    /// Adds a step; of how many cells it is told which hold data was said at first.
    pub(super) fn add(&mut self, values: &[f32]) {
        let told = values.len().min(self.cells.map_count());
        self.cells.add_valued(0, &values[..told]);
        let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
        for value in values {
            low = if *value < low { *value } else { low };
            high = if *value > high { *value } else { high };
        }
        let has_data = values.iter().filter(|value| !value.is_nan());
        self.merge(&Self {
            cells: Cells::none(0),
            range: [low, high].map(f64::from),
            valid_cells: has_data.count() as u64,
        });
    }

    /// A cell, by its place, holds data.
    pub(super) fn has_data(&mut self, place: usize) {
        self.cells.insert(place);
    }

    pub(super) fn merge(&mut self, other: &Self) {
        self.cells.add(&other.cells);
        self.valid_cells += other.valid_cells;
        let ([low, high], [other_low, other_high]) = (self.range, other.range);
        self.range = [low.min(other_low), high.max(other_high)];
    }
}
