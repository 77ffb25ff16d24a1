//! `band_sums(values, chunk, seconds, weights, grid)`: mass and valid area of a region's share of a chunk in every band of
//! latitude, exact, as a structure of decimals: `mass_0`, `area_0`, `mass_1` and so on from the south pole.
//!
//! `weights` is the address of the region's stored weights, `grid` the product's grid as JSON.

use std::sync::Arc;

use async_trait::async_trait;
use contract::grid::Grid;
use datafusion::arrow::array::{Array as _, ArrayRef, AsArray as _, StructArray};
use datafusion::arrow::datatypes::{DataType, Fields, Float32Type, Float64Type, UInt32Type};
use datafusion::common::{DataFusionError, Result, ScalarValue, exec_err};
use datafusion::logical_expr::async_udf::AsyncScalarUDFImpl;
use datafusion::logical_expr::{
    ColumnarValue, ScalarFunctionArgs, ScalarUDFImpl, Signature, Volatility,
};

use super::lists::{Argument, Lists, check_types, same_length};
use super::region_sums::{area_field, decimals, mass_field};
use crate::budget::bands::{BAND_COUNT, band_sums};
use crate::budget::chunk::ChunkSums;
use crate::budget::fixed::{AREA_DECIMALS, MASS_DECIMALS};
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

fn fields() -> Fields {
    let band = |band| {
        [
            mass_field(&format!("mass_{band}")),
            area_field(&format!("area_{band}")),
        ]
    };
    (0..BAND_COUNT).flat_map(band).collect()
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
        Ok(DataType::Struct(fields()))
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
    match arguments.get(index) {
        Some(ColumnarValue::Scalar(ScalarValue::Utf8(Some(text)))) => Ok(text),
        _ => exec_err!("{NAME}: argument {index} is not one text"),
    }
}

fn sums(weights: &RegionWeights, grid: &Grid, arguments: &[ArrayRef]) -> Result<StructArray> {
    let [values, chunks, seconds] = arguments else {
        return exec_err!("{NAME}: {} arrays", arguments.len());
    };
    let lists = Lists::<Float32Type>::of(NAME, values)?;
    let (chunks, seconds) = (
        chunks.as_primitive::<UInt32Type>(),
        seconds.as_primitive::<Float64Type>(),
    );
    let row = |row: usize| match weights.areas_m2(chunks.value(row)) {
        None => Ok([ChunkSums::default(); BAND_COUNT]),
        Some(areas) => {
            let (values, areas) = same_length(NAME, lists.row(row), areas)?;
            let chunk = chunks.value(row);
            band_sums(grid, chunk, values, areas, seconds.value(row))
                .map_err(|e| DataFusionError::Execution(format!("{NAME}, chunk {chunk}: {e}")))
        }
    };
    let rows: Vec<_> = (0..values.len()).map(row).collect::<Result<_>>()?;
    let mut columns = vec![];
    for band in 0..BAND_COUNT {
        let masses = rows.iter().map(|bands| bands[band].mass_steps);
        columns.push(decimals(masses, MASS_DECIMALS)?);
        let areas = rows.iter().map(|bands| bands[band].area_steps);
        columns.push(decimals(areas, AREA_DECIMALS)?);
    }
    Ok(StructArray::try_new(fields(), columns, None)?)
}
