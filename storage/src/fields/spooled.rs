//! Bands of rows in, a stored field out: no more of it is held than a band, what its spool holds and a group of chunks.

use std::path::Path;

use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::product::ProductId;
use contract::time::Period;

use super::Writer;
use crate::spool::{HELD_BYTES, Spool};
use crate::{StorageError, Store};

/// A field that is written, from the north to the south, before it is put into a store.
pub struct Spooled {
    spool: Spool,
    field: Writer<Spool>,
    valid_cells: u64,
}

impl Spooled {
    /// A field without rows. What is too large to be held goes to a file in `folder`.
    ///
    /// # Errors
    /// Its first bytes cannot be written.
    pub fn begin(folder: &Path, grid: &Grid, period: Period) -> Result<Self, StorageError> {
        Self::one_of(1, folder, grid, period)
    }

    /// The same of one of several that are written at a time: together they hold what one holds.
    ///
    /// # Errors
    /// Its first bytes cannot be written.
    pub fn one_of(
        count: usize,
        folder: &Path,
        grid: &Grid,
        period: Period,
    ) -> Result<Self, StorageError> {
        let spool = Spool::holding(folder, HELD_BYTES / count.max(1) as u64);
        let begun = Writer::new(spool.clone(), grid, period);
        Ok(Self {
            field: begun.map_err(|e| spool.or_failure(e))?,
            spool,
            valid_cells: 0,
        })
    }

    /// Adds the next rows, as [`Writer::band`] takes them.
    ///
    /// # Errors
    /// They are no such rows, or cannot be written.
    pub fn band(&mut self, values: &[f32]) -> Result<(), StorageError> {
        let valid = values.iter().filter(|value| !value.is_nan());
        self.valid_cells += valid.count() as u64;
        let added = self.field.band(values);
        added.map_err(|e| self.spool.or_failure(e))
    }

    /// Stores it under the digest of its values; its key, and how many cells hold a value.
    ///
    /// # Errors
    /// Rows are missing, or it cannot be stored.
    pub async fn put(
        self,
        store: &Store,
        product: &ProductId,
    ) -> Result<(ObjectKey, u64), StorageError> {
        let Self { spool, field, .. } = self;
        let (digest, _) = field.finish().map_err(|e| spool.or_failure(e))?;
        let key = ObjectKey::field(product, &digest);
        store.put_new_content(&key, spool.into_content()?).await?;
        Ok((key, self.valid_cells))
    }
}
