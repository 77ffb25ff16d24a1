//! Where steps are made and stored, and how much of a map is held for it.

use std::path::Path;

use contract::chunk::BAND_CELLS;
use storage::{Store, spool};

/// 256 MiB of f32, whatever the grid.
const RUN_VALUES: u64 = 64 << 20;

/// A store, and how work on it is done.
#[derive(Clone, Copy)]
pub(crate) struct Workshop<'a> {
    pub(crate) store: &'a Store,
    /// Where a field lies on its way to the store if it is too large to be held.
    pub(crate) spool: &'a Path,
    /// Most cells of a map that are worked on at a time; what is made is the same whatever it is.
    pub(crate) band_cells: u64,
    /// Most values of several steps that are worked on at a time; neither does this show.
    pub(crate) run_values: u64,
}

impl<'a> Workshop<'a> {
    /// One that holds as much as is usual.
    pub(crate) fn of(store: &'a Store) -> Self {
        Self {
            store,
            spool: spool::FOLDER.as_path(),
            band_cells: BAND_CELLS,
            run_values: RUN_VALUES,
        }
    }
}
