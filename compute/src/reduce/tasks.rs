//! What has to be read for a question: of every run of steps blocks of its series, or chunks of single fields where few of
//! its steps are asked for.

use std::ops::Range;

use contract::chunk::{CHUNK_COLS, CHUNK_ROWS};
use contract::key::ObjectKey;
use contract::kind::Vouched;
use contract::manifest::{Manifest, SeriesSegment};
use storage::Store;
use storage::series::BLOCK_CELLS;

use super::cells::Cells;
use super::task::{Layout, Piece};
use crate::ComputeError;

/// Values that a piece holds at once, bytes before compression.
const PIECE_BYTES: u64 = 8 << 20;
/// What it costs to open one more file, in bytes read.
const OPEN_BYTES: u64 = 64 << 10;
const VALUE_BYTES: u64 = size_of::<f32>() as u64;

/// What is read of a run of steps.
#[derive(Debug)]
pub(super) struct Run {
    /// The series that holds all of it, where it is read from there; its sums are those of all its steps.
    pub(super) series: Option<ObjectKey>,
    pub(super) steps: Range<u32>,
    pub(super) pieces: Vec<Piece>,
}

/// Runs that hold all values of the steps `steps` of a version where `cells` have weight.
///
/// # Errors
/// Its series do not hold its steps.
pub(super) fn runs(
    store: &Store,
    manifest: &Manifest,
    steps: Range<u32>,
    cells: &Cells<'_>,
) -> Result<Vec<Run>, ComputeError> {
    let blocks = cells.blocks();
    let chunks: Vec<u32> = cells.whole.chunks().map(|(chunk, _)| chunk).collect();
    let fieldd = |steps: Range<u32>| Run {
        series: None,
        pieces: fields(store, manifest, steps.clone(), &chunks).collect(),
        steps,
    };
    // A version that has no series yet has fields.
    if manifest.series.is_empty() {
        return Ok(vec![fieldd(steps)]);
    }
    let mut runs = vec![];
    let mut next = 0;
    for segment in &manifest.series {
        if segment.first_step != next {
            break;
        }
        next += segment.steps;
        let wanted = steps.start.max(segment.first_step)..steps.end.min(next);
        if wanted.is_empty() {
            continue;
        }
        runs.push(
            if are_fields_less(segment, wanted.len(), blocks.len(), chunks.len()) {
                fieldd(wanted)
            } else {
                Run {
                    series: Some(segment.series.clone()),
                    steps: segment.first_step..next,
                    pieces: series(store, segment, &blocks),
                }
            },
        );
    }
    if next as usize != manifest.steps.len() {
        let reason = format!(
            "{next} steps in its series, {} in all",
            manifest.steps.len()
        );
        return Err(ComputeError::inconsistent(
            manifest.id().to_string(),
            reason,
        ));
    }
    Ok(runs)
}

/// Would less be read of single fields than of a series?
fn are_fields_less(
    segment: &SeriesSegment,
    wanted: usize,
    block_count: usize,
    chunk_count: usize,
) -> bool {
    let block_bytes = u64::from(BLOCK_CELLS * BLOCK_CELLS) * VALUE_BYTES;
    let series = block_count as u64 * block_bytes * u64::from(segment.steps) + OPEN_BYTES;
    let chunk_bytes = u64::from(CHUNK_ROWS * CHUNK_COLS) * VALUE_BYTES;
    let fields = wanted as u64 * (chunk_count as u64 * chunk_bytes + OPEN_BYTES);
    fields < series
}

fn series(store: &Store, segment: &SeriesSegment, blocks: &[u32]) -> Vec<Piece> {
    let block_bytes =
        u64::from(BLOCK_CELLS * BLOCK_CELLS) * VALUE_BYTES * u64::from(segment.steps.max(1));
    let at_once = match segment.series.vouches() {
        Vouched::Values(_) => (PIECE_BYTES / block_bytes).max(1) as usize,
        // Files of the layout before are read whole, each once.
        Vouched::Bytes(_) | Vouched::Nothing => blocks.len().max(1),
    };
    let piece = |rows: &[u32]| Piece {
        key: segment.series.clone(),
        address: store.sql_url(&segment.series).to_string(),
        layout: Layout::Series {
            steps: segment.steps,
        },
        first_step: segment.first_step,
        steps: 0..segment.steps,
        rows: rows.to_vec(),
    };
    blocks.chunks(at_once).map(piece).collect()
}

fn fields(
    store: &Store,
    manifest: &Manifest,
    steps: Range<u32>,
    chunks: &[u32],
) -> impl Iterator<Item = Piece> {
    steps.map(move |at| {
        let step = &manifest.steps[at as usize];
        Piece {
            key: step.field.clone(),
            address: store.sql_url(&step.field).to_string(),
            layout: Layout::Field(step.period),
            first_step: at,
            steps: 0..1,
            rows: chunks.to_vec(),
        }
    })
}
