//! `valid_area(values, area_m2)` and `total_area(area_m2)`: m² of a chunk, exact, as decimals.

use datafusion::arrow::datatypes::{DataType, Float32Type, Float64Type};
use datafusion::common::{DataFusionError, Result};
use datafusion::logical_expr::{
    ColumnarValue, ScalarFunctionArgs, ScalarUDFImpl, Signature, Volatility,
};

use super::cell_mass::{DIGITS, decimals};
use super::lists::{Argument, Lists, check_types, same_length};
use crate::budget::chunk::{total_area_steps, valid_area_steps};
use crate::budget::fixed::{AREA_DECIMALS, OutOfRange};

const VALID: &str = "valid_area";
const TOTAL: &str = "total_area";

#[derive(Debug, PartialEq, Eq, Hash)]
pub(super) struct ValidArea {
    signature: Signature,
}

impl ValidArea {
    pub(super) fn new() -> Self {
        Self {
            signature: Signature::any(2, Volatility::Immutable),
        }
    }
}

impl ScalarUDFImpl for ValidArea {
    fn name(&self) -> &'static str {
        VALID
    }

    fn signature(&self) -> &Signature {
        &self.signature
    }

    fn return_type(&self, arguments: &[DataType]) -> Result<DataType> {
        check_types(
            VALID,
            arguments,
            &[
                Argument::List(DataType::Float32),
                Argument::List(DataType::Float64),
            ],
        )?;
        Ok(area_type())
    }

    fn invoke_with_args(&self, args: ScalarFunctionArgs) -> Result<ColumnarValue> {
        let arrays = ColumnarValue::values_to_arrays(&args.args)?;
        let values = Lists::<Float32Type>::of(VALID, &arrays[0])?;
        let areas = Lists::<Float64Type>::of(VALID, &arrays[1])?;
        let sums: Vec<i128> = (0..arrays[0].len())
            .map(|row| {
                let (values, areas) = same_length(VALID, values.row(row), areas.row(row))?;
                valid_area_steps(values, areas).map_err(|e| out_of_range(VALID, e))
            })
            .collect::<Result<_>>()?;
        decimals(sums, AREA_DECIMALS)
    }
}

#[derive(Debug, PartialEq, Eq, Hash)]
pub(super) struct TotalArea {
    signature: Signature,
}

impl TotalArea {
    pub(super) fn new() -> Self {
        Self {
            signature: Signature::any(1, Volatility::Immutable),
        }
    }
}

impl ScalarUDFImpl for TotalArea {
    fn name(&self) -> &'static str {
        TOTAL
    }

    fn signature(&self) -> &Signature {
        &self.signature
    }

    fn return_type(&self, arguments: &[DataType]) -> Result<DataType> {
        check_types(TOTAL, arguments, &[Argument::List(DataType::Float64)])?;
        Ok(area_type())
    }

    fn invoke_with_args(&self, args: ScalarFunctionArgs) -> Result<ColumnarValue> {
        let arrays = ColumnarValue::values_to_arrays(&args.args)?;
        let areas = Lists::<Float64Type>::of(TOTAL, &arrays[0])?;
        let sums: Vec<i128> = (0..arrays[0].len())
            .map(|row| total_area_steps(areas.row(row)).map_err(|e| out_of_range(TOTAL, e)))
            .collect::<Result<_>>()?;
        decimals(sums, AREA_DECIMALS)
    }
}

fn area_type() -> DataType {
    DataType::Decimal128(DIGITS, AREA_DECIMALS as i8)
}

fn out_of_range(function: &str, e: OutOfRange) -> DataFusionError {
    DataFusionError::Execution(format!("{function}: {e} m2"))
}
