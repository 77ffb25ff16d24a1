//! `series_at(values, cell, step_count)`: the run of steps of one cell of a block.

use std::sync::Arc;

use datafusion::arrow::array::{ArrayRef, AsArray as _, Float32Builder, ListBuilder};
use datafusion::arrow::datatypes::{DataType, Field, Float32Type, Int64Type};
use datafusion::common::{Result, exec_err};
use datafusion::logical_expr::{
    ColumnarValue, ScalarFunctionArgs, ScalarUDFImpl, Signature, Volatility,
};

use super::lists::{Argument, Lists, check_types};
use crate::stats::series::series_at;

const NAME: &str = "series_at";

#[derive(Debug, PartialEq, Eq, Hash)]
pub(super) struct SeriesAt {
    signature: Signature,
}

impl SeriesAt {
    pub(super) fn new() -> Self {
        Self {
            signature: Signature::any(3, Volatility::Immutable),
        }
    }
}

fn item() -> Arc<Field> {
    Arc::new(Field::new("item", DataType::Float32, false))
}

impl ScalarUDFImpl for SeriesAt {
    fn name(&self) -> &'static str {
        NAME
    }

    fn signature(&self) -> &Signature {
        &self.signature
    }

    fn return_type(&self, arguments: &[DataType]) -> Result<DataType> {
        let expected = [
            Argument::List(DataType::Float32),
            Argument::Scalar(DataType::Int64),
            Argument::Scalar(DataType::Int64),
        ];
        check_types(NAME, arguments, &expected)?;
        Ok(DataType::List(item()))
    }

    fn invoke_with_args(&self, args: ScalarFunctionArgs) -> Result<ColumnarValue> {
        let arrays = ColumnarValue::values_to_arrays(&args.args)?;
        let values = Lists::<Float32Type>::of(NAME, &arrays[0])?;
        let (cells, counts) = (
            arrays[1].as_primitive::<Int64Type>(),
            arrays[2].as_primitive::<Int64Type>(),
        );
        let mut out = ListBuilder::new(Float32Builder::new()).with_field(item());
        for row in 0..arrays[0].len() {
            let (cell, count) = (cells.value(row), counts.value(row));
            let picked = usize::try_from(cell).ok().zip(usize::try_from(count).ok());
            match picked.and_then(|(cell, count)| series_at(values.row(row), cell, count)) {
                Some(series) => out.values().append_slice(series),
                None => {
                    return exec_err!("{NAME}: the block holds no cell {cell} of {count} steps");
                }
            }
            out.append(true);
        }
        Ok(ColumnarValue::Array(Arc::new(out.finish()) as ArrayRef))
    }
}
