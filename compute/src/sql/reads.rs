//! What has to be read for a selection: of every run of steps blocks of the version along time or chunks of its fields,
//! whichever is less, in pieces of about a mebibyte.

use std::ops::Range;
use std::sync::Arc;

use contract::chunk::{CHUNK_COLS, CHUNK_ROWS, Window, field_chunks};
use contract::grid::Grid;
use cube::{BLOCK_CELLS, RUN_STEPS, Values};

use super::selection::Selection;
use crate::reduce::are_fields_less;

/// Values of a piece, bytes decoded; its rows take some ten times that.
const PIECE_BYTES: usize = 1 << 20;
/// Fewer steps than these are never worth opening the version along time.
const LEAST_STEPS: usize = 4;
const VALUE_BYTES: usize = size_of::<f32>();
const CHUNKS_AT_ONCE: usize =
    PIECE_BYTES.div_ceil((CHUNK_ROWS * CHUNK_COLS) as usize * VALUE_BYTES);
const BLOCKS_AT_ONCE: usize = PIECE_BYTES / BLOCK_BYTES;
const BLOCK_BYTES: usize = (BLOCK_CELLS * BLOCK_CELLS) as usize * VALUE_BYTES * RUN_STEPS;

/// A part of the selection, read and handed on.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Piece {
    /// Chunks of a step.
    Chunks { step: u32, chunks: Vec<u32> },
    /// Blocks, by row and column of blocks, of some selected steps of one run.
    Blocks {
        steps: Vec<u32>,
        blocks: Vec<[u32; 2]>,
    },
}

/// How some selected steps are read; `steps` are places in the selection.
#[derive(Debug, Clone, PartialEq)]
enum Part {
    Fields { steps: Range<usize> },
    Run { steps: Range<usize> },
}

/// All pieces of a selection, in the order of time.
#[derive(Debug)]
pub(super) struct Reads {
    steps: Vec<u32>,
    parts: Vec<Part>,
    /// Chunks of the grid, and those touched.
    windows: Vec<Window>,
    chunks: Vec<u32>,
    blocks: Vec<[u32; 2]>,
}

impl Reads {
    /// `values` is the version along time, if it was opened.
    pub(super) fn of(grid: &Grid, selection: &Selection, values: Option<&Values>) -> Self {
        let windows = field_chunks(grid);
        let across = grid.cols.div_ceil(CHUNK_COLS);
        let chunks = touched(selection, CHUNK_ROWS, CHUNK_COLS);
        let chunks: Vec<u32> = chunks.map(|[row, col]| row * across + col).collect();
        let blocks: Vec<[u32; 2]> = touched(selection, BLOCK_CELLS, BLOCK_CELLS).collect();
        let time_major = values.map(Values::time_major).unwrap_or_default();
        let mut reads = Self {
            steps: selection.steps.clone(),
            parts: vec![],
            windows,
            chunks,
            blocks,
        };
        let place = |step: usize| selection.steps.partition_point(|it| (*it as usize) < step);
        let mut next = 0;
        for run in time_major {
            let wanted = place(run.start)..place(run.end);
            let whole = run.start as u32..run.end as u32;
            let counts = (wanted.len(), reads.blocks.len(), reads.chunks.len());
            // Cells come one by one: no stored sums are read.
            if wanted.is_empty() || are_fields_less(&whole, counts.0, [0, counts.1], counts.2) {
                continue;
            }
            reads.fields(next..wanted.start);
            next = wanted.end;
            reads.parts.push(Part::Run { steps: wanted });
        }
        reads.fields(next..selection.steps.len());
        reads
    }

    fn fields(&mut self, steps: Range<usize>) {
        if !steps.is_empty() {
            self.parts.push(Part::Fields { steps });
        }
    }

