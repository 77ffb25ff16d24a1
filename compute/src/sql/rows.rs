//! Rows of a product's table, made of values as they were read: batches of the columns that are asked for.

use std::sync::Arc;

use contract::chunk::Window;
use cube::Block;
use datafusion::arrow::array::{
    ArrayRef, Float32Builder, Float64Array, RecordBatch, RecordBatchOptions,
    TimestampMillisecondArray,
};
use datafusion::arrow::datatypes::SchemaRef;
use datafusion::common::Result;

use super::axes::Axes;
use super::columns::Column;
use super::selection::Selection;

/// Most rows of a batch.
pub(super) const BATCH_ROWS: usize = 8192;

/// Makes batches.
pub(super) struct RowMaker<'a> {
    axes: &'a Axes,
    selection: &'a Selection,
    columns: &'a [Column],
    schema: &'a SchemaRef,
    /// Steps, rows and columns of the cells whose rows are being gathered.
    steps: Vec<u32>,
    rows: Vec<u32>,
    cols: Vec<u32>,
    values: Float32Builder,
    made: Vec<RecordBatch>,
}

impl<'a> RowMaker<'a> {
    pub(super) fn new(
        axes: &'a Axes,
        selection: &'a Selection,
        columns: &'a [Column],
        schema: &'a SchemaRef,
    ) -> Self {
        Self {
            axes,
            selection,
            columns,
            schema,
            steps: vec![],
            rows: vec![],
            cols: vec![],
            values: Float32Builder::new(),
            made: vec![],
        }
    }

    /// Rows of a chunk of a step; `values` are those of its window, none where no column asks for them.
    pub(super) fn chunk(
        &mut self,
        step: u32,
        window: Window,
        values: Option<&[f32]>,
    ) -> Result<()> {
        let selection = self.selection;
        let cols = inside(&selection.cols, window.col, window.cols);
        for &row in inside(&selection.rows, window.row, window.rows) {
            let first = (row - window.row) as usize * window.cols as usize;
            for &col in cols {
                let value = values.map(|values| values[first + (col - window.col) as usize]);
                self.row(step, [row, col], value)?;
            }
        }
        Ok(())
    }

    /// Rows of a block, its values from step `first` on; `steps` are those wanted.
    pub(super) fn block(&mut self, steps: &[u32], first: u32, block: &Block) -> Result<()> {
        let (selection, window) = (self.selection, block.window);
        let step_count = block.values.len() / window.cell_count().max(1);
        for &row in inside(&selection.rows, window.row, window.rows) {
            for &col in inside(&selection.cols, window.col, window.cols) {
                let cell = (row - window.row) * window.cols + (col - window.col);
                for &step in steps {
                    let at = cell as usize * step_count + (step - first) as usize;
                    self.row(step, [row, col], Some(block.values[at]))?;
                }
            }
        }
        Ok(())
    }

    fn row(&mut self, step: u32, [row, col]: [u32; 2], value: Option<f32>) -> Result<()> {
        self.steps.push(step);
        self.rows.push(row);
        self.cols.push(col);
        if let Some(value) = value {
            self.values
                .append_option((!value.is_nan()).then_some(value));
        }
        if self.steps.len() == BATCH_ROWS {
            self.batch()?;
        }
        Ok(())
    }

    fn batch(&mut self) -> Result<()> {
        if self.steps.is_empty() {
            return Ok(());
        }
        let mut values = Some(self.values.finish());
        let instants = |of: &[i64]| -> ArrayRef {
            let own = self.steps.iter().map(|step| of[*step as usize]);
            Arc::new(TimestampMillisecondArray::from_iter_values(own).with_timezone("UTC"))
        };
        let numbers = |of: &[f64], places: &[u32]| -> ArrayRef {
            let own = places.iter().map(|place| of[*place as usize]);
            Arc::new(Float64Array::from_iter_values(own))
        };
        let mut column = |column: &Column| -> ArrayRef {
            match column {
                Column::TimeStart => instants(&self.axes.starts_ms),
                Column::TimeEnd => instants(&self.axes.ends_ms),
                Column::Latitude => numbers(&self.axes.latitudes_deg, &self.rows),
                Column::Longitude => numbers(&self.axes.longitudes_deg, &self.cols),
                Column::Area => numbers(&self.axes.areas_km2, &self.rows),
                Column::Value => Arc::new(
                    values
                        .take()
                        .unwrap_or_else(|| Float32Builder::new().finish()),
                ),
            }
        };
        let columns: Vec<ArrayRef> = self.columns.iter().map(&mut column).collect();
        let options = RecordBatchOptions::new().with_row_count(Some(self.steps.len()));
        let batch = RecordBatch::try_new_with_options(Arc::clone(self.schema), columns, &options)?;
        self.made.push(batch);
        self.steps.clear();
        self.rows.clear();
        self.cols.clear();
        Ok(())
    }

    /// All batches of what was handed in.
    pub(super) fn finish(mut self) -> Result<Vec<RecordBatch>> {
        self.batch()?;
        Ok(self.made)
    }
}

/// Those of some increasing places that lie in a run of them.
fn inside(places: &[u32], first: u32, count: u32) -> &[u32] {
    let from = places.partition_point(|place| *place < first);
    let to = places.partition_point(|place| *place < first + count);
    &places[from..to]
}
