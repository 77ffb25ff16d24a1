//! Series: a run of steps time-major, a row a small block of cells with each cell's whole run side by side.

use std::sync::{Arc, LazyLock};

use arrow::array::{Float32Builder, ListBuilder, RecordBatch, UInt32Array};
use arrow::datatypes::{DataType, Field, Schema, SchemaRef};
use bytes::Bytes;
use contract::chunk::windows;
use contract::digest::Digest;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::product::ProductId;

use crate::frames::value_field;
use crate::{StorageError, Store, parquet_table};

/// Rows and columns of a block: a point reads 64 cells, 94 KiB for a year of days.
pub const BLOCK_CELLS: u32 = 8;
/// Blocks a reader takes at once.
const BLOCKS_PER_GROUP: usize = 32;

/// Columns of a series: `block` and `values`, `[cell in the block, step]`.
pub static SCHEMA: LazyLock<SchemaRef> = LazyLock::new(|| {
    Arc::new(Schema::new(vec![
        Field::new("block", DataType::UInt32, false),
        Field::new("values", DataType::List(value_field()), false),
    ]))
});

/// The block that holds a cell, and the cell's place in it: `(block, cell)`.
pub fn block_of(grid: &Grid, row: u32, col: u32) -> (u32, u32) {
    let blocks_across = grid.cols.div_ceil(BLOCK_CELLS);
    let (i, j) = (row / BLOCK_CELLS, col / BLOCK_CELLS);
    let width = BLOCK_CELLS.min(grid.cols - j * BLOCK_CELLS);
    let cell = (row % BLOCK_CELLS) * width + col % BLOCK_CELLS;
    (i * blocks_across + j, cell)
}

/// Bytes of a series of `steps`, each `[row, col]` in the order of time.
pub fn encode(grid: &Grid, steps: &[&[f32]]) -> Result<Bytes, StorageError> {
    if steps.iter().any(|step| step.len() != grid.cell_count()) {
        return Err(StorageError::damaged(
            "series to write",
            "a step does not fill the grid",
        ));
    }
    let blocks = windows(grid, BLOCK_CELLS, BLOCK_CELLS);
    let mut lists = ListBuilder::new(Float32Builder::new()).with_field(value_field());
    for block in &blocks {
        for index in block.cell_indices(grid) {
            for step in steps {
                let value = step[index];
                let value = if value.is_nan() { f32::NAN } else { value };
                lists.values().append_value(value);
            }
        }
        lists.append(true);
    }
    let batch = RecordBatch::try_new(
        Arc::clone(&SCHEMA),
        vec![
            Arc::new(UInt32Array::from_iter_values(0..blocks.len() as u32)),
            Arc::new(lists.finish()),
        ],
    )
    .map_err(|e| StorageError::damaged("series to write", e))?;
    parquet_table::encode(&batch, BLOCKS_PER_GROUP)
}

/// Stores a series under the digest of its bytes.
pub async fn write(
    store: &Store,
    product: &ProductId,
    grid: &Grid,
    steps: &[&[f32]],
) -> Result<ObjectKey, StorageError> {
    let content = encode(grid, steps)?;
    let key = ObjectKey::series(product, &Digest::of(&content));
    store.put_new(&key, content).await?;
    Ok(key)
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "these values are exact")]
mod tests {
    use super::*;
    use arrow::datatypes::Float32Type;

    #[test]
    fn every_cell_finds_its_own_run() {
        let grid = Grid {
            rows: 19,
            cols: 21,
            north_deg: 10.0,
            west_deg: 0.0,
            dlat_deg: 1.0,
            dlon_deg: 1.0,
        };
        let step = |k: usize| -> Vec<f32> {
            (0..grid.cell_count())
                .map(|i| (i * 10 + k) as f32)
                .collect()
        };
        let (a, b) = (step(0), step(1));
        let bytes = encode(&grid, &[&a, &b]).unwrap();
        let table = parquet_table::decode("s", bytes, &SCHEMA).unwrap();
        for row in 0..grid.rows {
            for col in 0..grid.cols {
                let (block, cell) = block_of(&grid, row, col);
                let run = parquet_table::row_values::<Float32Type>(&table, 1, block as usize);
                let index = (row * grid.cols + col) as f32;
                let at = cell as usize * 2;
                assert_eq!(run.value(at), index * 10.0);
                assert_eq!(run.value(at + 1), index * 10.0 + 1.0);
            }
        }
    }
}
