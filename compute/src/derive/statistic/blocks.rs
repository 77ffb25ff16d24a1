//! Blocks of cells over all time: as many read together as fit a bound, in pieces that a processor works on; of a region those that it
//! touches.

use std::ops::Range;

use contract::chunk::{Window, windows};
use contract::grid::Grid;
use contract::manifest::Manifest;
use cube::{BLOCK_CELLS, RUN_STEPS, Values};

use super::stored::Stored;
use super::wanted::Wanted;
use crate::Engine;

/// Share of the memory for work that the values of a group of blocks may take: while one is read the next one is, too, and of one the
/// pieces are laid along time that are worked on.
const GROUP_SHARE: usize = 24;
/// Share of the memory for work that the values of all blocks in a run of steps may take, if runs are to be held: one is read while
/// one is made, and one waits.
const RUN_SHARE: usize = 8;
/// Bytes of values that one processor works on at a time: more are slower to be mapped, cleared and gone through again.
const PIECE_BYTES: usize = 8 << 20;
const BLOCK_BYTES: usize = (BLOCK_CELLS * BLOCK_CELLS) as usize * size_of::<f32>();

/// Groups of blocks that are on their way at once: one is read while one is computed with.
pub(super) const GROUPS_AT_ONCE: usize = 2;

/// A version whose cells are read.
pub(super) struct Reading<'a> {
    pub(super) manifest: &'a Manifest,
    pub(super) values: Values,
    /// Steps that are needed: others may be left without data.
    pub(super) steps: Range<usize>,
}

/// The blocks of a grid in which some cell is wanted.
pub(super) struct Blocks {
    /// Their cells in the grid.
    windows: Vec<Window>,
    /// Rows and columns of them in the product that is stored, row by row from its north-west corner on.
    at: Vec<[u32; 2]>,
    memory_bytes: usize,
}

/// How blocks are read and worked on.
pub(super) struct Groups<'a> {
    windows: &'a [Window],
    /// Blocks that are read together: the more, the fewer requests.
    each: usize,
    pub(super) pieces: Pieces,
}

/// How those of a group are worked on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Pieces {
    /// Blocks of each piece, of the last one perhaps less.
    pub(super) each: usize,
    /// Pieces that are worked on at once; all that there are where memory is for one a processor.
    pub(super) at_once: usize,
}

impl Pieces {
    /// Those of blocks of so many bytes that fit into so much memory on so many processors.
    fn of(block_bytes: usize, memory_bytes: usize, processors: usize) -> Self {
        let each = PIECE_BYTES.min(memory_bytes / processors) / block_bytes;
        let each = each.max(1);
        let at_once = memory_bytes / (each * block_bytes);
        Self {
            each,
            at_once: if at_once < processors {
                at_once.max(1)
            } else {
                usize::MAX
            },
        }
    }
}

impl<'a> Groups<'a> {
    /// Their blocks, by their cells.
    pub(super) fn of_blocks(&self) -> impl Iterator<Item = &'a [Window]> {
        self.windows.chunks(self.each)
    }
}

impl Blocks {
    /// Those of a grid that are in some rows of what is stored, which begin with a block, in the order in which they are stored.
    pub(super) fn of(
        engine: &Engine,
        grid: &Grid,
        wanted: &Wanted,
        (stored, rows): (&Stored, &Range<u32>),
    ) -> Self {
        let rows = stored.source_rows(rows);
        let of_rows = Grid {
            rows: rows.end - rows.start,
            ..*grid
        };
        let mut windows = windows(&of_rows, BLOCK_CELLS, BLOCK_CELLS);
        for window in &mut windows {
            window.row += rows.start;
        }
        windows.retain(|window| wanted.is_any_of(grid, *window));
        windows.sort_by_key(|window| stored.block(window));
        Self {
            at: windows.iter().map(|window| stored.block(window)).collect(),
            windows,
            memory_bytes: engine.memory_bytes(),
        }
    }

    /// Groups of them, of so many steps of all versions that are read together.
    pub(super) fn groups(&self, steps: usize) -> Groups<'_> {
        let block_bytes = BLOCK_BYTES * steps.max(1);
        let room = self.memory_bytes / GROUP_SHARE;
        Groups {
            windows: &self.windows,
            each: (room / block_bytes).max(1),
            pieces: Pieces::of(block_bytes, room, rayon::current_num_threads()),
        }
    }

    /// Has a run of steps of all of them room?
    pub(super) fn are_held_in_runs(&self) -> bool {
        let run_bytes = self.windows.len().saturating_mul(BLOCK_BYTES * RUN_STEPS);
        run_bytes <= self.memory_bytes / RUN_SHARE
    }

    /// Rows and columns of all of them in the product that is stored.
    pub(super) fn at(&self) -> Vec<[u32; 2]> {
        self.at.clone()
    }

    /// Their cells.
    pub(super) fn windows(&self) -> &[Window] {
        &self.windows
    }

    /// How many cells they have together.
    pub(super) fn cell_count(&self) -> usize {
        self.windows.iter().map(|block| block.cell_count()).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_are_for_all_processors_and_in_bounds() {
        let piece = |block_bytes, memory_bytes, processors| {
            let Pieces { each, at_once } = Pieces::of(block_bytes, memory_bytes, processors);
            (each, at_once)
        };
        // Much memory: as large as a processor likes.
        assert_eq!(piece(1 << 20, 1 << 30, 4), (8, usize::MAX));
        // Less: as many pieces as there are processors have room.
        assert_eq!(piece(1 << 20, 8 << 20, 4), (2, usize::MAX));
        // Little: fewer are worked on at once.
        assert_eq!(piece(1 << 20, 3 << 20, 16), (1, 3));
        assert_eq!(piece(1 << 20, 1 << 10, 16), (1, 1));
    }
}
