//! Which rows of fields a device holds while a picture is drawn: all, or of large grids those that it shows.
//!
//! A field comes whole from where it is stored, since its name vouches for all of its values and gaps are filled from far
//! away. Bands of whole rows are what a device can hold of it at the price of one subtraction a cell read.

use std::ops::Range;

use contract::grid::Grid;
use contract::job::Mode;

use super::Plan;
use crate::error::RenderError;

/// Fields of more bytes are not held whole but in bands of the rows that a picture shows: four fields and a domain of
/// this size leave room for the rest on a device of 2 GiB.
pub(super) const MOST_HELD_BYTES: u64 = 256 << 20;
/// Bands begin and end at multiples of so many rows, so that neighbouring pictures share them.
const BAND_ROWS: u32 = 256;

impl Plan {
    /// Are fields on this grid held whole, whatever is drawn of them?
    pub(crate) fn holds_whole(grid: &Grid) -> bool {
        (grid.cell_count() * size_of::<f32>()) as u64 <= MOST_HELD_BYTES
    }

    /// Cells of a field that are on the device while this is drawn, whole rows of them.
    pub fn held_cells(&self) -> Range<usize> {
        self.params.grid.held_first_cell as usize..self.params.grid.held_end_cell as usize
    }

    /// Chooses the rows that are held; refused if no buffer holds them.
    pub(super) fn choose_band(
        &mut self,
        most_buffer_bytes: u64,
        most_held_bytes: u64,
    ) -> Result<(), RenderError> {
        const CELL_BYTES: u64 = size_of::<f32>() as u64;
        let params = &mut self.params;
        let (rows, cols) = (params.grid.rows, params.grid.cols);
        let shown = if self.mode == Mode::Map {
            params.interpolation.first_cell / cols..params.interpolation.end_cell.div_ceil(cols)
        } else {
            params.cells.first_row..params.cells.first_row + params.cells.row_count
        };
        let row_bytes = u64::from(cols) * CELL_BYTES;
        // What drifts comes from other rows than it is seen in.
        let is_whole = self.mode == Mode::Flow;
        let band = if is_whole || u64::from(rows) * row_bytes <= most_held_bytes {
            0..rows
        } else {
            let first = shown.start / BAND_ROWS * BAND_ROWS;
            first..shown.end.next_multiple_of(BAND_ROWS).min(rows)
        };
        let bytes = u64::from(band.end - band.start) * row_bytes;
        if bytes > most_buffer_bytes {
            return Err(RenderError::TooLarge {
                what: "rows of a field that the picture shows",
                bytes,
                limit: most_buffer_bytes,
            });
        }
        params.grid.held_first_cell = band.start * cols;
        params.grid.held_end_cell = band.end * cols;
        Ok(())
    }
}
