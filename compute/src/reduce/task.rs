//! A piece of a question: some blocks of a run of steps, or chunks of a field, read, reduced and forgotten.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use contract::chunk::Window;
use contract::digest::Digest;
use contract::key::ObjectKey;
use contract::time::Period;
use cube::BLOCK_CELLS;
use serde::{Deserialize, Serialize};
use storage::rows::Stored;
use storage::{StorageError, fields};

use super::accumulator::{Accumulated, StepSums, too_large};
use super::cells::{self, Cells, Shape, WeightUnit};
use super::histogram::Buckets;
use super::kernel::{Block, Scratch, Target, add_sums, add_weights};
use super::scale::Scale;
use crate::ComputeError;
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
        let Wanted::Sums { with_squares } = self.wanted else {
            return None;
        };
        let weights = (self.shape, &self.whole, &self.covered, self.unit);
        Some(Digest::of_json(&(run, weights, self.scale, with_squares)))
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
    },
    /// Weights by ranges of values.
    Histograms {
        ranges: Vec<Buckets>,
        /// By the index of a step, the ranges that it adds to and the time it has in each one's bin.
        steps: BTreeMap<u32, Vec<(u32, i64)>>,
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
}

/// How values lie where they are read.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Layout {
    /// Time-major: a row a block, `[cell, step]`. Only a process that has opened the version reads it.
    Blocks,
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
        if piece.layout == Layout::Blocks {
            return self.blocks(piece).await;
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
        // A task of its own: chunks are decompressed where they are read.
        let read = tokio::spawn(async move { values.blocks(&places, start..end).await });
        let blocks = read.await;
        let blocks = blocks.map_err(|e| ComputeError::inconsistent("statistics", e))??;
        let piece = Arc::new(piece);
        let rows = Arc::clone(&piece);
        self.beside(&piece, cells::blocks(shape), move |take| {
            let mut own = rows.rows.iter().zip(&blocks);
            own.try_for_each(|(row, block)| take(*row, &block.values))
        })
        .await
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
        let question = &*self.question;
        let cells = Cells {
            shape: question.shape,
            whole: &self.whole,
            covered: &self.covered,
            unit: question.unit,
        };
        let (scale, step_count) = (question.scale, piece.steps.len());
        let targets = piece.targets(&question.wanted);
        let mut scratch = Scratch::default();
        let mut sums = vec![StepSums::default(); piece.steps.len()];
        let mut all = Accumulated::default();
        each(&mut |row: u32, values: &[f32]| {
            let cells = cells.window(windows[row as usize]);
            let block = Block {
                values,
                step_count,
                first: piece.steps.start as usize,
                cells: &cells,
            };
            match &question.wanted {
                Wanted::Sums { with_squares } => {
                    let added = add_sums(block, scale, *with_squares, &mut scratch, &mut sums);
                    added.map_err(|e| ComputeError::inconsistent(piece.key.as_str(), e))
                }
                Wanted::Histograms { ranges, .. } => {
                    let added = add_weights(block, &targets, ranges, &mut all.histograms);
                    added.ok_or_else(too_large)
                }
            }
        })?;
        let first = piece.first_step + piece.steps.start;
        let own = (first..).zip(sums).filter(|(_, sums)| sums.count > 0);
        all.steps.extend(own);
        Ok(all)
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
