//! Blocks of cells over all time, out of a product's time-major series, as many at once as fit a bound.

use std::ops::Range;

use contract::chunk::{Window, windows};
use contract::digest::Digest;
use contract::manifest::{Manifest, SeriesSegment};
use datafusion::arrow::array::{AsArray as _, RecordBatch};
use datafusion::arrow::datatypes::{Float32Type, UInt32Type};
use futures::TryStreamExt as _;
use storage::series::BLOCK_CELLS;

use crate::scan::{self, Layout};
use crate::session::QueryContext;
use crate::{ComputeError, Engine};

/// Values that are held at once: 128 MiB of f32.
const HELD_VALUES: usize = 32 << 20;
/// Some blocks of a segment.
const BLOCKS: &str = "SELECT block, \"values\" FROM series \
    WHERE block >= CAST($from AS INT UNSIGNED) AND block < CAST($to AS INT UNSIGNED)";

/// Cells over all steps.
pub(super) struct Cells {
    /// Place of each in the grid, row-major.
    pub(super) places: Vec<usize>,
    /// `[cell, step]`, stored unit, NaN no data.
    pub(super) values: Vec<f32>,
}

/// The blocks of a product's grid, and how many are read at once.
pub(super) struct Blocks {
    windows: Vec<Window>,
    at_once: usize,
}

impl Blocks {
    pub(super) fn of(manifest: &Manifest) -> Self {
        let a_block = (BLOCK_CELLS * BLOCK_CELLS) as usize * manifest.steps.len().max(1);
        Self {
            windows: windows(&manifest.grid, BLOCK_CELLS, BLOCK_CELLS),
            at_once: (HELD_VALUES / a_block).max(1),
        }
    }

    /// Runs of blocks that are read together, in their order.
    pub(super) fn runs(&self) -> impl Iterator<Item = Range<usize>> + use<> {
        let (all, at_once) = (self.windows.len(), self.at_once);
        (0..all.div_ceil(at_once)).map(move |run| run * at_once..((run + 1) * at_once).min(all))
    }

    /// The cells of a run of blocks at all steps.
    pub(super) async fn read(
        &self,
        engine: &Engine,
        manifest: &Manifest,
        run: Range<usize>,
    ) -> Result<Cells, ComputeError> {
        let blocks = &self.windows[run.clone()];
        let places = blocks
            .iter()
            .flat_map(|block| block.cell_indices(&manifest.grid));
        let places: Vec<usize> = places.collect();
        let step_count = manifest.steps.len();
        let mut cells = Cells {
            values: vec![f32::NAN; places.len() * step_count],
            places,
        };
        let mut offsets = vec![0; blocks.len() + 1];
        for (index, block) in blocks.iter().enumerate() {
            offsets[index + 1] = offsets[index] + block.cell_count();
        }
        let mut covered = 0;
        for segment in &manifest.series {
            let batches = segment_blocks(engine, segment, &run).await?;
            let fits = place(
                &batches,
                segment,
                &run,
                &offsets,
                step_count,
                &mut cells.values,
            );
            let inconsistent = || {
                ComputeError::inconsistent(
                    segment.series.to_string(),
                    "its blocks are not those of its product's grid",
                )
            };
            fits.ok_or_else(inconsistent)?;
            covered += segment.steps as usize;
        }
        if covered == step_count {
            return Ok(cells);
        }
        let reason = format!("{covered} values in its series for {step_count} steps");
        Err(ComputeError::inconsistent(
            manifest.id().to_string(),
            reason,
        ))
    }
}

/// Rows of a segment.
async fn segment_blocks(
    engine: &Engine,
    segment: &SeriesSegment,
    run: &Range<usize>,
) -> Result<Vec<RecordBatch>, ComputeError> {
    let sql = BLOCKS
        .replace("$from", &run.start.to_string())
        .replace("$to", &run.end.to_string());
    let job = Digest::of_json(&("blocks", &segment.series, &sql));
    let answered = engine.answer(job, |context| ask(engine, context, segment, &sql));
    let answered = scan::caught(Box::pin(answered)).await;
    scan::or_damaged(engine.store(), &[&segment.series], answered).await
}

async fn ask(
    engine: &Engine,
    context: QueryContext,
    segment: &SeriesSegment,
    sql: &str,
) -> Result<Vec<RecordBatch>, ComputeError> {
    let (store, series) = (engine.store(), &segment.series);
    scan::register(&context, "series", store, &[series], Layout::Series).await?;
    let failed = || ComputeError::engine("reading a series");
    let query = context.sql(sql).await.map_err(failed())?;
    let stream = query.execute_stream().await.map_err(failed())?;
    stream.try_collect().await.map_err(failed())
}

/// Puts the values of a segment in their places; none if a block is missing, twice there or of another size.
fn place(
    batches: &[RecordBatch],
    segment: &SeriesSegment,
    run: &Range<usize>,
    offsets: &[usize],
    step_count: usize,
    values: &mut [f32],
) -> Option<()> {
    let steps = segment.steps as usize;
    let first = segment.first_step as usize;
    let mut is_there = vec![false; run.len()];
    for batch in batches {
        let numbers = batch.column(0).as_primitive_opt::<UInt32Type>()?;
        let lists = batch.column(1).as_list_opt::<i32>()?;
        for row in 0..batch.num_rows() {
            let index = (numbers.value(row) as usize).checked_sub(run.start)?;
            let seen = is_there.get_mut(index).filter(|seen| !**seen)?;
            *seen = true;
            let list = lists.value(row);
            let list = list.as_primitive_opt::<Float32Type>()?.values();
            let cells = offsets[index]..offsets[index + 1];
            if list.len() != cells.len() * steps || first + steps > step_count {
                return None;
            }
            for (cell, own) in cells.zip(list.chunks_exact(steps.max(1))) {
                values[cell * step_count + first..][..steps].copy_from_slice(own);
            }
        }
    }
    is_there.into_iter().all(|seen| seen).then_some(())
}
