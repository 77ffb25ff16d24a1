//! What is asked of values, and which values it is asked of: plain data, as it passes from process to process.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use contract::chunk::{CHUNK_COLS, CHUNK_ROWS};
use contract::digest::Digest;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::manifest::ManifestId;
use contract::time::Period;
use cube::BLOCK_CELLS;
use cube::scale::Scale;
use cube::weight_unit::WeightUnit;
use serde::{Deserialize, Serialize};

use super::cells::Shape;
use super::histogram::Buckets;
use super::inside::InsideRun;
use super::region_sums::CellArea;
use crate::budget::Measure;

/// Values that a piece holds at once, bytes before compression.
pub(super) const PIECE_BYTES: u64 = 8 << 20;
/// Chunks of a field that are so much: a third of a map of 1/10 degree.
const CHUNKS_AT_ONCE: usize = (PIECE_BYTES / CHUNK_BYTES) as usize;
/// What it costs to open one more file, in bytes read.
pub(super) const OPEN_BYTES: u64 = 64 << 10;
/// Bytes of a record of sums, before compression.
pub(super) const RECORD_BYTES: u64 = 6 << 10;
/// Bytes of a chunk of a field, before compression.
pub(super) const CHUNK_BYTES: u64 = CHUNK_ROWS as u64 * CHUNK_COLS as u64 * VALUE_BYTES;
const VALUE_BYTES: u64 = size_of::<f32>() as u64;

/// Bytes of what the cells of a block have of a geometry: in a short run of steps more than their values.
pub(super) const SHARES_BYTES: u64 =
    BLOCK_CELLS as u64 * BLOCK_CELLS as u64 * size_of::<CellArea>() as u64;

/// Bytes of a block in a run of so many steps, before compression.
pub(super) fn block_bytes(steps: u64) -> u64 {
    u64::from(BLOCK_CELLS * BLOCK_CELLS) * VALUE_BYTES * steps.max(1)
}

/// What is asked of every piece.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Question {
    /// The version whose values are reduced.
    pub(super) version: ManifestId,
    pub(super) shape: Shape,
    /// Address of the weights, or the question that they answer.
    pub(super) whole: Arc<str>,
    /// The same of what coverage counts.
    pub(super) covered: Arc<str>,
    pub(super) unit: WeightUnit,
    pub(super) scale: Scale,
    pub(super) wanted: Wanted,
}

impl Question {
    /// What, beside the name of a run's values, the sums of all its steps are remembered by; none of what is no sum. Weights may be the
    /// text of a long line, which is digested once and not for each run.
    pub(super) fn sums_name(&self) -> Option<Digest> {
        let Wanted::Sums {
            with_squares,
            with_extremes,
        } = self.wanted
        else {
            return None;
        };
        let weights = (self.shape, &self.whole, &self.covered, self.unit);
        let wanted = (with_squares, with_extremes);
        Some(Digest::of_json(&(weights, self.scale, wanted)))
    }

    /// The same of some pieces alone: without what it says of other steps.
    pub(super) fn about(&self, pieces: &[Piece]) -> Self {
        let mut own = self.clone();
        if let Wanted::Histograms { steps, .. } = &mut own.wanted {
            let mut asked: Vec<Range<usize>> = pieces.iter().map(Piece::of_version).collect();
            asked.sort_unstable_by_key(|range| (range.start, range.end));
            asked.dedup();
            steps.retain(|step, _| {
                let step = *step as usize;
                asked.iter().any(|range| range.contains(&step))
            });
        }
        own
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
    /// Where queries read it; nowhere in particular if it is read along time.
    pub(super) address: Arc<str>,
    pub(super) layout: Layout,
    /// Index of its first step in the version.
    pub(super) first_step: u32,
    /// Steps of it that are reduced, counted from its first.
    pub(super) steps: Range<u32>,
    /// Numbers of blocks or chunks, increasing.
    #[serde(with = "super::number_runs")]
    pub(super) rows: Arc<[u32]>,
    /// Blocks whose stored sums are read.
    pub(super) inside: Vec<InsideRun>,
}

impl Piece {
    /// What it takes to read and reduce it, in bytes before compression: pieces are dealt out by that.
    pub(super) fn cost_bytes(&self) -> u64 {
        let steps = u64::from(self.steps.end - self.steps.start);
        match self.layout {
            Layout::Blocks => self.rows.len() as u64 * block_bytes(steps),
            Layout::Sums => {
                let records = self.inside.iter().map(InsideRun::record_count);
                records.sum::<usize>() as u64 * RECORD_BYTES
            }
            Layout::Field(_) => self.rows.len() as u64 * CHUNK_BYTES + OPEN_BYTES,
        }
    }

    /// The same in pieces of which none holds more than [`PIECE_BYTES`] of a field at once, however large its grid is.
    pub(super) fn cut(self) -> Vec<Self> {
        if self.cut_count() == 1 {
            return vec![self];
        }
        let own = |chunks: &[u32]| Self {
            rows: chunks.into(),
            ..self.clone()
        };
        self.rows.chunks(CHUNKS_AT_ONCE).map(own).collect()
    }

    /// How many pieces those are.
    pub(super) fn cut_count(&self) -> usize {
        match self.layout {
            Layout::Field(_) => self.rows.len().div_ceil(CHUNKS_AT_ONCE).max(1),
            Layout::Blocks | Layout::Sums => 1,
        }
    }

    /// Its steps by their index in the version.
    pub(super) fn of_version(&self) -> Range<usize> {
        let [start, end] = [self.steps.start, self.steps.end].map(|step| self.first_step + step);
        start as usize..end as usize
    }
}

/// How values lie where they are read.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Layout {
    /// Time-major: a row a block, `[cell, step]`.
    Blocks,
    /// Stored sums of blocks.
    Sums,
    /// A row a chunk of one step.
    Field(Period),
}

#[cfg(test)]
mod tests {
    use super::*;

    fn piece(layout: Layout, rows: u32) -> Piece {
        Piece {
            key: ObjectKey::field(&"p".parse().unwrap(), &Digest::of(b"")),
            address: "".into(),
            layout,
            first_step: 3,
            steps: 0..1,
            rows: (0..rows).map(|row| 2 * row).collect(),
            inside: vec![],
        }
    }

    #[test]
    fn every_chunk_of_a_field_is_in_one_cut_and_no_cut_is_larger_than_a_piece() {
        let month = Layout::Field(Period::month(2001, 1).unwrap());
        let most = CHUNKS_AT_ONCE as u32;
        for (count, wanted) in [(0, 1), (1, 1), (most, 1), (most + 1, 2), (3 * most + 7, 4)] {
            let whole = piece(month, count);
            assert_eq!(whole.cut_count(), wanted);
            let cuts = whole.clone().cut();
            assert_eq!(cuts.len(), wanted);
            for cut in &cuts {
                assert!(cut.cost_bytes() <= PIECE_BYTES + OPEN_BYTES, "{count}");
                assert_eq!((&cut.key, cut.layout), (&whole.key, whole.layout));
                assert_eq!(cut.of_version(), whole.of_version());
            }
            let rows = cuts.iter().flat_map(|cut| cut.rows.iter().copied());
            assert!(rows.eq(whole.rows.iter().copied()), "{count}");
        }
        // What is read along time was cut when it was planned.
        assert_eq!(piece(Layout::Blocks, 3 * most).cut().len(), 1);
    }
}
