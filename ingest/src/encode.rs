//! [`CheckedBand`]s in, [`EncodedGrid`] out: the bytes of a field, written as its bands come, and the key that the digest of its
//! values gives it.

use std::path::Path;

use contract::chunk::CHUNK_ROWS;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::masked::MaskedCells;
use contract::product::ProductId;
use contract::time::Period;
use storage::StorageError;
use storage::content::Content;
use storage::fields::Writer;
use storage::spool::Spool;

use crate::check::CheckedBand;
use crate::error::IngestError;

pub(crate) use storage::spool::HELD_BYTES;

/// One step as the bytes of a field.
#[derive(Debug, Clone)]
pub(crate) struct EncodedGrid {
    pub(crate) period: Period,
    pub(crate) key: ObjectKey,
    pub(crate) field: Content,
    pub(crate) valid_cells: u64,
    pub(crate) masked: MaskedCells,
}

/// A field that is being written.
pub(crate) struct Encoding {
    grid: Grid,
    spool: Spool,
    field: Writer<Spool>,
}

impl Encoding {
    /// A field whose first rows, so many, hold nothing. What is too large to be held goes to a file in `folder`.
    pub(crate) fn begin(
        folder: &Path,
        grid: &Grid,
        period: Period,
        empty_rows: u32,
    ) -> Result<Self, IngestError> {
        let spool = Spool::new(folder);
        let field = Writer::new(spool.clone(), grid, period).map_err(|e| failed(&spool, e))?;
        let mut encoding = Self {
            grid: *grid,
            spool,
            field,
        };
        let mut left = empty_rows;
        while left > 0 {
            let rows = left.min(CHUNK_ROWS);
            let cells = rows as usize * encoding.grid.cols as usize;
            encoding.band(&CheckedBand(vec![f32::NAN; cells]))?;
            left -= rows;
        }
        Ok(encoding)
    }

    /// Writes the next rows.
    pub(crate) fn band(&mut self, band: &CheckedBand) -> Result<(), IngestError> {
        self.field.band(&band.0).map_err(|e| failed(&self.spool, e))
    }

    /// The key and the bytes of the field.
    pub(crate) fn finish(self, product: &ProductId) -> Result<(ObjectKey, Content), IngestError> {
        let Self { spool, field, .. } = self;
        let (digest, _) = field.finish().map_err(|e| failed(&spool, e))?;
        let content = spool.into_content().map_err(unspooled)?;
        Ok((ObjectKey::field(product, &digest), content))
    }
}

/// A full disk is no fault of the field.
fn failed(spool: &Spool, error: StorageError) -> IngestError {
    unspooled(spool.or_failure(error))
}

fn unspooled(error: StorageError) -> IngestError {
    match error {
        StorageError::Spool { folder, source } => IngestError::Spool { folder, source },
        error => IngestError::storage("encode a field")(error),
    }
}
