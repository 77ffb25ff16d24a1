//! `has_data(values)`: which cells of a chunk hold data, as a list of booleans.

use std::sync::Arc;

use datafusion::arrow::array::{ArrayRef, BooleanBuilder, ListBuilder};
use datafusion::arrow::datatypes::{DataType, Field, FieldRef, Float32Type};
use datafusion::common::Result;
use datafusion::logical_expr::{
    ColumnarValue, ScalarFunctionArgs, ScalarUDFImpl, Signature, Volatility,
};

use super::lists::{Argument, Lists, check_types};

const NAME: &str = "has_data";

#[derive(Debug, PartialEq, Eq, Hash)]
pub(super) struct HasData {
    signature: Signature,
}

impl HasData {
    pub(super) fn new() -> Self {
        Self {
            signature: Signature::any(1, Volatility::Immutable),
        }
    }
}

fn item() -> FieldRef {
    Arc::new(Field::new("item", DataType::Boolean, false))
}

impl ScalarUDFImpl for HasData {
    fn name(&self) -> &'static str {
        NAME
    }

    fn signature(&self) -> &Signature {
        &self.signature
    }

    fn return_type(&self, arguments: &[DataType]) -> Result<DataType> {
        check_types(NAME, arguments, &[Argument::List(DataType::Float32)])?;
        Ok(DataType::List(item()))
    }

    fn invoke_with_args(&self, args: ScalarFunctionArgs) -> Result<ColumnarValue> {
        let arrays = ColumnarValue::values_to_arrays(&args.args)?;
        let values = Lists::<Float32Type>::of(NAME, &arrays[0])?;
        let mut out = ListBuilder::new(BooleanBuilder::new()).with_field(item());
        for row in 0..arrays[0].len() {
            for value in values.row(row) {
                out.values().append_value(!value.is_nan());
            }
            out.append(true);
        }
        Ok(ColumnarValue::Array(Arc::new(out.finish()) as ArrayRef))
    }
}
