//! A piece of a question: some blocks of a run of steps, or chunks of a field, read, reduced and forgotten.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::Arc;

use contract::chunk::Window;
use contract::digest::Digest;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::time::Period;
use cube::scale::Scale;
use cube::weight_unit::WeightUnit;
use cube::{BLOCK_CELLS, EncodedBlocks, EncodedSums, RUN_STEPS, Undecoded};
use serde::{Deserialize, Serialize};
use storage::rows::Stored;
use storage::{StorageError, fields};

use super::accumulator::{Accumulated, too_large};
use super::cells::{self, CellWeight, Cells, Shape, block};
use super::histogram::Buckets;
use super::inside::InsideRun;
use super::kernel::{Summing, Target, add_weights};
use super::region_sums::{CellArea, RegionScratch, RegionStepSums};
use super::stored::{Stored as StoredSums, Terms};
use super::values::Values;
use crate::ComputeError;
use crate::budget::Measure;
use crate::budget::fixed::OutOfRange;
use crate::objects::Objects;

use crate::region::loaded::{RegionWeights, weights_failed};

/// What is asked of every piece.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Question {
    pub(super) shape: Shape,
    /// Address of the weights, or the question that they answer.
    pub(super) whole: String,
    /// The same of what coverage counts.
    pub(super) covered: String,
    pub(super) unit: WeightUnit,
    pub(super) scale: Scale,
    pub(super) wanted: Wanted,
}

impl Question {
    /// What the sums of all steps of a run are remembered by, `run` being what names its values; none of what is no sum.
    pub(super) fn sums_name(&self, run: &Digest) -> Option<Digest> {
        let Wanted::Sums {
            with_squares,
            with_extremes,
        } = self.wanted
        else {
            return None;
        };
        let weights = (self.shape, &self.whole, &self.covered, self.unit);
        let wanted = (with_squares, with_extremes);
        Some(Digest::of_json(&(run, weights, self.scale, wanted)))
    }

    /// How values count in stored sums that it can be answered from, if it can be from any: they know no extremes.
    pub(super) fn in_stored_sums(&self) -> Option<Scale> {
        match self.wanted {
            Wanted::Sums { with_extremes, .. } => (!with_extremes).then_some(self.scale),
            Wanted::Histograms { .. } | Wanted::RegionSums { .. } => None,
        }
    }
}

/// What is accumulated.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Wanted {
    /// Sums by step.
    Sums {
        /// Those of squares too.
        with_squares: bool,
        /// The smallest and the largest value too.
        with_extremes: bool,
    },
    /// Weights by ranges of values.
    Histograms {
        ranges: Vec<Buckets>,
        /// By the index of a step, the ranges that it adds to and the time it has in each one's bin.
        steps: BTreeMap<u32, Vec<(u32, i64)>>,
    },
    /// Mass and area over a region and, by bands of latitude, its sea; the weights of coverage are those of the sea.
    RegionSums {
        /// Whose bands.
        grid: Grid,
        /// What is summed.
        measure: Measure,
    },
}

/// Values to read.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Piece {
    /// Name of the object; of blocks that of the field of their first step.
    pub(super) key: ObjectKey,
    /// Where queries read it; nowhere in particular if it holds blocks.
    pub(super) address: String,
    pub(super) layout: Layout,
    /// Index of its first step in the version.
    pub(super) first_step: u32,
    /// Steps of it that are reduced, counted from its first.
    pub(super) steps: Range<u32>,
    /// Numbers of blocks or chunks, increasing.
    pub(super) rows: Vec<u32>,
    /// Blocks whose stored sums are read.
    pub(super) inside: Vec<InsideRun>,
}

/// How values lie where they are read.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Layout {
    /// Time-major: a row a block, `[cell, step]`. Only a process that has opened the version reads it.
    Blocks,
    /// Stored sums of blocks. Only a process that has opened the version reads them.
    Sums,
    /// A row a chunk of one step.
    Field(Period),
}

