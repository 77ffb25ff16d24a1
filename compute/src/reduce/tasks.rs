//! What has to be read for a question: of every run of steps blocks of the version along time, or chunks of single fields
//! where few of its steps are asked for, or where the version is not opened or not time-major yet.

use std::ops::Range;
use std::sync::Arc;

use contract::digest::Digest;
use contract::manifest::{Manifest, ManifestId};
use cube::scale::Scale;
use cube::{Basis, Values};
use storage::Store;

use super::cells::Cells;
use super::inside::{Inside, InsideRun};
use super::question::{
    CHUNK_BYTES, Layout, OPEN_BYTES, PIECE_BYTES, Piece, RECORD_BYTES, SHARES_BYTES, block_bytes,
};

/// Runs of blocks whose sums a piece holds at once: some of each piece of the region.
const SUMS_AT_ONCE: usize = 512;

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
    /// Runs that hold all values of the steps `steps` where `cells` have weight. Where `stored` says how values count and sums are
    /// stored that count them so, these stand for blocks inside.
    pub(super) fn runs(
        &self,
        steps: Range<u32>,
        cells: &Cells<'_>,
        stored: Option<Scale>,
    ) -> Vec<Run> {
        let chunks = chunks(cells);
        let fields = |steps: Range<u32>| Run {
            name: None,
            pieces: self.fields(steps.clone(), &chunks).collect(),
            steps,
        };
        let time_major = self.values.map(Values::time_major).unwrap_or_default();
        let mut runs = vec![];
        let mut next = steps.start;
        // Of a large grid its blocks are millions: who reads fields alone needs none of them.
        let mut parts = None;
        for run in time_major {
            let run = run.start as u32..run.end as u32;
            let wanted = steps.start.max(run.start)..steps.end.min(run.end);
            if wanted.is_empty() {
                continue;
            }
            let parts = parts.get_or_insert_with(|| Parts::new(cells, stored));
            let inside = parts.of(self
                .values
                .and_then(|values| values.summed_as(&(run.start as usize..run.end as usize))));
            if are_fields_less(&run, wanted.len(), inside.read_counts(), chunks.len()) {
                continue;
            }
            if next < wanted.start {
                runs.push(fields(next..wanted.start));
            }
            next = wanted.end;
            runs.push(Run {
                name: Some(Digest::of_json(&(self.id, &run))),
                pieces: self.pieces(&run, inside),
                steps: run,
            });
        }
        if next < steps.end {
            runs.push(fields(next..steps.end));
        }
        runs
    }

    /// Pieces of a run of steps: blocks of values, and stored sums.
    fn pieces(&self, run: &Range<u32>, inside: &Inside) -> Vec<Piece> {
        let piece = |layout: Layout, rows: &[u32], inside: &[InsideRun]| Piece {
            key: self.manifest.steps[run.start as usize].field.clone(),
            address: "".into(),
            layout,
            first_step: run.start,
            steps: 0..run.end - run.start,
            rows: rows.into(),
            inside: inside.to_vec(),
        };
        let each = block_bytes(run.len() as u64).max(SHARES_BYTES);
        let at_once = (PIECE_BYTES / each).max(1) as usize;
        let blocks = inside.rim.chunks(at_once);
        let blocks = blocks.map(|rows| piece(Layout::Blocks, rows, &[]));
        let sums = inside.runs.chunks(SUMS_AT_ONCE);
        let sums = sums.map(|inside| piece(Layout::Sums, &[], inside));
        blocks.chain(sums).collect()
    }

    /// Pieces of single fields that hold all values of some steps where `cells` have weight, and of no others.
    pub(super) fn fields_alone(
        &self,
        steps: impl Iterator<Item = u32>,
        cells: &Cells<'_>,
    ) -> Vec<Piece> {
        self.fields(steps, &chunks(cells)).collect()
    }

    fn fields(
        &self,
        steps: impl Iterator<Item = u32>,
        chunks: &Arc<[u32]>,
    ) -> impl Iterator<Item = Piece> {
        steps.map(move |at| {
            let step = &self.manifest.steps[at as usize];
            Piece {
                key: step.field.clone(),
                address: self.store.sql_url(&step.field).to_string().into(),
                layout: Layout::Field(step.period),
                first_step: at,
                steps: 0..1,
                rows: Arc::clone(chunks),
                inside: vec![],
            }
        })
    }
}

/// The chunks of a geometry: every step has the same ones.
fn chunks(cells: &Cells<'_>) -> Arc<[u32]> {
    cells.whole.chunks().map(|(chunk, _)| chunk).collect()
}

/// A geometry's blocks, parted by the sums that are stored: mostly the same for all runs of steps.
struct Parts<'a> {
    cells: &'a Cells<'a>,
    blocks: Vec<u32>,
    /// How values count; none where sums are not asked for.
    stored: Option<Scale>,
    basis: Option<Arc<Basis>>,
    inside: Inside,
}

impl<'a> Parts<'a> {
    fn new(cells: &'a Cells<'a>, stored: Option<Scale>) -> Self {
        let blocks = cells.blocks();
        Self {
            inside: Inside {
                runs: vec![],
                rim: blocks.clone(),
            },
            cells,
            blocks,
            stored,
            basis: None,
        }
    }

    /// The parts where sums are stored that count values so.
    fn of(&mut self, basis: Option<Arc<Basis>>) -> &Inside {
        let basis = basis.filter(|own| Some(own.scale) == self.stored);
        if basis != self.basis {
            self.inside = match &basis {
                Some(basis) => Inside::of(self.cells, &self.blocks, basis),
                None => Inside {
                    runs: vec![],
                    rim: self.blocks.clone(),
                },
            };
            self.basis = basis;
        }
        &self.inside
    }
}

/// Would less be read of single fields than of a run of steps?
pub(crate) fn are_fields_less(
    run: &Range<u32>,
    wanted: usize,
    [record_count, block_count]: [usize; 2],
    chunk_count: usize,
) -> bool {
    let records = record_count as u64 * RECORD_BYTES;
    let blocks = block_count as u64 * block_bytes(run.len() as u64) + records + OPEN_BYTES;
    let fields = wanted as u64 * (chunk_count as u64 * CHUNK_BYTES + OPEN_BYTES);
    fields < blocks
}
