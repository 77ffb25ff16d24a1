//! Cells in, those of them out that hold data in no step of a version: by what is stored of 128 steps together, where steps one by one
//! would be as many fields.
//!
//! Sums of blocks, which a product's cube holds beside its time-major copy, say which cells hold data at every step of a run; of a
//! quantity that is not summed the values of the copy do.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::Arc;

use contract::key::ObjectKey;
use contract::manifest::Manifest;
use cube::{BLOCK_CELLS, CubeError, EncodedBlocks, EncodedSums, Numbers, Piece, RUN_STEPS, Values};
use storage::Store;
use storage::domain::Cells;

/// Blocks that are held at once as they are stored: sums of them are 7 kB, and values 32 kB, before compression.
const BLOCKS_AT_ONCE: usize = 2048;
/// Most blocks that sums are read of; more have so many cells that fields find most of them.
const MOST_BLOCKS: usize = 32 * BLOCKS_AT_ONCE;
/// Most blocks that values are read of: as much as windows of some maps.
const MOST_OF_VALUES: usize = BLOCKS_AT_ONCE;

/// Cells that are looked for, a bit each, by their blocks' rows and columns.
type Blocks = BTreeMap<[u32; 2], u64>;

/// Takes cells away that hold data in some of the fields `kept` of a version, as far as its cube says it; the fields that were looked
/// through. A cube that cannot be read says nothing: fields do.
pub(super) async fn look_for<'a>(
    store: &Store,
    version: &'a Manifest,
    kept: &BTreeSet<&ObjectKey>,
    lost: &mut Cells,
) -> BTreeSet<&'a ObjectKey> {
    let mut looked = BTreeSet::new();
    let Some(mut blocks) = blocks_of(lost, version.grid.cols) else {
        return looked;
    };
    let found = through(store, version, kept, (&mut blocks, &mut looked)).await;
    if let Err(error) = found {
        tracing::warn!(product = %version.product, %error, "which cells hold data is read of fields");
    }
    let mut rest = Cells::none(lost.map_count());
    for (at, bits) in blocks {
        for cell in cells_of(at, bits, version.grid.cols) {
            rest.insert(cell);
        }
    }
    *lost = rest;
    looked
}

async fn through<'a>(
    store: &Store,
    version: &'a Manifest,
    kept: &BTreeSet<&ObjectKey>,
    (blocks, looked): (&mut Blocks, &mut BTreeSet<&'a ObjectKey>),
) -> Result<(), CubeError> {
    let values = Values::of(store, &Arc::new(version.clone())).await?;
    for run in values.time_major().into_iter().rev() {
        let own = &version.steps[run.clone()];
        let is_kept: Vec<bool> = own.iter().map(|step| kept.contains(&step.field)).collect();
        if !is_kept.contains(&true) {
            continue;
        }
        match of_run(&values, &run, &is_kept, blocks).await {
            Ok(true) => {}
            Ok(false) => continue,
            Err(error) if error.is_retryable() => return Err(error),
            Err(error) => {
                tracing::warn!(product = %version.product, %error, "which cells hold data in a run of steps is read of fields");
                continue;
            }
        }
        blocks.retain(|_, bits| *bits != 0);
        looked.extend(own.iter().map(|step| &step.field));
        if blocks.is_empty() {
            break;
        }
    }
    Ok(())
}

/// Takes cells away that hold data in steps of a run that are kept; false where that is more work than to read fields.
async fn of_run(
    values: &Values,
    run: &Range<usize>,
    is_kept: &[bool],
    blocks: &mut Blocks,
) -> Result<bool, CubeError> {
    let all: Vec<[u32; 2]> = blocks.keys().copied().collect();
    if values.summed_as(run).is_none() && all.len() > MOST_OF_VALUES {
        return Ok(false);
    }
    for some in all.chunks(BLOCKS_AT_ONCE) {
        let Some(stored) = Stored::find(values, some, run).await? else {
            return Ok(false);
        };
        for (at, valid) in stored.valid(is_kept.to_vec()).await? {
            if let Some(bits) = blocks.get_mut(&some[at]) {
                *bits &= !valid;
            }
        }
    }
    Ok(true)
}