/// Some pieces of a question, as they are handed to a process.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Task {
    pub(super) question: Question,
    pub(super) pieces: Vec<Piece>,
}

impl Task {
    /// As it stands in a query.
    pub(super) fn text(&self) -> String {
        serde_json::to_string(self).expect("it is plain data")
    }

    /// The task of a text.
    ///
    /// # Errors
    /// It is none.
    pub(crate) fn of_text(text: &str) -> Result<Self, ComputeError> {
        serde_json::from_str(text).map_err(|e| ComputeError::inconsistent("a task", e))
    }

    /// Works on its pieces one after the other.
    pub(crate) async fn run(self, objects: &Objects) -> Result<Accumulated, ComputeError> {
        let worker = Worker::new(objects, self.question, None).await?;
        let mut all = Accumulated::default();
        for piece in self.pieces {
            all.merge(worker.reduce(piece).await?)?;
        }
        Ok(all)
    }
}

/// Takes a row and its values.
type Take<'a> = dyn FnMut(u32, &[f32]) -> Result<(), ComputeError> + 'a;

const NOT_OPENED: &str = "its values along time were not opened";

/// Who works on pieces of a question, its weights at hand. Clones share them.
#[derive(Clone)]
pub(super) struct Worker {
    objects: Objects,
    question: Arc<Question>,
    whole: Arc<RegionWeights>,
    covered: Arc<RegionWeights>,
    /// The version along time, where it was opened.
    values: Option<cube::Values>,
}

impl Worker {
    pub(super) async fn new(
        objects: &Objects,
        question: Question,
        values: Option<cube::Values>,
    ) -> Result<Self, ComputeError> {
        let weights = async |address: &str| {
            let found = objects.weights(address).await;
            found.map_err(weights_failed)
        };
        Ok(Self {
            whole: weights(&question.whole).await?,
            covered: weights(&question.covered).await?,
            objects: objects.clone(),
            question: Arc::new(question),
            values,
        })
    }

    /// Reads the values of a piece and reduces them.
    ///
    /// # Errors
    /// They cannot be read, are damaged, or beyond anything physical.
    pub(super) async fn reduce(&self, piece: Piece) -> Result<Accumulated, ComputeError> {
        match piece.layout {
            Layout::Blocks => return self.blocks(piece).await,
            Layout::Sums => return self.stored(piece).await,
            Layout::Field(_) => {}
        }
        let stored = self.objects.stored(&piece.key, &piece.address)?;
        let piece = Arc::new(piece);
        let first = self.tried(&stored, &piece).await;
        match first {
            // What is remembered of the file may be that of a damaged one, which was stored anew since.
            Err(ComputeError::Storage(StorageError::Damaged { .. })) => {
                self.objects.forget(&stored);
                self.tried(&stored, &piece).await
            }
            other => other,
        }
    }

    async fn tried(
        &self,
        stored: &Stored,
        piece: &Arc<Piece>,
    ) -> Result<Accumulated, ComputeError> {
        let Layout::Field(period) = piece.layout else {
            return Err(ComputeError::inconsistent(piece.key.as_str(), NOT_OPENED));
        };
        let index = self.objects.row_index(stored).await?;
        let fetched = storage::rows::fetch(stored, index, piece.rows.clone()).await?;
        let windows = cells::chunks(self.question.shape);
        let expected = windows.clone();
        self.beside(piece, windows, move |take| {
            fetched.each(|row| fields::expected(&expected, row, period), take)
        })
        .await
    }

