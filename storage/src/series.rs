//! Series: a run of steps time-major, a row a small block of cells with each cell's whole run side by side.

use std::sync::{Arc, LazyLock};

use arrow::array::{Float32Builder, ListBuilder, RecordBatch, UInt32Array};
use arrow::datatypes::{DataType, Field, Float32Type, Schema, SchemaRef, UInt32Type};
use bytes::Bytes;
use contract::chunk::{Window, windows};
use contract::digest::Digest;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::kind::Vouched;
use contract::product::ProductId;

use crate::off_thread::off_thread;
use crate::parquet_table::{self, shape_only, value_field};
use crate::row_check::RowCheck;
use crate::rows::Expected;
use crate::sound::damage;
use crate::values::{ValuesDigest, no_data_alike};
use crate::{Encoded, StorageError, Store};

/// Rows and columns of a block: a point reads 64 cells, 94 KiB for a year of days.
pub const BLOCK_CELLS: u32 = 8;
/// Blocks a reader takes at once.
const BLOCKS_PER_GROUP: usize = 32;

/// Columns of a series: `block`, `values`, `[cell in the block, step]`, and `check`, the [`RowCheck`] of both.
pub static SCHEMA: LazyLock<SchemaRef> = LazyLock::new(|| {
    let mut fields = SCHEMA_1.fields().to_vec();
    fields.push(Arc::new(Field::new("check", DataType::UInt32, false)));
    Arc::new(Schema::new(fields))
});

