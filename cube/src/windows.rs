//! Windows and cells of a version in, their values out, read where fewest values are decoded for them: blocks of the
//! time-major copy for few cells at many steps, map-major chunks for many cells, whole fields where the cube lacks a step.

use std::collections::BTreeSet;
use std::ops::Range;

use contract::chunk::Window;
use futures::stream::{self, Stream, StreamExt as _, TryStreamExt as _};

use crate::layout::{BLOCK_CELLS, Layout, RUN_STEPS};
use crate::values::Block;
use crate::{CubeError, Values};

/// Blocks that are held at a time, 32 KiB each.
const MOST_BLOCKS: usize = 512;
/// Pieces that are read at a time: one comes while another is used.
const PIECES_AT_ONCE: usize = 2;

/// A cell at a step of a version.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CellAt {
    /// Its step.
    pub step: usize,
    /// Its row.
    pub row: u32,
    /// Its column.
    pub col: u32,
}

impl CellAt {
    fn window(self) -> Window {
        Window {
            row: self.row,
            col: self.col,
            rows: 1,
            cols: 1,
        }
    }
}

/// Steps that are read together, and how.
struct Piece {
    steps: Range<usize>,
    is_by_blocks: bool,
}

impl Values {
    /// Values of some windows at steps one after the other: of each step `[row, col]` of every window, stored unit, NaN no data.
    ///
    /// # Errors
    /// As [`Values::blocks`].
    pub fn each<'a>(
        &'a self,
        steps: Range<usize>,
        windows: &'a [Window],
    ) -> impl Stream<Item = Result<Vec<Vec<f32>>, CubeError>> + Send + 'a {
        let blocks: BTreeSet<[u32; 2]> = windows.iter().flat_map(|it| blocks_of(*it)).collect();
        let mut pieces = vec![];
        for run in self.runs() {
            let own = run.start.max(steps.start)..run.end.min(steps.end);
            if own.is_empty() {
                continue;
            }
            if self.is_by_blocks(&own, blocks.len(), windows) {
                pieces.push(Piece {
                    steps: own,
                    is_by_blocks: true,
                });
            } else {
                pieces.extend(own.map(|step| Piece {
                    steps: step..step + 1,
                    is_by_blocks: false,
                }));
            }
        }
        let length = self.manifest().steps.len();
        if steps.end > length {
            // Which is told.
            pieces.push(Piece {
                steps: length..length + 1,
                is_by_blocks: false,
            });
        }
        let blocks: Vec<[u32; 2]> = blocks.into_iter().collect();
        let read = move |piece: Piece| {
            let blocks = blocks.clone();
            async move {
                if !piece.is_by_blocks {
                    return Ok(vec![self.windows(piece.steps.start, windows).await?]);
                }
                let found = self.blocks(&blocks, piece.steps.clone()).await?;
                Ok::<_, CubeError>(laid(&found, windows, piece.steps.len()))
            }
        };
        stream::iter(pieces)
            .map(read)
            .buffered(PIECES_AT_ONCE)
            .map_ok(|steps| stream::iter(steps).map(Ok))
            .try_flatten()
    }

    /// Values of some cells, each at a step of its own, in the order asked; stored unit, NaN no data.
    ///
    /// # Errors
    /// As [`Values::blocks`].
    pub async fn cells(&self, wanted: &[CellAt]) -> Result<Vec<f32>, CubeError> {
        let mut values = vec![f32::NAN; wanted.len()];
        let mut order: Vec<usize> = (0..wanted.len()).collect();
        order.sort_by_key(|at| wanted[*at].step);
        let mut rest = &order[..];
        for run in self.runs() {
            let count = rest.partition_point(|at| wanted[*at].step < run.end);
            let (own, later) = rest.split_at(count);
            rest = later;
            let (Some(first), Some(last)) = (own.first(), own.last()) else {
                continue;
            };
            let steps = wanted[*first].step..wanted[*last].step + 1;
            self.cells_in(steps, own, wanted, &mut values).await?;
        }
        match rest.first() {
            None => Ok(values),
            // Behind the last step.
            Some(at) => self
                .windows(wanted[*at].step, &[])
                .await
                .map(|_none| values),
        }
    }

    /// The same of those within one run; `own` are their places in the order of steps.
    async fn cells_in(
        &self,
        steps: Range<usize>,
        own: &[usize],
        wanted: &[CellAt],
        values: &mut [f32],
    ) -> Result<(), CubeError> {
        let windows: Vec<Window> = own.iter().map(|at| wanted[*at].window()).collect();
        let blocks: BTreeSet<[u32; 2]> = windows.iter().flat_map(|it| blocks_of(*it)).collect();
        if self.is_by_blocks(&steps, blocks.len(), &windows) {
            let blocks: Vec<[u32; 2]> = blocks.into_iter().collect();
            let found = self.blocks(&blocks, steps.clone()).await?;
            for at in own {
                let CellAt { step, row, col } = wanted[*at];
                let block = blocks.binary_search(&[row / BLOCK_CELLS, col / BLOCK_CELLS]);
                let Some(block) = block.ok().and_then(|block| found.get(block)) else {
                    continue;
                };
                let (down, right) = (row - block.window.row, col - block.window.col);
                let cell = (down * block.window.cols + right) as usize;
                values[*at] = block.values[cell * steps.len() + step - steps.start];
            }
            return Ok(());
        }
        for own in own.chunk_by(|a, b| wanted[*a].step == wanted[*b].step) {
            let windows: Vec<Window> = own.iter().map(|at| wanted[*at].window()).collect();
            let found = self.windows(wanted[own[0]].step, &windows).await?;
            for (at, value) in own.iter().zip(found) {
                values[*at] = value.first().copied().unwrap_or(f32::NAN);
            }
        }
        Ok(())
    }

    /// Does the time-major copy hold these steps of one run, and are so many blocks of it fewer values to decode than the
    /// map-major chunks that windows touch?
    fn is_by_blocks(&self, steps: &Range<usize>, blocks: usize, windows: &[Window]) -> bool {
        let layout = Layout::of(&self.manifest().grid);
        let touched = windows.iter().flat_map(|it| layout.chunks_of(*it));
        let touched = touched.collect::<BTreeSet<_>>().len();
        let [rows, cols] = layout.chunk.map(|side| side as usize);
        let of_blocks = blocks * (BLOCK_CELLS * BLOCK_CELLS) as usize * RUN_STEPS;
        let of_maps = touched * rows * cols * steps.len();
        blocks <= MOST_BLOCKS && of_blocks < of_maps && self.run_of(steps).is_some()
    }
}