    /// Reads blocks of the version along time and reduces them.
    async fn blocks(&self, piece: Piece) -> Result<Accumulated, ComputeError> {
        let Some(values) = self.values.clone() else {
            return Err(ComputeError::inconsistent(piece.key.as_str(), NOT_OPENED));
        };
        let shape = self.question.shape;
        let across = shape[1].div_ceil(BLOCK_CELLS);
        let places = piece.rows.iter().map(|row| [row / across, row % across]);
        let places: Vec<[u32; 2]> = places.collect();
        let [start, end] =
            [piece.steps.start, piece.steps.end].map(|step| (piece.first_step + step) as usize);
        let encoded = values.encoded(&places, start..end).await?;
        let Some(encoded) = encoded else {
            return Err(ComputeError::inconsistent(piece.key.as_str(), NOT_OPENED));
        };
        let (worker, piece) = (self.clone(), Arc::new(piece));
        let encoded = Arc::new(encoded);
        let own = Arc::clone(&encoded);
        let reduced = tokio::task::spawn_blocking(move || worker.reduced_blocks(&piece, &own));
        let reduced = reduced.await;
        match reduced.map_err(|e| ComputeError::inconsistent("statistics", e))? {
            Ok(reduced) => reduced,
            Err(undecoded) => Err(encoded.error(undecoded).await.into()),
        }
    }

    /// Reads stored sums of blocks, and the values of those that could not be summed.
    async fn stored(&self, piece: Piece) -> Result<Accumulated, ComputeError> {
        let not_opened = || ComputeError::inconsistent(piece.key.as_str(), NOT_OPENED);
        let [start, end] =
            [piece.steps.start, piece.steps.end].map(|step| (piece.first_step + step) as usize);
        let values = self.values.clone().ok_or_else(not_opened)?;
        let basis = values.summed_as(&(start..end)).ok_or_else(not_opened)?;
        let across = self.question.shape[1].div_ceil(BLOCK_CELLS);
        let terms = Arc::new(Terms::of(&piece.inside, across, basis.shard_cols));
        let places = terms.blocks().map(|block| [block / across, block % across]);
        let places: Vec<[u32; 2]> = places.collect();
        let encoded = values.sums(&places, start..end).await?;
        let encoded = Arc::new(encoded.ok_or_else(not_opened)?);
        let (worker, piece) = (self.clone(), Arc::new(piece));
        let (own, of) = (Arc::clone(&encoded), Arc::clone(&piece));
        let reduced = tokio::task::spawn_blocking(move || worker.reduced_sums(&of, &terms, &own));
        let reduced = reduced.await;
        let (mut all, rest) =
            match reduced.map_err(|e| ComputeError::inconsistent("statistics", e))? {
                Ok(reduced) => reduced,
                Err(undecoded) => return Err(encoded.error(undecoded).await.into()),
            };
        if !rest.is_empty() {
            let runs = rest.iter().map(|run| &piece.inside[*run]);
            let rest = Piece {
                layout: Layout::Blocks,
                rows: runs.flat_map(|run| run.first..=run.last).collect(),
                inside: vec![],
                ..Piece::clone(&piece)
            };
            all.merge(self.blocks(rest).await?)?;
        }
        Ok(all)
    }

    /// Sums of records as they are decoded, and the runs of blocks whose values are to be read.
    fn reduced_sums(
        &self,
        piece: &Piece,
        terms: &Terms,
        records: &EncodedSums,
    ) -> Result<(Accumulated, BTreeSet<usize>), Undecoded> {
        let windows = cells::blocks(self.question.shape);
        let with_squares = matches!(
            self.question.wanted,
            Wanted::Sums {
                with_squares: true,
                ..
            }
        );
        let mut stored = StoredSums::new(terms, records.pieces(), with_squares);
        records.each(|term, record| {
            let weights = |number: u32| {
                let window = windows[number as usize];
                block(self.cells().window(window), window)
            };
            stored.add(term, record, weights);
            true
        })?;
        let (sums, rest) = stored.finish();
        let mut all = Accumulated::default();
        let first = piece.first_step + piece.steps.start;
        let own = (first..).zip(sums).filter(|(_, sums)| sums.count > 0);
        all.steps.extend(own);
        Ok((all, rest))
    }