/// What says which cells of some blocks hold data at the steps of a run.
enum Stored {
    Sums(EncodedSums),
    Values(EncodedBlocks),
}

impl Stored {
    async fn find(
        values: &Values,
        blocks: &[[u32; 2]],
        run: &Range<usize>,
    ) -> Result<Option<Self>, CubeError> {
        if values.summed_as(run).is_some() {
            return Ok(values.sums(blocks, run.clone()).await?.map(Self::Sums));
        }
        let blocks = values.encoded(blocks, run.clone()).await?;
        Ok(blocks.map(Self::Values))
    }

    /// Of each block, by its place among those asked for, the cells that hold data in some step that is kept; none of a block without
    /// any.
    async fn valid(self, is_kept: Vec<bool>) -> Result<Vec<(usize, u64)>, CubeError> {
        let read = tokio::task::spawn_blocking(move || {
            let mut found = vec![];
            let read = match &self {
                Self::Sums(sums) => {
                    let steps = kept_in_run(sums.pieces(), &is_kept);
                    sums.each(
                        |_| Numbers::Valid,
                        |at, record| {
                            let of_step = |all, step: &usize| all | record.valid[*step];
                            found.push((at, steps.iter().fold(0, of_step)));
                            true
                        },
                    )
                }
                Self::Values(blocks) => {
                    let steps = kept_in_run(blocks.pieces(), &is_kept);
                    let every_row = |_block| u8::MAX;
                    blocks.each(every_row, |at, values| {
                        let cells = values.chunks_exact(RUN_STEPS).enumerate();
                        let bits = cells.map(|(cell, values)| {
                            let has_data = steps.iter().any(|step| !values[*step].is_nan());
                            u64::from(has_data) << cell
                        });
                        found.push((at, bits.fold(0, |all, bit| all | bit)));
                        true
                    })
                }
            };
            (self, found, read)
        });
        let stopped = |e: tokio::task::JoinError| CubeError::Library {
            place: "a thread".to_owned(),
            doing: "looking for cells with data",
            reason: e.to_string(),
        };
        match read.await.map_err(stopped)? {
            (_, found, Ok(())) => Ok(found),
            (Self::Sums(sums), _, Err(undecoded)) => Err(sums.error(undecoded).await),
            (Self::Values(blocks), _, Err(undecoded)) => Err(blocks.error(undecoded).await),
        }
    }
}

/// Places in a run of the steps that are kept of those asked for.
fn kept_in_run(pieces: &[Piece], is_kept: &[bool]) -> Vec<usize> {
    let steps = pieces
        .iter()
        .flat_map(|piece| (0..piece.count).map(|step| (piece.asked + step, piece.in_run + step)));
    let kept = steps.filter(|(asked, _)| is_kept[*asked]);
    kept.map(|(_, in_run)| in_run).collect()
}

/// Cells by their blocks; none where those are very many.
fn blocks_of(cells: &Cells, cols: u32) -> Option<Blocks> {
    let mut blocks = Blocks::new();
    for cell in cells.iter() {
        let (row, col) = ((cell / cols as usize) as u32, (cell % cols as usize) as u32);
        let bit = row % BLOCK_CELLS * BLOCK_CELLS + col % BLOCK_CELLS;
        let at = [row / BLOCK_CELLS, col / BLOCK_CELLS];
        *blocks.entry(at).or_default() |= 1 << bit;
        if blocks.len() > MOST_BLOCKS {
            return None;
        }
    }
    Some(blocks)
}

/// Places of a block's cells in the map, row-major.
fn cells_of([row, col]: [u32; 2], bits: u64, cols: u32) -> impl Iterator<Item = usize> {
    let is_set = move |bit: &u32| bits >> bit & 1 == 1;
    (0..BLOCK_CELLS * BLOCK_CELLS)
        .filter(is_set)
        .map(move |bit| {
            let row = row * BLOCK_CELLS + bit / BLOCK_CELLS;
            let col = col * BLOCK_CELLS + bit % BLOCK_CELLS;
            row as usize * cols as usize + col as usize
        })
}

#[cfg(test)]
mod tests;
