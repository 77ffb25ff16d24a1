//! `column_sum(values, seconds)`: the running sum of carbon in every cell of a chunk over its steps.
//!
//! Used as a window function over the steps of a chunk. The result is a list of integers, kg m⁻² in steps of 10⁻¹⁵:
//! exact, so that runs of steps can be summed apart and joined.

use std::mem::size_of;
use std::sync::Arc;

use datafusion::arrow::array::{ArrayRef, AsArray as _, Int64Array, ListArray};
use datafusion::arrow::buffer::OffsetBuffer;
use datafusion::arrow::datatypes::{
    DataType, Field, FieldRef, Float32Type, Float64Type, Int64Type,
};
use datafusion::common::{DataFusionError, Result, ScalarValue, exec_err};
use datafusion::logical_expr::function::{AccumulatorArgs, StateFieldsArgs};
use datafusion::logical_expr::{Accumulator, AggregateUDFImpl, Signature, Volatility};

use super::lists::{Argument, Lists, check_types};
use crate::budget::fixed::OutOfRange;
use crate::budget::running::{add_step, add_sums};

const NAME: &str = "column_sum";

#[derive(Debug, PartialEq, Eq, Hash)]
pub(super) struct ColumnSum {
    signature: Signature,
}

impl ColumnSum {
    pub(super) fn new() -> Self {
        Self {
            signature: Signature::any(2, Volatility::Immutable),
        }
    }
}

fn item() -> FieldRef {
    Arc::new(Field::new("item", DataType::Int64, false))
}

impl AggregateUDFImpl for ColumnSum {
    fn name(&self) -> &'static str {
        NAME
    }

    fn signature(&self) -> &Signature {
        &self.signature
    }

    fn return_type(&self, arguments: &[DataType]) -> Result<DataType> {
        check_types(
            NAME,
            arguments,
            &[
                Argument::List(DataType::Float32),
                Argument::Scalar(DataType::Float64),
            ],
        )?;
        Ok(DataType::List(item()))
    }

    fn state_fields(&self, args: StateFieldsArgs<'_>) -> Result<Vec<FieldRef>> {
        Ok(vec![Arc::new(Field::new(
            args.name,
            DataType::List(item()),
            false,
        ))])
    }

    fn accumulator(&self, _args: AccumulatorArgs<'_>) -> Result<Box<dyn Accumulator>> {
        Ok(Box::new(Sums::default()))
    }
}

/// Running sums; none before the first row.
#[derive(Debug, Default)]
struct Sums {
    sums: Option<Vec<i64>>,
}

impl Sums {
    /// The sums, as many as the first row has cells.
    fn of_cells(&mut self, cell_count: usize) -> Result<&mut [i64]> {
        let sums = self.sums.get_or_insert_with(|| vec![0; cell_count]);
        if sums.len() == cell_count {
            Ok(sums)
        } else {
            exec_err!(
                "{NAME}: a step of {cell_count} cells follows one of {}",
                sums.len()
            )
        }
    }

    fn list(&self) -> ScalarValue {
        let sums = self.sums.clone().unwrap_or_default();
        let offsets = OffsetBuffer::from_lengths([sums.len()]);
        let values = Arc::new(Int64Array::from(sums));
        ScalarValue::List(Arc::new(ListArray::new(item(), offsets, values, None)))
    }
}

impl Accumulator for Sums {
    fn update_batch(&mut self, arguments: &[ArrayRef]) -> Result<()> {
        let steps = Lists::<Float32Type>::of(NAME, &arguments[0])?;
        let seconds = arguments[1].as_primitive::<Float64Type>();
        for row in 0..arguments[0].len() {
            let values = steps.row(row);
            add_step(self.of_cells(values.len())?, values, seconds.value(row))
                .map_err(out_of_range)?;
        }
        Ok(())
    }

    fn merge_batch(&mut self, states: &[ArrayRef]) -> Result<()> {
        let lists = Lists::<Int64Type>::of(NAME, &states[0])?;
        for row in 0..states[0].len() {
            let others = lists.row(row);
            // A part that saw no row has nothing to say about the number of cells.
            if !others.is_empty() {
                add_sums(self.of_cells(others.len())?, others).map_err(out_of_range)?;
            }
        }
        Ok(())
    }

    fn state(&mut self) -> Result<Vec<ScalarValue>> {
        Ok(vec![self.list()])
    }

    fn evaluate(&mut self) -> Result<ScalarValue> {
        Ok(self.list())
    }

    fn size(&self) -> usize {
        size_of::<Self>()
            + self
                .sums
                .as_ref()
                .map_or(0, |sums| sums.capacity() * size_of::<i64>())
    }
}

fn out_of_range(e: OutOfRange) -> DataFusionError {
    DataFusionError::Execution(format!("{NAME}: {e} kg m-2"))
}