/// The same of series that are named by their bytes.
pub static SCHEMA_1: LazyLock<SchemaRef> = LazyLock::new(|| {
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

/// What the row of a block must be, for who reads some rows ([`crate::rows`]); `blocks` are all of the grid.
pub fn expected(blocks: &[Window], block: u32, step_count: usize) -> Expected {
    let cells = blocks.get(block as usize).map_or(0, |own| own.cell_count());
    Expected {
        length: cells * step_count,
        check: RowCheck::new().u32(block),
    }
}

/// A series of `steps`, each `[row, col]`, in the order of time, as bytes.
pub fn encode(grid: &Grid, steps: &[&[f32]]) -> Result<Encoded, StorageError> {
    let shape = [grid.rows, grid.cols, steps.len() as u32];
    let batch = batch(grid, steps)?;
    Ok(Encoded {
        values_sha256: digest_of(grid, steps),
        content: parquet_table::encode(&batch, BLOCKS_PER_GROUP, &shape)?,
    })
}

/// What a series is: the shape of its grid and its steps in the order of time, each row by row.
fn digest_of(grid: &Grid, steps: &[&[f32]]) -> Digest {
    let shape = ValuesDigest::new("fluxglobe series 2\n")
        .number(grid.rows.into())
        .number(grid.cols.into())
        .number(steps.len() as i64);
    let all = steps.iter().fold(shape, |sum, step| sum.values(step));
    all.finish()
}

fn batch(grid: &Grid, steps: &[&[f32]]) -> Result<RecordBatch, StorageError> {
    if steps.iter().any(|step| step.len() != grid.cell_count()) {
        return Err(StorageError::damaged(
            "series to write",
            "a step does not fill the grid",
        ));
    }
    let blocks = windows(grid, BLOCK_CELLS, BLOCK_CELLS);
    let mut lists = ListBuilder::new(Float32Builder::new()).with_field(value_field());
    let mut checks = Vec::with_capacity(blocks.len());
    let mut values = vec![];
    for (number, block) in blocks.iter().enumerate() {
        values.clear();
        for index in block.cell_indices(grid) {
            values.extend(steps.iter().map(|step| no_data_alike(step[index])));
        }
        lists.values().append_slice(&values);
        lists.append(true);
        let check = RowCheck::new().u32(number as u32).f32s(&values);
        checks.push(check.finish());
    }
    RecordBatch::try_new(
        Arc::clone(&SCHEMA),
        vec![
            Arc::new(UInt32Array::from_iter_values(0..blocks.len() as u32)),
            Arc::new(lists.finish()),
            Arc::new(UInt32Array::from(checks)),
        ],
    )
    .map_err(|e| StorageError::damaged("series to write", e))
}

/// The steps of a series that is named by its values, each `[row, col]`.
pub(crate) fn decode(key: &ObjectKey, content: Bytes) -> Result<Vec<Vec<f32>>, StorageError> {
    let damaged = |reason: &str| damage::found(key, reason);
    let Vouched::Values(name) = key.vouches() else {
        return Err(damaged("it is not named by its values"));
    };
    let table = parquet_table::decode(key, content, &SCHEMA)?;
    let [rows, cols, step_count] = table.shape[..] else {
        return Err(damaged("it does not say what its values lie on"));
    };
    let (grid, step_count) = (shape_only(rows, cols), step_count as usize);
    let blocks = windows(&grid, BLOCK_CELLS, BLOCK_CELLS);
    let numbers = parquet_table::numbers::<UInt32Type>(&table.batch, 0);
    if table.batch.num_rows() != blocks.len() {
        return Err(damaged("it has not every block of its grid once"));
    }
    let mut steps = vec![vec![f32::NAN; grid.cell_count()]; step_count];
    for row in 0..blocks.len() {
        let values = parquet_table::row_values::<Float32Type>(&table.batch, 1, row);
        let block = blocks
            .get(numbers.value(row) as usize)
            .filter(|block| block.cell_count() * step_count == values.len())
            .ok_or_else(|| damaged("a block does not fit its grid"))?;
        let runs = values.values().chunks_exact(step_count.max(1));
        for (index, run) in block.cell_indices(&grid).zip(runs) {
            for (step, value) in steps.iter_mut().zip(run) {
                step[index] = *value;
            }
        }
    }
    let views: Vec<&[f32]> = steps.iter().map(Vec::as_slice).collect();
    if digest_of(&grid, &views) == name {
        Ok(steps)
    } else {
        Err(damaged("its values are not those of its name"))
    }
}

/// Is a stored series what its name says? It is read whole.
pub async fn check(store: &Store, key: &ObjectKey) -> Result<(), StorageError> {
    let content = store.get(key).await?;
    if let Vouched::Values(_) = key.vouches() {
        let key = key.clone();
        off_thread(move || decode(&key, content).map(|_steps| ())).await?;
    }
    Ok(())
}

/// Stores a series under the digest of its values.
pub async fn write(
    store: &Store,
    product: &ProductId,
    grid: &Grid,
    steps: &[&[f32]],
) -> Result<ObjectKey, StorageError> {
    let encoded = encode(grid, steps)?;
    let key = ObjectKey::series(product, &encoded.values_sha256);
    store.put_new(&key, encoded.content).await?;
    Ok(key)
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "these values are exact")]
mod tests {
    use super::*;
    use arrow::compute::concat_batches;

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
        let encoded = encode(&grid, &[&a, &b]).unwrap();
        let key = ObjectKey::series(&"p".parse().unwrap(), &encoded.values_sha256);
        let content = encoded.content;
        let table = parquet_table::decode(&key, content.clone(), &SCHEMA).unwrap();
        for row in 0..grid.rows {
            for col in 0..grid.cols {
                let (block, cell) = block_of(&grid, row, col);
                let run = parquet_table::row_values::<Float32Type>(&table.batch, 1, block as usize);
                let index = (row * grid.cols + col) as f32;
                let at = cell as usize * 2;
                assert_eq!(run.value(at), index * 10.0);
                assert_eq!(run.value(at + 1), index * 10.0 + 1.0);
            }
        }
        assert_eq!(
            decode(&key, content.clone()).unwrap(),
            [a.clone(), b.clone()]
        );
        let swapped = encode(&grid, &[&b, &a]).unwrap();
        assert!(decode(&key, swapped.content).is_err());
    }

    #[test]
    fn a_series_that_lacks_a_block_or_has_one_twice_is_damaged() {
        let grid = shape_only(9, 16);
        // The last block holds no data: without it the values are the same.
        let step: Vec<f32> = (0..grid.cell_count())
            .map(|i| if i < 8 * 16 + 8 { i as f32 } else { f32::NAN })
            .collect();
        let name = digest_of(&grid, &[&step]);
        let key = ObjectKey::series(&"p".parse().unwrap(), &name);
        let whole = batch(&grid, &[&step]).unwrap();
        let without = whole.slice(0, whole.num_rows() - 1);
        let twice = concat_batches(&SCHEMA, [&whole, &whole.slice(0, 1)]).unwrap();
        let read = |batch: &RecordBatch| {
            let content = parquet_table::encode(batch, BLOCKS_PER_GROUP, &[9, 16, 1]).unwrap();
            decode(&key, content)
        };
        assert!(read(&whole).is_ok());
        for batch in [&without, &twice] {
            let error = read(batch).unwrap_err().to_string();
            assert!(error.contains("every block"), "{error}");
        }
    }
}
