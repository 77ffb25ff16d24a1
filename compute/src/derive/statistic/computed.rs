//! Statistics computed: blocks of cells of all time in, maps out. They are held where they have room; else they are computed in bands of
//! rows, and each is a field that is written from the north to the south. Either way they have the same bits.

use std::ops::Range;
use std::sync::Arc;

use contract::ContractError;
use contract::analysis::MapStatistic;
use contract::chunk::{CHUNK_ROWS, Window};
use contract::grid::Grid;
use contract::time::Period;
use cube::BLOCK_CELLS;
use futures::{FutureExt as _, StreamExt as _, TryStreamExt as _, stream};
use rayon::prelude::*;
use storage::fields::Spooled;
use storage::{StorageError, spool};

use super::super::{DeriveProgress, Progress};
use super::blocks::{Blocks, GROUPS_AT_ONCE, Pieces, Reading};
use super::cells::OfCells;
use super::encoded::Encoded;
use super::found::Found;
use super::held::{Held, are_held};
use super::plan::{Output, Plan};
use super::runs::off_thread;
use super::sources::Sources;
use super::stored::Stored;
use super::wanted::Wanted;
use crate::{ComputeError, Engine};

/// Share of the memory for work that the values of all outputs take.
const COMPUTED_SHARE: usize = 2;
/// Fewest rows of a band: whole chunks of fields, and whole blocks of cells.
const BAND_ROWS: u32 = 2 * CHUNK_ROWS;
const _: () = assert!(BAND_ROWS.is_multiple_of(BLOCK_CELLS));

/// What was computed of one statistic.
pub(super) struct Computed {
    pub(super) maps: Maps,
    /// Anomalies, if they are few.
    pub(super) held: Option<Held>,
}

/// A map of the cells that are stored for each output, of anomalies their normals.
pub(super) enum Maps {
    /// `[output][row, col]`, stored unit, NaN where there is none.
    Held(Vec<Vec<f64>>),
    /// As fields, and what they hold.
    Written(Vec<Spooled>, Found),
}

impl Maps {
    /// Those that are held.
    ///
    /// # Errors
    /// They are not.
    pub(super) fn held(self) -> Result<Vec<Vec<f64>>, ComputeError> {
        match self {
            Self::Held(maps) => Ok(maps),
            Self::Written(..) => Err(ComputeError::inconsistent("normals", "they are not held")),
        }
    }
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
    let (grid, source) = (&stored.grid, &sources.first);
    let blocks_of = |rows: &Range<u32>| Blocks::of(engine, &source.grid, wanted, (stored, rows));
    let are_held = if plans.iter().any(is_anomaly) {
        are_held(plans, &blocks_of(&(0..grid.rows)), engine.memory_bytes())
    } else {
        vec![false; plans.len()]
    };
    let periods: Vec<Period> = source.steps.iter().map(|step| step.period).collect();
    let of_cells = Arc::new(OfCells::new(plans, &are_held, &periods));
    let counts = of_cells.output_counts();
    let bands = bands(engine, plans, counts.iter().sum(), grid)?;
    let computing = Computing {
        of_cells,
        readings: readings(engine, sources, plans, &are_held).await?,
        wanted,
        stored,
        all_cells: wanted.all_count(&source.grid),
        progress,
    };
    let mut done = 0;
    if let [all] = &bands[..] {
        let (maps, held) = computing.of(&blocks_of(all), all, &mut done).await?;
        let mut maps = maps.into_iter();
        let by_plan = counts.into_iter().zip(held);
        let by_plan = by_plan.map(|(count, held)| Computed {
            maps: Maps::Held(maps.by_ref().take(count).collect()),
            held,
        });
        return Ok(by_plan.collect());
    }
    let begun = plans.iter().map(|plan| Writing::begin(plan, plans, grid));
    let mut writing: Vec<Writing> = begun.collect::<Result<_, _>>()?;
    for rows in bands {
        let (maps, _none_are_held) = computing.of(&blocks_of(&rows), &rows, &mut done).await?;
        let first = rows.start as usize * grid.cols as usize;
        writing = off_thread(move || written(writing, first, maps)).await??;
    }
    let computed = writing.into_iter().map(|own| Computed {
        maps: Maps::Written(own.fields, own.found),
        held: None,
    });
    Ok(computed.collect())
}

fn is_anomaly(plan: &Plan) -> bool {
    matches!(plan.statistic, MapStatistic::Anomaly)
}

/// Fields of a statistic while bands of rows come.
struct Writing {
    factor: f64,
    fields: Vec<Spooled>,
    found: Found,
}

impl Writing {
    /// Those of one of some plans, which are written at a time, without rows.
    fn begin(plan: &Plan, plans: &[Plan], grid: &Grid) -> Result<Self, StorageError> {
        let count = plans.iter().map(|plan| plan.outputs.len()).sum();
        let field = |output: &Output| Spooled::one_of(count, &spool::FOLDER, grid, output.period);
        let fields = plan.outputs.iter().map(field);
        Ok(Self {
            factor: plan.factor,
            fields: fields.collect::<Result<_, _>>()?,
            found: Found::nothing(grid.cell_count()),
        })
    }
}

