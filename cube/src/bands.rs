//! A field in bands of whole rows: whoever puts one into a cube need not hold all of it.

use std::ops::Range;
use std::sync::Arc;

use futures::FutureExt as _;
use futures::future::BoxFuture;

use crate::CubeError;

/// Values of one field, asked for from north to south, every row once.
pub trait Bands: Send {
    /// Values of some rows, `[row, col]` of all columns, stored unit, NaN no data.
    fn rows(&mut self, rows: Range<u32>) -> BoxFuture<'_, Result<Vec<f32>, CubeError>>;
}

/// A field that is held whole.
pub struct WholeField {
    values: Arc<[f32]>,
    cols: usize,
}

impl WholeField {
    /// Of values `[row, col]` in so many columns.
    pub fn new(values: Arc<[f32]>, cols: u32) -> Self {
        let cols = cols as usize;
        Self { values, cols }
    }
}

impl Bands for WholeField {
    fn rows(&mut self, rows: Range<u32>) -> BoxFuture<'_, Result<Vec<f32>, CubeError>> {
        let cells = rows.start as usize * self.cols..rows.end as usize * self.cols;
        let found = match self.values.get(cells.clone()) {
            Some(values) => Ok(values.to_vec()),
            None => Err(CubeError::Shape {
                expected: cells.end,
                found: self.values.len(),
            }),
        };
        async move { found }.boxed()
    }
}
