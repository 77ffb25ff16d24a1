//! What has to be read for a question: of every run of steps blocks of the version along time, or chunks of single fields
//! where few of its steps are asked for, or where the version is not opened or not time-major yet.

use std::ops::Range;

use contract::chunk::{CHUNK_COLS, CHUNK_ROWS};
use contract::digest::Digest;
use contract::manifest::{Manifest, ManifestId};
use cube::{BLOCK_CELLS, Values};
use storage::Store;

use super::cells::Cells;
use super::task::{Layout, Piece};

/// Values that a piece holds at once, bytes before compression.
const PIECE_BYTES: u64 = 8 << 20;
/// What it costs to open one more file, in bytes read.
const OPEN_BYTES: u64 = 64 << 10;
const VALUE_BYTES: u64 = size_of::<f32>() as u64;

/// What is read of a run of steps.
#[derive(Debug)]
pub(super) struct Run {
    /// What names the values of all its steps, where all are read.
    pub(super) name: Option<Digest>,
    pub(super) steps: Range<u32>,
    pub(super) pieces: Vec<Piece>,
}

/// A version that is read.
#[derive(Clone, Copy)]
pub(super) struct Version<'a> {
    pub(super) store: &'a Store,
    pub(super) manifest: &'a Manifest,
    pub(super) id: &'a ManifestId,
    /// Its values along time, where they were opened.
    pub(super) values: Option<&'a Values>,
}

impl Version<'_> {
    /// Runs that hold all values of the steps `steps` where `cells` have weight.
    pub(super) fn runs(&self, steps: Range<u32>, cells: &Cells<'_>) -> Vec<Run> {
        let blocks = cells.blocks();
        let chunks: Vec<u32> = cells.whole.chunks().map(|(chunk, _)| chunk).collect();
        let fields = |steps: Range<u32>| Run {
            name: None,
            pieces: self.fields(steps.clone(), &chunks).collect(),
            steps,
        };
        let time_major = self.values.map(Values::time_major).unwrap_or_default();
        let mut runs = vec![];
        let mut next = steps.start;
        for run in time_major {
            let run = run.start as u32..run.end as u32;
            let wanted = steps.start.max(run.start)..steps.end.min(run.end);
            let is_less = are_fields_less(&run, wanted.len(), blocks.len(), chunks.len());
            if wanted.is_empty() || is_less {
                continue;
            }
            if next < wanted.start {
                runs.push(fields(next..wanted.start));
            }
            next = wanted.end;
            runs.push(Run {
                name: Some(Digest::of_json(&(self.id, &run))),
                pieces: self.blocks(&run, &blocks),
                steps: run,
            });
        }
        if next < steps.end {
            runs.push(fields(next..steps.end));
        }
        runs
    }

    fn blocks(&self, run: &Range<u32>, blocks: &[u32]) -> Vec<Piece> {
        let at_once = (PIECE_BYTES / block_bytes(run)).max(1) as usize;
        let piece = |rows: &[u32]| Piece {
            key: self.manifest.steps[run.start as usize].field.clone(),
            address: String::new(),
            layout: Layout::Blocks,
            first_step: run.start,
            steps: 0..run.end - run.start,
            rows: rows.to_vec(),
        };
        blocks.chunks(at_once).map(piece).collect()
    }

    fn fields(&self, steps: Range<u32>, chunks: &[u32]) -> impl Iterator<Item = Piece> {
        steps.map(move |at| {
            let step = &self.manifest.steps[at as usize];
            Piece {
                key: step.field.clone(),
                address: self.store.sql_url(&step.field).to_string(),
                layout: Layout::Field(step.period),
                first_step: at,
                steps: 0..1,
                rows: chunks.to_vec(),
            }
        })
    }
}

/// Bytes of a block in a run of steps.
fn block_bytes(run: &Range<u32>) -> u64 {
    u64::from(BLOCK_CELLS * BLOCK_CELLS) * VALUE_BYTES * run.len().max(1) as u64
}

/// Would less be read of single fields than of a run of steps?
pub(crate) fn are_fields_less(
    run: &Range<u32>,
    wanted: usize,
    block_count: usize,
    chunk_count: usize,
) -> bool {
    let blocks = block_count as u64 * block_bytes(run) + OPEN_BYTES;
    let chunk_bytes = u64::from(CHUNK_ROWS * CHUNK_COLS) * VALUE_BYTES;
    let fields = wanted as u64 * (chunk_count as u64 * chunk_bytes + OPEN_BYTES);
    fields < blocks
}