/// Blocks that a window touches, by row and column of blocks.
fn blocks_of(window: Window) -> impl Iterator<Item = [u32; 2]> {
    let along = |from: u32, count: u32| {
        from / BLOCK_CELLS..from.saturating_add(count).div_ceil(BLOCK_CELLS)
    };
    let columns = along(window.col, window.cols);
    along(window.row, window.rows).flat_map(move |row| columns.clone().map(move |col| [row, col]))
}

/// Values of windows, by step and window, from the blocks that they touch.
fn laid(blocks: &[Block], windows: &[Window], steps: usize) -> Vec<Vec<Vec<f32>>> {
    let blank = |window: &Window| vec![f32::NAN; window.cell_count()];
    let blank: Vec<Vec<f32>> = windows.iter().map(blank).collect();
    let mut laid = vec![blank; steps];
    for Block {
        window: own,
        values,
        ..
    } in blocks
    {
        for (number, window) in windows.iter().enumerate() {
            let rows = own.row.max(window.row)..(own.row + own.rows).min(window.row + window.rows);
            let cols = own.col.max(window.col)..(own.col + own.cols).min(window.col + window.cols);
            for row in rows {
                for col in cols.clone() {
                    let from = ((row - own.row) * own.cols + col - own.col) as usize;
                    let to = (row - window.row) as usize * window.cols as usize;
                    let to = to + (col - window.col) as usize;
                    let along = &values[from * steps..(from + 1) * steps];
                    for (step, value) in laid.iter_mut().zip(along) {
                        step[number][to] = *value;
                    }
                }
            }
        }
    }
    laid
}
