//! `cell_mass(values, area_m2, seconds)`: kg of a chunk, exact, as a decimal.

use std::sync::Arc;

use datafusion::arrow::array::{ArrayRef, AsArray as _, Decimal128Array};
use datafusion::arrow::datatypes::{DataType, Float32Type, Float64Type};
use datafusion::common::{DataFusionError, Result};
use datafusion::logical_expr::{
    ColumnarValue, ScalarFunctionArgs, ScalarUDFImpl, Signature, Volatility,
};

use super::lists::{Argument, Lists, check_types, same_length};
use crate::budget::chunk::mass_steps;
use crate::budget::fixed::MASS_DECIMALS;

const NAME: &str = "cell_mass";
/// Digits of the decimals: the most that 128 bits hold.
pub(super) const DIGITS: u8 = 38;

#[derive(Debug, PartialEq, Eq, Hash)]
pub(super) struct CellMass {
    signature: Signature,
}

impl CellMass {
    pub(super) fn new() -> Self {
        Self {
            signature: Signature::any(3, Volatility::Immutable),
        }
    }
}

impl ScalarUDFImpl for CellMass {
    fn name(&self) -> &'static str {
        NAME
    }

    fn signature(&self) -> &Signature {
        &self.signature
    }

    fn return_type(&self, arguments: &[DataType]) -> Result<DataType> {
        let expected = [
            Argument::List(DataType::Float32),
            Argument::List(DataType::Float64),
            Argument::Scalar(DataType::Float64),
        ];
        check_types(NAME, arguments, &expected)?;
        Ok(DataType::Decimal128(DIGITS, MASS_DECIMALS as i8))
    }

    fn invoke_with_args(&self, args: ScalarFunctionArgs) -> Result<ColumnarValue> {
        let arrays = ColumnarValue::values_to_arrays(&args.args)?;
        let values = Lists::<Float32Type>::of(NAME, &arrays[0])?;
        let areas = Lists::<Float64Type>::of(NAME, &arrays[1])?;
        let seconds = arrays[2].as_primitive::<Float64Type>();
        let masses: Vec<i128> = (0..arrays[0].len())
            .map(|row| {
                let (values, areas) = same_length(NAME, values.row(row), areas.row(row))?;
                mass_steps(values, areas, seconds.value(row))
                    .map_err(|e| DataFusionError::Execution(format!("{NAME}: {e} kg")))
            })
            .collect::<Result<_>>()?;
        decimals(masses, MASS_DECIMALS)
    }
}

/// A column of decimals from integers of `decimals` decimals.
pub(super) fn decimals(values: Vec<i128>, decimals: u32) -> Result<ColumnarValue> {
    let array = Decimal128Array::from(values).with_precision_and_scale(DIGITS, decimals as i8)?;
    Ok(ColumnarValue::Array(Arc::new(array) as ArrayRef))
}
