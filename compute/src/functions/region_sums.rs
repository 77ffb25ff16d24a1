//! `region_sums(values, chunk, seconds, weights)`: mass and valid area of a region's share of a chunk, exact, as a
//! structure of two decimals, and whether the region touches the chunk (1 or 0).
//!
//! `weights` is the address of the region's stored weights. They are read once a process and never pass a plan: nothing
//! is joined, and of the values nothing but sums leaves the part of a query that read them.

use std::sync::Arc;

use async_trait::async_trait;
use datafusion::arrow::array::{
    Array as _, ArrayRef, AsArray as _, Decimal128Array, Int64Array, StructArray,
};
use datafusion::arrow::datatypes::{DataType, Field, Fields, Float32Type, Float64Type, UInt32Type};
use datafusion::common::{DataFusionError, Result, ScalarValue, exec_err};
use datafusion::logical_expr::async_udf::AsyncScalarUDFImpl;
use datafusion::logical_expr::{
    ColumnarValue, ScalarFunctionArgs, ScalarUDFImpl, Signature, Volatility,
};

use super::lists::{Argument, Lists, check_types, same_length};
use crate::budget::chunk::{ChunkSums, chunk_sums};
use crate::budget::fixed::{AREA_DECIMALS, MASS_DECIMALS};
use crate::objects::Objects;
use crate::region::loaded::RegionWeights;

const NAME: &str = "region_sums";
/// Digits of the decimals: the most that 128 bits hold.
const DIGITS: u8 = 38;

#[derive(Debug, PartialEq, Eq, Hash)]
pub(super) struct RegionSums {
    signature: Signature,
    objects: Objects,
}

impl RegionSums {
    pub(super) fn new(objects: Objects) -> Self {
        Self {
            signature: Signature::any(4, Volatility::Immutable),
            objects,
        }
    }
}

/// Mass in kg and area in m²; the mass of a product that is no flux is its value x area.
fn fields() -> Fields {
    let decimal = |decimals: u32| DataType::Decimal128(DIGITS, decimals as i8);
    Fields::from(vec![
        Field::new("mass", decimal(MASS_DECIMALS), false),
        Field::new("area", decimal(AREA_DECIMALS), false),
        Field::new("chunks", DataType::Int64, false),
    ])
}

impl ScalarUDFImpl for RegionSums {
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
        ];
        check_types(NAME, arguments, &expected)?;
        Ok(DataType::Struct(fields()))
    }

    fn invoke_with_args(&self, _args: ScalarFunctionArgs) -> Result<ColumnarValue> {
        exec_err!("{NAME} reads weights and is called asynchronously only")
    }
}

#[async_trait]
impl AsyncScalarUDFImpl for RegionSums {
    async fn invoke_async_with_args(&self, args: ScalarFunctionArgs) -> Result<ColumnarValue> {
        let Some(ColumnarValue::Scalar(ScalarValue::Utf8(Some(address)))) = args.args.get(3) else {
            return exec_err!("{NAME}: the address of the weights is not one text");
        };
        let weights = self.objects.weights(address).await?;
        let arrays = ColumnarValue::values_to_arrays(&args.args[..3])?;
        let [values, chunks, seconds] = &arrays[..] else {
            return exec_err!("{NAME}: {} arguments", args.args.len());
        };
        let sums = sums(&weights, values, chunks, seconds)?;
        Ok(ColumnarValue::Array(Arc::new(sums)))
    }
}

fn sums(
    weights: &RegionWeights,
    values: &ArrayRef,
    chunks: &ArrayRef,
    seconds: &ArrayRef,
) -> Result<StructArray> {
    let lists = Lists::<Float32Type>::of(NAME, values)?;
    let (chunks, seconds) = (
        chunks.as_primitive::<UInt32Type>(),
        seconds.as_primitive::<Float64Type>(),
    );
    let row = |row: usize| match weights.areas_m2(chunks.value(row)) {
        // A predicate on runs of chunks lets some through that lie between those of the region.
        None => Ok(ChunkSums::default()),
        Some(areas) => {
            let (values, areas) = same_length(NAME, lists.row(row), areas)?;
            chunk_sums(values, areas, seconds.value(row)).map_err(|e| {
                DataFusionError::Execution(format!("{NAME}, chunk {}: {e}", chunks.value(row)))
            })
        }
    };
    let rows: Vec<ChunkSums> = (0..values.len()).map(row).collect::<Result<_>>()?;
    let masses = rows.iter().map(|sums| sums.mass_steps);
    let areas = rows.iter().map(|sums| sums.area_steps);
    let is_touched = |chunk: &u32| i64::from(weights.areas_m2(*chunk).is_some());
    let touched = Int64Array::from_iter_values(chunks.values().iter().map(is_touched));
    let columns = vec![
        decimals(masses, MASS_DECIMALS)?,
        decimals(areas, AREA_DECIMALS)?,
        Arc::new(touched),
    ];
    Ok(StructArray::try_new(fields(), columns, None)?)
}

/// A column of decimals from integers of `decimals` decimals.
fn decimals(values: impl Iterator<Item = i128>, decimals: u32) -> Result<ArrayRef> {
    let array = Decimal128Array::from_iter_values(values);
    Ok(Arc::new(
        array.with_precision_and_scale(DIGITS, decimals as i8)?,
    ))
}
