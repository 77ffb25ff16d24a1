//! `sound("values", check, ...)`: the values of a row, if its check says that they and what says which row it is are
//! those that were stored; else an error.
//!
//! Every table of stored objects passes its values through this ([`crate::scan`]), so that no query can leave it out.

use datafusion::arrow::array::{Array as _, ArrayRef, AsArray as _, PrimitiveArray};
use datafusion::arrow::datatypes::{
    DataType, Float32Type, Float64Type, TimeUnit, TimestampMillisecondType, UInt32Type,
};
use datafusion::common::{Result, exec_err, plan_err};
use datafusion::logical_expr::{
    ColumnarValue, ScalarFunctionArgs, ScalarUDFImpl, Signature, Volatility,
};
use storage::row_check::RowCheck;

use super::lists::Lists;

const NAME: &str = "sound";
/// Of the values and the check.
const FIRST_KEY: usize = 2;

#[derive(Debug, PartialEq, Eq, Hash)]
pub(super) struct Sound {
    signature: Signature,
}

impl Sound {
    pub(super) fn new() -> Self {
        Self {
            signature: Signature::variadic_any(Volatility::Immutable),
        }
    }
}

impl ScalarUDFImpl for Sound {
    fn name(&self) -> &'static str {
        NAME
    }

    fn signature(&self) -> &Signature {
        &self.signature
    }

    fn return_type(&self, arguments: &[DataType]) -> Result<DataType> {
        let is_values = |it: &DataType| match it {
            DataType::List(item) => {
                matches!(item.data_type(), DataType::Float32 | DataType::Float64)
            }
            _ => false,
        };
        let is_key = |it: &DataType| {
            matches!(
                it,
                DataType::UInt32 | DataType::Timestamp(TimeUnit::Millisecond, _)
            )
        };
        match arguments {
            [values, DataType::UInt32, keys @ ..]
                if is_values(values) && keys.iter().all(is_key) =>
            {
                Ok(values.clone())
            }
            other => {
                plan_err!("{NAME} takes a list, its check and what was checked, not {other:?}")
            }
        }
    }

    fn invoke_with_args(&self, args: ScalarFunctionArgs) -> Result<ColumnarValue> {
        let arrays = ColumnarValue::values_to_arrays(&args.args)?;
        let values = &arrays[0];
        let is_wide = matches!(values.data_type(), DataType::List(item) if *item.data_type() == DataType::Float64);
        if is_wide {
            let lists = Lists::<Float64Type>::of(NAME, values)?;
            check_rows(&arrays, |row, check| check.f64s(lists.row(row)))?;
        } else {
            let lists = Lists::<Float32Type>::of(NAME, values)?;
            check_rows(&arrays, |row, check| check.f32s(lists.row(row)))?;
        }
        Ok(ColumnarValue::Array(ArrayRef::clone(values)))
    }
}

/// Compares each row with its check; `add` adds the values of a row.
fn check_rows(arrays: &[ArrayRef], add: impl Fn(usize, RowCheck) -> RowCheck) -> Result<()> {
    let told: &PrimitiveArray<UInt32Type> = arrays[1].as_primitive();
    let keys = &arrays[FIRST_KEY..];
    for row in 0..arrays[0].len() {
        let is_told = arrays[1..].iter().all(|column| column.is_valid(row));
        let check = keys.iter().fold(RowCheck::new(), |check, key| {
            match key.as_primitive_opt::<UInt32Type>() {
                Some(numbers) => check.u32(numbers.value(row)),
                None => check.i64(key.as_primitive::<TimestampMillisecondType>().value(row)),
            }
        });
        if !is_told || add(row, check).finish() != told.value(row) {
            return exec_err!("{NAME}: a stored row is damaged: it differs from its check");
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use datafusion::arrow::array::{
        Float32Builder, ListBuilder, TimestampMillisecondArray, UInt32Array,
    };
    use datafusion::arrow::datatypes::Field;
    use datafusion::config::ConfigOptions;
    use std::sync::Arc;

    /// Two rows of chunks 3 and 4 from 5 ms on.
    fn columns() -> Vec<ArrayRef> {
        let mut lists = ListBuilder::new(Float32Builder::new());
        let rows: [&[f32]; 2] = [&[1.0, f32::NAN], &[-0.0, 7.5]];
        let mut checks = vec![];
        for (chunk, row) in [3, 4].into_iter().zip(rows) {
            lists.values().append_slice(row);
            lists.append(true);
            checks.push(RowCheck::new().u32(chunk).i64(5).f32s(row).finish());
        }
        vec![
            Arc::new(lists.finish()),
            Arc::new(UInt32Array::from(checks)),
            Arc::new(UInt32Array::from(vec![3, 4])),
            Arc::new(TimestampMillisecondArray::from(vec![5, 5])),
        ]
    }

    fn invoke(columns: Vec<ArrayRef>) -> Result<ColumnarValue> {
        let field = |column: &ArrayRef| Arc::new(Field::new("a", column.data_type().clone(), true));
        let return_field = field(&columns[0]);
        let number_rows = columns[0].len();
        Sound::new().invoke_with_args(ScalarFunctionArgs {
            arg_fields: columns.iter().map(field).collect(),
            args: columns.into_iter().map(ColumnarValue::Array).collect(),
            number_rows,
            return_field,
            config_options: Arc::new(ConfigOptions::default()),
        })
    }

    #[test]
    fn sound_rows_pass_and_whatever_is_other_in_one_does_not() {
        let whole = columns();
        let ColumnarValue::Array(values) = invoke(whole.clone()).unwrap() else {
            panic!("no array");
        };
        assert_eq!(&values, &whole[0]);
        let others: [ArrayRef; 4] = [
            columns()[0].slice(1, 1),
            Arc::new(UInt32Array::from(vec![0, 0])),
            Arc::new(UInt32Array::from(vec![4, 3])),
            Arc::new(TimestampMillisecondArray::from(vec![5, 6])),
        ];
        for (column, other) in others.into_iter().enumerate() {
            let mut columns = columns();
            if column == 0 {
                for it in &mut columns {
                    *it = it.slice(0, 1);
                }
            }
            columns[column] = other;
            let error = invoke(columns).unwrap_err();
            assert!(error.to_string().contains("damaged"), "{error}");
        }
        let mut none = columns();
        none[1] = Arc::new(UInt32Array::from(vec![None, None]));
        assert!(invoke(none).is_err());
    }
}
