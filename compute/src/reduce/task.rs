//! A piece of a question: some blocks of a run of steps, or chunks of a field, read, reduced and forgotten.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, OnceLock};

use contract::chunk::Window;
use cube::{BLOCK_CELLS, EncodedBlocks, EncodedSums, RUN_STEPS, Undecoded};
use serde::{Deserialize, Serialize};
use storage::rows::Stored;
use storage::{StorageError, fields};

use super::accumulator::Accumulated;
use super::cells::{self, Cells, block, block_window};
use super::piece_queue;
use super::question::{Layout, Piece, Question, Wanted};
use super::reduction::{CellShares, Reduction};
use super::remembered_shares::RememberedShares;
use super::stored::{Stored as StoredSums, Terms};
use super::values::Values;
use crate::ComputeError;
use crate::objects::Objects;

use crate::region::loaded::{RegionWeights, weights_failed};

/// What the last tasks of a long question read, bytes before compression: some 5 to 10 ms, where to hand out a task takes one to two.
const LAST_TASK_BYTES: u64 = 8 << 20;

/// Some pieces of a question, as they are handed to a process.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Task {
    pub(super) question: Question,
    pub(super) pieces: Vec<Piece>,
}

impl Task {
    /// As it stands in a query.
    pub(crate) fn text(&self) -> String {
        serde_json::to_string(self).expect("it is plain data")
    }

    /// The task of a text.
    ///
    /// # Errors
    /// It is none.
    pub(crate) fn of_text(text: &str) -> Result<Self, ComputeError> {
        serde_json::from_str(text).map_err(|e| ComputeError::inconsistent("a task", e))
    }

    /// Its pieces as tasks for so many places to work, none of them idle: large ones first, and ever smaller ones, so that all are done at
    /// about the same time, however quick each is. Steps that lie side by side go together. A task then tells of few steps and few
    /// ranges of percentiles, each of which is merged once or twice and not once a task, and has its share of land and of sea.
    pub(crate) fn dealt(mut self, places: usize) -> Vec<Self> {
        let cost = |piece: &Piece| piece.cost_bytes().max(1);
        let ends = ends(self.pieces.iter().map(cost).sum(), places.max(1) as u64);
        self.pieces.sort_by_key(|piece| piece.first_step);
        let mut before = 0;
        let mut tasks: BTreeMap<usize, Vec<Piece>> = BTreeMap::new();
        for piece in self.pieces {
            // By its middle: who has half of it more than the others gets it.
            let own = cost(&piece);
            let at = ends.partition_point(|end| *end <= before + own / 2);
            before += own;
            tasks.entry(at).or_default().push(piece);
        }
        if tasks.is_empty() {
            tasks.insert(0, vec![]);
        }
        let task = |pieces: Vec<Piece>| Self {
            question: self.question.about(&pieces),
            pieces,
        };
        tasks.into_values().map(task).collect()
    }

    /// Works on its pieces one after the other. None where this process does not find along time what they were to be read
    /// from: a cube goes on while a question is on its way.
    pub(crate) async fn run(self, objects: &Objects) -> Result<Option<Accumulated>, ComputeError> {
        let is_along_time = |piece: &Piece| matches!(piece.layout, Layout::Blocks | Layout::Sums);
        let values = if self.pieces.iter().any(is_along_time) {
            match objects.values(&self.question.version).await {
                Err(error) if !error.is_retryable() => {
                    tracing::warn!(version = %self.question.version, %error, "its cube cannot be read");
                    None
                }
                opened => opened?,
            }
        } else {
            None
        };
        let holds = |piece: &Piece| match (piece.layout, &values) {
            (Layout::Field(_), _) => true,
            (Layout::Blocks | Layout::Sums, None) => false,
            (Layout::Blocks, Some(values)) => {
                let steps = piece.of_version();
                let runs = values.time_major();
                runs.iter()
                    .any(|run| run.start <= steps.start && steps.end <= run.end)
            }
            (Layout::Sums, Some(values)) => {
                let basis = values.summed_as(&piece.of_version());
                basis.is_some_and(|basis| basis.scale == self.question.scale)
            }
        };
        if !self.pieces.iter().all(holds) {
            return Ok(None);
        }
        let worker = Worker::new(objects, self.question, values).await?;
        let reduce = async move |piece| worker.reduce(piece).await;
        match piece_queue::reduced(reduce, self.pieces, 1).await {
            // Chunks that are gone or damaged: the fields say what they held.
            Err(ComputeError::Cube(error)) if !error.is_retryable() => {
                tracing::warn!(%error, "a cube cannot be read");
                Ok(None)
            }
            reduced => reduced.map(Some),
        }
    }
}

