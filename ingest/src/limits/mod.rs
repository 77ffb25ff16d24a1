//! Limits on one file.

pub(crate) mod gates;
pub(crate) mod memory;
pub(crate) mod room;

use std::time::Duration;

use contract::chunk::BAND_CELLS;
use contract::grid::MAX_CELLS;

/// What one file may ask for. A file beyond a limit is refused with the limit named.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// Largest input file, bytes; it is sent to the store piece by piece.
    pub file_bytes: u64,
    /// Memory of the sandboxed reader, bytes of address space.
    pub memory_bytes: u64,
    /// Processor time of the sandboxed reader, seconds for one file.
    pub cpu_s: u64,
    /// Time for one file as the clock on the wall has it.
    pub wall: Duration,
    /// Most cells of one map of one variable: those of the largest grid.
    pub plane_cells: u64,
    /// Cells of a band of rows, which is what is read, checked and encoded of a map at a time, but for one row of chunks.
    pub band_cells: u64,
    /// Most values that the reader gives at once; bounds what is allocated for them.
    pub read_cells: u64,
    /// Most cells that any variable may declare over all its dimensions.
    pub variable_cells: u64,
    /// Most time steps in one file.
    pub steps: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            file_bytes: 8 << 30,
            memory_bytes: 3 << 30,
            cpu_s: 600,
            wall: Duration::from_mins(30),
            plane_cells: MAX_CELLS,
            band_cells: BAND_CELLS,
            read_cells: 1 << 26,
            variable_cells: 1 << 34,
            steps: 100_000,
        }
    }
}