    fn cells(&self) -> Cells<'_> {
        Cells {
            shape: self.question.shape,
            whole: &self.whole,
            covered: &self.covered,
            unit: self.question.unit,
        }
    }

    /// Reduces blocks as they are decoded.
    fn reduced_blocks(
        &self,
        piece: &Piece,
        blocks: &EncodedBlocks,
    ) -> Result<Result<Accumulated, ComputeError>, Undecoded> {
        let windows = cells::blocks(self.question.shape);
        let mut reduction = Reduction::of(self, piece);
        let mut failed = None;
        blocks.each(|number, values| {
            let cells = self.cells_of(windows[piece.rows[number] as usize], true);
            let added = blocks.pieces().iter().try_for_each(|run| {
                let run_values = Values {
                    of: values,
                    step_count: RUN_STEPS,
                    first: run.in_run,
                };
                reduction.add(run_values, &cells, run.asked..run.asked + run.count)
            });
            failed = added.err();
            failed.is_none()
        })?;
        Ok(failed.map_or_else(|| reduction.accumulated(), Err))
    }

    /// Reduces rows on a thread of its own; `each` hands them over, `windows` are where they lie.
    async fn beside(
        &self,
        piece: &Arc<Piece>,
        windows: Vec<Window>,
        each: impl FnOnce(&mut Take<'_>) -> Result<(), ComputeError> + Send + 'static,
    ) -> Result<Accumulated, ComputeError> {
        let (worker, piece) = (self.clone(), Arc::clone(piece));
        let reduced = tokio::task::spawn_blocking(move || worker.reduced(&piece, &windows, each));
        let reduced = reduced.await;
        reduced.map_err(|e| ComputeError::inconsistent("statistics", e))?
    }

    /// Reduces rows.
    fn reduced(
        &self,
        piece: &Piece,
        windows: &[Window],
        each: impl FnOnce(&mut Take<'_>) -> Result<(), ComputeError>,
    ) -> Result<Accumulated, ComputeError> {
        let mut reduction = Reduction::of(self, piece);
        let steps = piece.steps.start as usize..piece.steps.end as usize;
        each(&mut |row: u32, values: &[f32]| {
            let cells = self.cells_of(windows[row as usize], false);
            let own = Values {
                of: values,
                step_count: steps.len(),
                first: steps.start,
            };
            reduction.add(own, &cells, 0..steps.len())
        })?;
        reduction.accumulated()
    }

    /// What values of a piece's steps are multiplied with besides areas.
    fn seconds(&self, piece: &Piece) -> Vec<f64> {
        let Wanted::RegionSums { measure, .. } = self.question.wanted else {
            return vec![];
        };
        match (piece.layout, &self.values) {
            (Layout::Field(period), _) => vec![measure.seconds(period)],
            (Layout::Blocks | Layout::Sums, Some(values)) => {
                let first = piece.first_step as usize;
                let all = first + piece.steps.start as usize..first + piece.steps.end as usize;
                let steps = &values.manifest().steps[all];
                steps
                    .iter()
                    .map(|step| measure.seconds(step.period))
                    .collect()
            }
            (Layout::Blocks | Layout::Sums, None) => vec![],
        }
    }

    /// What the cells of a window have of the geometry, of a block as of 8 x 8 cells wherever the grid ends.
    fn cells_of(&self, window: Window, is_block: bool) -> CellShares {
        let cells = self.cells();
        match &self.question.wanted {
            Wanted::RegionSums { grid, .. } => {
                let areas = cells.areas(window, grid);
                CellShares::Areas(if is_block {
                    block(areas, window)
                } else {
                    areas
                })
            }
            Wanted::Sums { .. } | Wanted::Histograms { .. } => {
                let weights = cells.window(window);
                CellShares::Weights(if is_block {
                    block(weights, window)
                } else {
                    weights
                })
            }
        }
    }
}

/// What cells have of a geometry, row by row.
enum CellShares {
    Weights(Vec<CellWeight>),
    Areas(Vec<CellArea>),
}

/// What is accumulated of a piece.
struct Reduction<'a> {
    question: &'a Question,
    piece: &'a Piece,
    targets: Vec<Target>,
    sums: Option<Summing>,
    regions: Vec<RegionStepSums>,
    /// Of each step what its values are multiplied with besides the area; nothing where no sums over a region are wanted.
    seconds: Vec<f64>,
    all: Accumulated,
}

