//! `band_sums(values, chunk, seconds, weights, grid)`: mass and valid area of a region's share of a chunk in every band of
//! latitude that holds any, exact, as text (`budget::bands`).
//!
//! Text, because the engine calls an asynchronous function once for every field that is taken of its answer; and because
//! `string_agg` then joins what the chunks of a step say, in any order: what is summed are integers.
//!
//! `weights` is the address of the region's stored weights, `grid` the product's grid as JSON.

use std::sync::Arc;

use async_trait::async_trait;
use contract::grid::Grid;
use datafusion::arrow::array::{Array as _, ArrayRef, AsArray as _, StringArray};
use datafusion::arrow::datatypes::{DataType, Float32Type, Float64Type, UInt32Type};
use datafusion::common::{DataFusionError, Result, ScalarValue, exec_err};
use datafusion::logical_expr::async_udf::AsyncScalarUDFImpl;
use datafusion::logical_expr::{
    ColumnarValue, ScalarFunctionArgs, ScalarUDFImpl, Signature, Volatility,
};

use super::lists::{Argument, Lists, check_types, same_length};
use crate::budget::bands::{band_sums, bands_text};
use crate::objects::Objects;
use crate::region::loaded::RegionWeights;

const NAME: &str = "band_sums";

#[derive(Debug, PartialEq, Eq, Hash)]
pub(super) struct BandSums {
    signature: Signature,
    objects: Objects,
}

impl BandSums {
    pub(super) fn new(objects: Objects) -> Self {
        Self {
            signature: Signature::any(5, Volatility::Immutable),
            objects,
        }
    }
}

impl ScalarUDFImpl for BandSums {
    fn name(&self) -> &'static str {
        NAME
    }

    fn signature(&self) -> &Signature {
        &self.signature
    }

    fn return_type(&self, arguments: &[DataType]) -> Result<DataType> {
        let expected = [
            Argument::List(DataType::Float32),
            Argument::Scalar(DataType::UInt32),
            Argument::Scalar(DataType::Float64),
            Argument::Scalar(DataType::Utf8),
            Argument::Scalar(DataType::Utf8),
        ];
        check_types(NAME, arguments, &expected)?;
        Ok(DataType::Utf8)
    }

    fn invoke_with_args(&self, _args: ScalarFunctionArgs) -> Result<ColumnarValue> {
        exec_err!("{NAME} reads weights and is called asynchronously only")
    }
}

#[async_trait]
impl AsyncScalarUDFImpl for BandSums {
    async fn invoke_async_with_args(&self, args: ScalarFunctionArgs) -> Result<ColumnarValue> {
        let weights = self.objects.weights(text(&args.args, 3)?).await?;
        let grid: Grid = serde_json::from_str(text(&args.args, 4)?)
            .map_err(|e| DataFusionError::Execution(format!("{NAME}: the grid: {e}")))?;
        let arrays = ColumnarValue::values_to_arrays(&args.args[..3])?;
        let sums = sums(&weights, &grid, &arrays)?;
        Ok(ColumnarValue::Array(Arc::new(sums)))
    }
}

fn text(arguments: &[ColumnarValue], index: usize) -> Result<&str> {
    if let Some(ColumnarValue::Scalar(ScalarValue::Utf8(Some(text)))) = arguments.get(index) {
        return Ok(text);
    }
    exec_err!("{NAME}: argument {index} is not one text")
}

fn sums(weights: &RegionWeights, grid: &Grid, arguments: &[ArrayRef]) -> Result<StringArray> {
    let [values, chunks, seconds] = arguments else {
        return exec_err!("{NAME}: {} arrays", arguments.len());
    };
    let lists = Lists::<Float32Type>::of(NAME, values)?;
    let (chunks, seconds) = (
        chunks.as_primitive::<UInt32Type>(),
        seconds.as_primitive::<Float64Type>(),
    );
    let row = |row: usize| match weights.areas_m2(chunks.value(row)) {
        None => Ok(String::new()),
        Some(areas) => {
            let (values, areas) = same_length(NAME, lists.row(row), areas)?;
            let chunk = chunks.value(row);
            band_sums(grid, chunk, values, areas, seconds.value(row))
                .map(|sums| bands_text(&sums))
                .map_err(|e| DataFusionError::Execution(format!("{NAME}, chunk {chunk}: {e}")))
        }
    };
    let rows: Vec<String> = (0..values.len()).map(row).collect::<Result<_>>()?;
    Ok(StringArray::from(rows))
}
