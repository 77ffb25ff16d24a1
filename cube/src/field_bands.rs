//! A stored field in bands of rows.

use std::ops::Range;
use std::sync::Arc;

use contract::chunk::BAND_CELLS;
use contract::grid::Grid;
use contract::key::ObjectKey;
use futures::future::BoxFuture;
use storage::{Store, fields};

use crate::bands::{Bands, WholeField};
use crate::{Cube, CubeError};

/// A field of a store, which is read when rows of it are first asked for: one of a band whole, and compared with its name; a larger
/// one row by row, each compared with its check.
pub struct FieldBands {
    store: Store,
    field: ObjectKey,
    grid: Grid,
    read: Option<Read>,
}

enum Read {
    Whole(WholeField),
    Rows(fields::Reader),
}

impl FieldBands {
    /// Of a field on a grid.
    pub fn new(store: &Store, field: &ObjectKey, grid: &Grid) -> Self {
        Self {
            store: store.clone(),
            field: field.clone(),
            grid: *grid,
            read: None,
        }
    }

    async fn open(&self) -> Result<Read, CubeError> {
        if self.grid.cell_count() as u64 > BAND_CELLS {
            let reader = fields::Reader::open(&self.store, &self.field, Some(&self.grid));
            return Ok(Read::Rows(reader.await?));
        }
        let values = fields::read(&self.store, &self.field, &self.grid).await?;
        let values: Arc<[f32]> = values.into();
        Ok(Read::Whole(WholeField::new(values, self.grid.cols)))
    }
}

impl Bands for FieldBands {
    fn rows(&mut self, rows: Range<u32>) -> BoxFuture<'_, Result<Vec<f32>, CubeError>> {
        Box::pin(async move {
            if self.read.is_none() {
                self.read = Some(self.open().await?);
            }
            match &mut self.read {
                Some(Read::Whole(read)) => read.rows(rows).await,
                Some(Read::Rows(reader)) => Ok(reader.rows(rows).await?),
                None => Ok(vec![]),
            }
        })
    }
}

/// A step of a cube, of whose chunks those are read that the rows touch.
pub(crate) struct CubeBands {
    pub(crate) cube: Cube,
    pub(crate) step: usize,
}

impl Bands for CubeBands {
    fn rows(&mut self, rows: Range<u32>) -> BoxFuture<'_, Result<Vec<f32>, CubeError>> {
        Box::pin(async move {
            let window = contract::chunk::Window {
                row: rows.start,
                col: 0,
                rows: rows.end - rows.start,
                cols: self.cube.description().grid.cols,
            };
            self.cube.window(self.step, window).await
        })
    }
}