impl<'a> Reduction<'a> {
    fn of(worker: &'a Worker, piece: &'a Piece) -> Self {
        let seconds = worker.seconds(piece);
        let is_of_region = matches!(worker.question.wanted, Wanted::RegionSums { .. });
        let steps = piece.steps.len();
        let sums = match worker.question.wanted {
            Wanted::Sums { with_squares, .. } => {
                Some(Summing::new(steps, worker.question.scale, with_squares))
            }
            Wanted::Histograms { .. } | Wanted::RegionSums { .. } => None,
        };
        Self {
            seconds,
            question: &worker.question,
            piece,
            targets: piece.targets(&worker.question.wanted),
            sums,
            regions: vec![RegionStepSums::default(); if is_of_region { steps } else { 0 }],
            all: Accumulated::default(),
        }
    }

    /// Adds values whose summed steps are `steps` of the piece, counted from its first summed one.
    fn add(
        &mut self,
        values: Values<'_>,
        cells: &CellShares,
        steps: Range<usize>,
    ) -> Result<(), ComputeError> {
        let refused = |e: OutOfRange| ComputeError::inconsistent(self.piece.key.as_str(), e);
        match (&self.question.wanted, cells) {
            (Wanted::Sums { .. }, CellShares::Weights(cells)) => match &mut self.sums {
                Some(sums) => sums.add(values, cells, steps).map_err(refused),
                None => Ok(()),
            },
            (Wanted::Histograms { ranges, .. }, CellShares::Weights(cells)) => {
                let own = self.targets.iter().filter(|it| steps.contains(&it.step));
                let own = own.map(|it| Target {
                    step: it.step - steps.start,
                    ranges: it.ranges.clone(),
                });
                let own: Vec<Target> = own.collect();
                let added = add_weights(values, cells, &own, ranges, &mut self.all.histograms);
                added.ok_or_else(too_large)
            }
            (Wanted::RegionSums { .. }, CellShares::Areas(cells)) => {
                let (seconds, sums) = (&self.seconds[steps.clone()], &mut self.regions[steps]);
                let mut scratch = RegionScratch::new(seconds.len());
                scratch.add(values, cells, seconds, sums).map_err(refused)
            }
            _ => Err(ComputeError::inconsistent(
                self.piece.key.as_str(),
                "its cells are not what is summed",
            )),
        }
    }

    fn accumulated(mut self) -> Result<Accumulated, ComputeError> {
        let first = self.piece.first_step + self.piece.steps.start;
        if let Some(sums) = self.sums {
            let sums = sums.finish();
            let sums = sums.map_err(|e| ComputeError::inconsistent(self.piece.key.as_str(), e))?;
            let with_extremes = matches!(
                self.question.wanted,
                Wanted::Sums {
                    with_extremes: true,
                    ..
                }
            );
            // Stored sums know none: those of the rest would be some of all.
            let own = sums.into_iter().map(|own| match with_extremes {
                true => own,
                false => own.without_extremes(),
            });
            let own = (first..).zip(own);
            self.all
                .steps
                .extend(own.filter(|(_, sums)| sums.count > 0));
        }
        self.all.regions.extend((first..).zip(self.regions));
        Ok(self.all)
    }
}

impl Piece {
    /// Ranges that its steps add to.
    fn targets(&self, wanted: &Wanted) -> Vec<Target> {
        let Wanted::Histograms { steps, .. } = wanted else {
            return vec![];
        };
        let first = self.first_step + self.steps.start;
        let own = steps.range(first..self.first_step + self.steps.end);
        let target = |(step, ranges): (&u32, &Vec<(u32, i64)>)| Target {
            step: (step - first) as usize,
            ranges: ranges.clone(),
        };
        own.map(target).collect()
    }
}
