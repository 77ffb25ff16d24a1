//! A stored field in bands of rows.

use std::ops::Range;

use contract::chunk::BAND_CELLS;
use contract::grid::Grid;
use contract::key::ObjectKey;
use futures::future::BoxFuture;
use storage::{Store, fields};

use crate::bands::Bands;
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
    /// Values of all rows, which are given away when all are asked for at once.
    Whole(Vec<f32>),
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
        Ok(Read::Whole(values))
    }

    /// Some of the values of all rows.
    fn part(&self, values: &mut Vec<f32>, rows: Range<u32>) -> Result<Vec<f32>, CubeError> {
        let cols = self.grid.cols as usize;
        let cells = rows.start as usize * cols..rows.end as usize * cols;
        if cells == (0..values.len()) {
            return Ok(std::mem::take(values));
        }
        let found = values.get(cells.clone()).map(<[f32]>::to_vec);
        found.ok_or(CubeError::Shape {
            expected: cells.end,
            found: values.len(),
        })
    }
}

impl Bands for FieldBands {
    fn rows(&mut self, rows: Range<u32>) -> BoxFuture<'_, Result<Vec<f32>, CubeError>> {
        Box::pin(async move {
            let mut read = match self.read.take() {
                Some(read) => read,
                None => self.open().await?,
            };
            let found = match &mut read {
                Read::Whole(values) => self.part(values, rows)?,
                Read::Rows(reader) => reader.rows(rows).await?,
            };
            self.read = Some(read);
            Ok(found)
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

#[cfg(test)]
mod tests {
    use contract::product::ProductId;
    use contract::time::Period;

    use super::*;

    const GRID: Grid = Grid {
        rows: 70,
        cols: 130,
        north_deg: 45.0,
        west_deg: 0.0,
        dlat_deg: 0.5,
        dlon_deg: 0.5,
    };

    #[tokio::test]
    async fn a_field_comes_whole_or_in_parts_and_other_values_under_its_name_are_none() {
        let (store, product) = (Store::memory(), "p".parse::<ProductId>().unwrap());
        let period = Period::month(2000, 1).unwrap();
        let values: Vec<f32> = (0..GRID.cell_count()).map(|cell| cell as f32).collect();
        let write = async |values: &[f32]| {
            let written = fields::write(&store, &product, &GRID, values, period).await;
            written.unwrap()
        };
        let field = write(&values).await;
        let read = async |parts: &[[u32; 2]]| {
            let mut bands = FieldBands::new(&store, &field, &GRID);
            let mut all = vec![];
            for [first, end] in parts {
                all.extend(bands.rows(*first..*end).await?);
            }
            Ok::<_, CubeError>(all)
        };
        assert!(read(&[[0, 70]]).await.unwrap() == values);
        assert!(read(&[[0, 30], [30, 70]]).await.unwrap() == values);
        assert!(read(&[[0, 71]]).await.is_err());
        // Each of its chunks is whole; only all of them together are not what the name says.
        let mut others = values.clone();
        others[5000] += 1.0;
        let other = write(&others).await;
        let content = store.get(&other).await.unwrap();
        store.put_over(&field, content).await.unwrap();
        let error = read(&[[0, 70]]).await.unwrap_err().to_string();
        assert!(error.contains(field.as_str()), "{error}");
    }
}