/// Where tasks for so many places end that read so much in all: each takes a part of what is left (Polychronopoulos and Kuck 1987,
/// doi:10.1109/TC.1987.5009495), half of what would be a place's, and the last ones are equal.
fn ends(all: u64, places: u64) -> Vec<u64> {
    let least = LAST_TASK_BYTES.min(all / (2 * places)).max(1);
    let mut ends = vec![];
    let mut end = 0;
    while end < all {
        end = (end + ((all - end) / (2 * places)).max(least)).min(all);
        ends.push(end);
    }
    ends
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
    shares: Arc<RememberedShares>,
    /// The version along time, where it was opened.
    values: Option<cube::Values>,
    /// Chunks of fields, once the first of them is read.
    windows: Arc<OnceLock<Vec<Window>>>,
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
            shares: objects.shares().of(&question),
            objects: objects.clone(),
            question: Arc::new(question),
            values,
            windows: Arc::default(),
        })
    }

    /// Reads the values of a piece and reduces them, which keeps the thread that it is polled on busy.
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

    async fn tried(&self, stored: &Stored, piece: &Piece) -> Result<Accumulated, ComputeError> {
        let Layout::Field(period) = piece.layout else {
            return Err(ComputeError::inconsistent(piece.key.as_str(), NOT_OPENED));
        };
        let index = self.objects.row_index(stored).await?;
        let fetched = storage::rows::fetch(stored, index, piece.rows.to_vec()).await?;
        let shape = self.question.shape;
        let windows = self.windows.get_or_init(|| cells::chunks(shape));
        self.reduced(piece, windows, |take| {
            fetched.each(|row| fields::expected(windows, row, period), take)
        })
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
        let encoded = values.encoded(&places, piece.of_version()).await?;
        let Some(encoded) = encoded else {
            return Err(ComputeError::inconsistent(piece.key.as_str(), NOT_OPENED));
        };
        match self.reduced_blocks(&piece, &encoded) {
            Ok(reduced) => reduced,
            Err(undecoded) => Err(encoded.error(undecoded).await.into()),
        }
    }

    /// Reads stored sums of blocks, and the values of those that could not be summed.
    async fn stored(&self, piece: Piece) -> Result<Accumulated, ComputeError> {
        let not_opened = || ComputeError::inconsistent(piece.key.as_str(), NOT_OPENED);
        let steps = piece.of_version();
        let values = self.values.clone().ok_or_else(not_opened)?;
        let basis = values.summed_as(&steps).ok_or_else(not_opened)?;
        let across = self.question.shape[1].div_ceil(BLOCK_CELLS);
        let terms = Terms::of(&piece.inside, across, basis.shard_cols);
        let places = terms.blocks().map(|block| [block / across, block % across]);
        let places: Vec<[u32; 2]> = places.collect();
        let encoded = values.sums(&places, steps).await?;
        let encoded = encoded.ok_or_else(not_opened)?;
        let (mut all, rest) = match self.reduced_sums(&piece, &terms, &encoded) {
            Ok(reduced) => reduced,
            Err(undecoded) => return Err(encoded.error(undecoded).await.into()),
        };
        if !rest.is_empty() {
            let runs = rest.iter().map(|run| &piece.inside[*run]);
            let rows = runs.flat_map(|run| run.first..=run.last).collect();
            let rest = Piece {
                layout: Layout::Blocks,
                rows,
                inside: vec![],
                ..piece
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
        let shape = self.question.shape;
        let with_squares = matches!(
            self.question.wanted,
            Wanted::Sums {
                with_squares: true,
                ..
            }
        );
        let mut stored = StoredSums::new(terms, records.pieces(), with_squares);
        records.each(stored.wanted(), |term, record| {
            let weights = |number: u32| {
                let window = block_window(shape, number);
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
        let shape = self.question.shape;
        let mut reduction = Reduction::of(&self.question, piece, self.seconds(piece));
        let made = |number: u32| self.cells_of(block_window(shape, number), true);
        let shares = self.shares.of(&piece.rows, made);
        let mut failed = None;
        let rows: Vec<u8> = shares.iter().map(|own| own.block_rows()).collect();
        blocks.each(
            |number| rows[number],
            |number, values| {
                let cells = &shares[number];
                let added = blocks.pieces().iter().try_for_each(|run| {
                    let run_values = Values {
                        of: values,
                        step_count: RUN_STEPS,
                        first: run.in_run,
                    };
                    reduction.add(run_values, cells, run.asked..run.asked + run.count)
                });
                failed = added.err();
                failed.is_none()
            },
        )?;
        Ok(failed.map_or_else(|| Ok(reduction.accumulated()), Err))
    }

    /// Reduces rows.
    fn reduced(
        &self,
        piece: &Piece,
        windows: &[Window],
        each: impl FnOnce(&mut Take<'_>) -> Result<(), ComputeError>,
    ) -> Result<Accumulated, ComputeError> {
        let mut reduction = Reduction::of(&self.question, piece, self.seconds(piece));
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
        Ok(reduction.accumulated())
    }

    /// What values of a piece's steps are multiplied with besides areas.
    fn seconds(&self, piece: &Piece) -> Vec<f64> {
        let Wanted::RegionSums { measure, .. } = self.question.wanted else {
            return vec![];
        };
        match (piece.layout, &self.values) {
            (Layout::Field(period), _) => vec![measure.seconds(period)],
            (Layout::Blocks | Layout::Sums, Some(values)) => {
                let steps = &values.manifest().steps[piece.of_version()];
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
