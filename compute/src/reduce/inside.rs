//! Which blocks of a geometry stored sums stand for: those whose every cell counts as it does in them. The rest is read.

use contract::chunk::Window;
use cube::{BLOCK_CELLS, Basis};
use serde::{Deserialize, Serialize};

use super::cells::{CellWeight, Cells, blocks};

/// Blocks side by side in a shard that lie inside of a geometry.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct InsideRun {
    /// Number of the westernmost block.
    pub(super) first: u32,
    /// That of the easternmost one.
    pub(super) last: u32,
    /// Those of them of whose cells coverage counts other weights: where the sea ends.
    pub(super) coast: Vec<u32>,
}

impl InsideRun {
    /// Records of sums that are read of it at most.
    pub(super) fn record_count(&self) -> usize {
        2 + self.coast.len()
    }
}

/// A geometry's blocks, parted.
#[derive(Debug, Default)]
pub(super) struct Inside {
    /// Blocks that stored sums stand for.
    pub(super) runs: Vec<InsideRun>,
    /// Numbers of the others, increasing.
    pub(super) rim: Vec<u32>,
}

impl Inside {
    /// Parts the blocks of a geometry, whose numbers increase.
    pub(super) fn of(cells: &Cells<'_>, numbers: &[u32], basis: &Basis) -> Self {
        let windows = blocks(cells.shape);
        let across = cells.shape[1].div_ceil(BLOCK_CELLS);
        let mut own = Self::default();
        for &number in numbers {
            let window = windows[number as usize];
            let weights = cells.window(window);
            if !is_whole(&weights, window, basis) {
                own.rim.push(number);
                continue;
            }
            // Sums begin anew at the west of a shard.
            let is_begun = !(number % across).is_multiple_of(basis.shard_cols);
            match own.runs.last_mut() {
                Some(run) if is_begun && run.last + 1 == number => run.last = number,
                _ => own.runs.push(InsideRun {
                    first: number,
                    last: number,
                    coast: vec![],
                }),
            }
            let is_coast = weights.iter().any(|cell| cell.covered != cell.weight);
            if let Some(run) = own.runs.last_mut().filter(|_| is_coast) {
                run.coast.push(number);
            }
        }
        own
    }

    /// Records and blocks that are read for it.
    pub(super) fn read_counts(&self) -> [usize; 2] {
        let records = self.runs.iter().map(InsideRun::record_count);
        [records.sum(), self.rim.len()]
    }
}

/// Does every cell of a block count as in stored sums?
fn is_whole(cells: &[CellWeight], window: Window, basis: &Basis) -> bool {
    let rows = cells.chunks_exact(window.cols as usize);
    (window.row..).zip(rows).all(|(row, cells)| {
        let whole = basis.row_weights.get(row as usize);
        whole.is_some_and(|whole| cells.iter().all(|cell| cell.weight == *whole))
    })
}
