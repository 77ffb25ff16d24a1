//! Rows of a step of a store of others in, the field of them out: held, or of many cells in a file without a name.

use contract::chunk::{BAND_CELLS, CHUNK_ROWS};
use contract::digest::Digest;
use contract::grid::Grid;

use super::reference::Reference;
use crate::StorageError;
use crate::content::Content;
use crate::fields::Writer;
use crate::parquet_table::shape_only;
use crate::spool::{FOLDER, Spool};

/// Has a step more cells than are read at a time?
pub(super) fn is_large(reference: &Reference) -> bool {
    u64::from(reference.rows) * u64::from(reference.cols) > BAND_CELLS
}

/// A field of which rows come, from the north to the south.
pub(super) struct Rows {
    grid: Grid,
    spool: Spool,
    field: Writer<Spool>,
    /// Values that make no row of chunks yet.
    left: Vec<f32>,
    cells_done: usize,
}

impl Rows {
    /// None yet. Of a large step nothing is held.
    pub(super) fn none(reference: &Reference) -> Result<Self, StorageError> {
        let grid = shape_only(reference.rows, reference.cols);
        let held_bytes = if is_large(reference) { 0 } else { u64::MAX };
        let spool = Spool::holding(&FOLDER, held_bytes);
        let field = Writer::new(spool.clone(), &grid, reference.period);
        Ok(Self {
            grid,
            field: field.map_err(|e| spool.or_failure(e))?,
            spool,
            left: vec![],
            cells_done: 0,
        })
    }

    /// The same and the next rows, as many as there are.
    pub(super) fn and(mut self, values: Vec<f32>) -> Result<Self, StorageError> {
        let values = if self.left.is_empty() {
            values
        } else {
            self.left.extend_from_slice(&values);
            std::mem::take(&mut self.left)
        };
        let chunk_row = (CHUNK_ROWS as usize * self.grid.cols as usize).max(1);
        let is_end = self.cells_done + values.len() >= self.grid.cell_count();
        let whole = if is_end {
            values.len()
        } else {
            values.len() / chunk_row * chunk_row
        };
        let (whole, left) = values.split_at(whole);
        let written = self.field.band(whole);
        written.map_err(|e| self.spool.or_failure(e))?;
        self.cells_done += whole.len();
        self.left = left.to_vec();
        Ok(self)
    }

    /// The field, if its values are those of a name.
    pub(super) fn named(self, digest: Digest) -> Result<Option<Content>, StorageError> {
        let Self { spool, field, .. } = self;
        let (found, _) = field.finish().map_err(|e| spool.or_failure(e))?;
        if found != digest {
            return Ok(None);
        }
        spool.into_content().map(Some)
    }
}