/// The same and the next rows, which begin at a place: `[output][row, col]` of all statistics.
fn written(
    mut all: Vec<Writing>,
    first: usize,
    maps: Vec<Vec<f64>>,
) -> Result<Vec<Writing>, StorageError> {
    let mut maps = maps.into_iter();
    for own in &mut all {
        for (field, map) in own.fields.iter_mut().zip(maps.by_ref()) {
            let values = stored_values(&map, own.factor);
            field.band(&values)?;
            own.found.add(first, &values);
        }
    }
    Ok(all)
}

/// Values of a map as they are stored; `factor` leads from the product's unit to that of the statistic.
pub(super) fn stored_values(map: &[f64], factor: f64) -> Vec<f32> {
    map.iter().map(|value| (value * factor) as f32).collect()
}

/// What blocks of cells are computed with.
struct Computing<'a> {
    of_cells: Arc<OfCells>,
    readings: Vec<Reading<'a>>,
    wanted: &'a Arc<Wanted>,
    stored: &'a Stored,
    /// Cells that are wanted.
    all_cells: usize,
    progress: &'a Progress<'a>,
}

impl Computing<'_> {
    /// Maps `[output][row, col]` of some rows of the product, whose blocks these are, and by statistic the anomalies of them that are held; `done`
    /// counts cells.
    async fn of(
        &self,
        blocks: &Blocks,
        rows: &Range<u32>,
        done: &mut usize,
    ) -> Result<(Vec<Vec<f64>>, Vec<Option<Held>>), ComputeError> {
        let Self {
            of_cells,
            readings,
            wanted,
            stored,
            ..
        } = self;
        let cols = stored.grid.cols as usize;
        let first = rows.start as usize * cols;
        let outputs: usize = of_cells.output_counts().iter().sum();
        let mut maps = vec![vec![f64::NAN; rows.len() * cols]; outputs];
        let room = |count| (count > 0).then(|| Held::nothing(count, blocks.cell_count()));
        let mut held: Vec<Option<Held>> = of_cells.anomaly_counts().map(room).collect();
        let steps_of_all = readings.iter().map(|it| it.manifest.steps.len()).sum();
        let groups = blocks.groups(steps_of_all);
        let mut found = stream::iter(groups.of_blocks())
            .map(|windows| found(of_cells, wanted, readings, (windows, groups.pieces)).boxed())
            .buffered(GROUPS_AT_ONCE)
            .map_ok(|found| stream::iter(found.into_iter().map(Ok::<OfBlocks, ComputeError>)))
            .try_flatten()
            .boxed();
        while let Some(found) = found.try_next().await? {
            for (cell, place) in found.places.iter().enumerate() {
                let values = &found.values[cell * outputs..][..outputs];
                for (map, value) in maps.iter_mut().zip(values) {
                    map[stored.place(*place) - first] = *value;
                }
            }
            let mut anomalies = found.anomalies.as_slice();
            while !anomalies.is_empty() {
                for held in held.iter_mut().flatten() {
                    anomalies = held.take(anomalies);
                }
            }
            *done += wanted.count(found.places.into_iter());
            (self.progress)(DeriveProgress {
                done_steps: *done,
                all_steps: self.all_cells,
            });
        }
        drop(found);
        Ok((maps, held))
    }
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

/// The rows of the product that are computed together: all where the values of all outputs have room, else as many as have.
///
/// # Errors
/// There is no room for the fewest that are written together, or anomalies are among what is asked for, which are less the maps of all cells.
fn bands(
    engine: &Engine,
    plans: &[Plan],
    outputs: usize,
    grid: &Grid,
) -> Result<Vec<Range<u32>>, ContractError> {
    let most = engine.memory_bytes() / COMPUTED_SHARE / size_of::<f64>();
    let cell_count = grid.cell_count();
    if outputs.saturating_mul(cell_count) <= most {
        return Ok(std::iter::once(0..grid.rows).collect());
    }
    let refused = |cell_count: usize| {
        let reason = format!(
            "{outputs} steps of {cell_count} cells are more than the {most} values that are held at once: ask for fewer at a time, or give it more memory (--memory-mib)"
        );
        let name = plans[0].statistic.to_string();
        ContractError::invalid("statistic", &name, reason)
    };
    if plans.iter().any(is_anomaly) {
        return Err(refused(cell_count));
    }
    let row_values = outputs.saturating_mul(grid.cols as usize).max(1);
    let rows = most / row_values / BAND_ROWS as usize * BAND_ROWS as usize;
    let Some(rows) = u32::try_from(rows).ok().filter(|rows| *rows > 0) else {
        let fewest = BAND_ROWS.min(grid.rows) as usize * grid.cols as usize;
        return Err(refused(fewest));
    };
    let starts = (0..grid.rows).step_by(rows as usize);
    Ok(starts
        .map(|first| first..grid.rows.min(first.saturating_add(rows)))
        .collect())
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