    /// Might the version along time be less to read than fields? Only then it is worth opening.
    pub(super) fn may_be_less_along_time(selection: &Selection) -> bool {
        let chunks = touched(selection, CHUNK_ROWS, CHUNK_COLS).count();
        let blocks = touched(selection, BLOCK_CELLS, BLOCK_CELLS).count();
        let steps = selection.steps.len();
        steps >= LEAST_STEPS && !are_fields_less(&(0..RUN_STEPS as u32), steps, [0, blocks], chunks)
    }

    /// Chunks of a field that the selection touches, and all.
    pub(super) fn chunk_counts(&self) -> [usize; 2] {
        [self.chunks.len(), self.windows.len()]
    }

    /// In words: fields, blocks or both.
    pub(super) fn how(&self) -> &'static str {
        let is_run = |part: &Part| matches!(part, Part::Run { .. });
        match (
            self.parts.iter().any(|part| !is_run(part)),
            self.parts.iter().any(is_run),
        ) {
            (true, true) => "fields and blocks",
            (false, true) => "blocks",
            _ => "fields",
        }
    }

    /// Bytes of values that are decoded for it.
    pub(super) fn bytes(&self) -> usize {
        let of_step: usize = self
            .chunks
            .iter()
            .map(|chunk| self.chunk_bytes(*chunk))
            .sum();
        let of_part = |part: &Part| match part {
            Part::Fields { steps } => steps.len() * of_step,
            Part::Run { .. } => self.blocks.len() * BLOCK_BYTES,
        };
        self.parts.iter().map(of_part).sum()
    }

    fn chunk_bytes(&self, chunk: u32) -> usize {
        self.windows[chunk as usize].cell_count() * VALUE_BYTES
    }

    /// Where a chunk lies.
    pub(super) fn windows(&self) -> &[Window] {
        &self.windows
    }

    /// The pieces, made one by one: of a large product there are millions.
    pub(super) fn pieces(self: &Arc<Self>) -> Pieces {
        Pieces {
            reads: Arc::clone(self),
            part: 0,
            step: 0,
            group: 0,
        }
    }
}

/// Pieces one after the other.
pub(super) struct Pieces {
    reads: Arc<Reads>,
    part: usize,
    /// Place of the step among those of a part of fields.
    step: usize,
    /// Place of the chunks or blocks among those read together.
    group: usize,
}

impl Pieces {
    fn in_part(&mut self) -> Option<Piece> {
        let reads = &self.reads;
        let place = self.group;
        self.group += 1;
        match reads.parts.get(self.part)? {
            Part::Fields { steps } => {
                let step = *reads.steps[steps.clone()].get(self.step)?;
                let chunks = reads.chunks.chunks(CHUNKS_AT_ONCE).nth(place);
                Some(Piece::Chunks {
                    step,
                    chunks: chunks?.to_vec(),
                })
            }
            Part::Run { steps } => Some(Piece::Blocks {
                blocks: reads.blocks.chunks(BLOCKS_AT_ONCE).nth(place)?.to_vec(),
                steps: reads.steps[steps.clone()].to_vec(),
            }),
        }
    }
}

impl Iterator for Pieces {
    type Item = Piece;

    fn next(&mut self) -> Option<Piece> {
        loop {
            if let Some(piece) = self.in_part() {
                return Some(piece);
            }
            self.group = 0;
            match self.reads.parts.get(self.part)? {
                Part::Fields { steps } if self.step + 1 < steps.len() => self.step += 1,
                _ => (self.part, self.step) = (self.part + 1, 0),
            }
        }
    }
}

/// Rectangles of `rows` x `cols` cells that hold a selected cell, by row and column of rectangles.
fn touched(selection: &Selection, rows: u32, cols: u32) -> impl Iterator<Item = [u32; 2]> {
    let along = |places: &[u32], side: u32| {
        let mut own: Vec<u32> = places.iter().map(|place| place / side).collect();
        own.dedup();
        own
    };
    let across = along(&selection.cols, cols);
    let down = along(&selection.rows, rows).into_iter();
    down.flat_map(move |row| across.clone().into_iter().map(move |col| [row, col]))
}
