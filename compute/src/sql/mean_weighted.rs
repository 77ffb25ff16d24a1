//! `mean_weighted(value, weight)`: the mean of values, each by its weight; rows without a value have no weight either.

use std::sync::Arc;

use datafusion::arrow::array::{Array as _, ArrayRef, AsArray, Float64Array};
use datafusion::arrow::datatypes::{DataType, Field, FieldRef, Float64Type};
use datafusion::common::{Result, ScalarValue, exec_err};
use datafusion::logical_expr::function::{AccumulatorArgs, StateFieldsArgs};
use datafusion::logical_expr::{Accumulator, AggregateUDFImpl, Signature, Volatility};

const NAME: &str = "mean_weighted";

/// Name, signature, what it is, source.
pub(super) const ABOUT: [&str; 4] = [
    NAME,
    "mean_weighted(value, weight)",
    "mean of values by weights of at least 0, such as area_km2; rows without a value have no weight",
    "",
];

#[derive(Debug, PartialEq, Eq, Hash)]
pub(super) struct MeanWeighted {
    signature: Signature,
}

impl MeanWeighted {
    pub(super) fn new() -> Self {
        let numbers = vec![DataType::Float64, DataType::Float64];
        Self {
            signature: Signature::exact(numbers, Volatility::Immutable),
        }
    }
}

impl AggregateUDFImpl for MeanWeighted {
    fn name(&self) -> &'static str {
        NAME
    }

    fn signature(&self) -> &Signature {
        &self.signature
    }

    fn return_type(&self, _arguments: &[DataType]) -> Result<DataType> {
        Ok(DataType::Float64)
    }

    fn state_fields(&self, args: StateFieldsArgs<'_>) -> Result<Vec<FieldRef>> {
        let parts = ["sum", "sum_rest", "weight", "weight_rest"];
        let field = |part| {
            let name = format!("{}[{part}]", args.name);
            Arc::new(Field::new(name, DataType::Float64, false))
        };
        Ok(parts.map(field).to_vec())
    }

    fn accumulator(&self, _args: AccumulatorArgs<'_>) -> Result<Box<dyn Accumulator>> {
        Ok(Box::new(Sums::default()))
    }
}

/// A sum whose lost digits are kept beside it: right to the last digit but one, however many numbers it has.
///
/// Source: Neumaier (1974), doi:10.1002/zamm.19740540106.
#[derive(Debug, Default, Clone, Copy)]
struct Sum {
    sum: f64,
    rest: f64,
}

impl Sum {
    fn add(&mut self, number: f64) {
        let sum = self.sum + number;
        self.rest += if self.sum.abs() >= number.abs() {
            (self.sum - sum) + number
        } else {
            (number - sum) + self.sum
        };
        self.sum = sum;
    }

    fn total(self) -> f64 {
        self.sum + self.rest
    }
}

#[derive(Debug, Default)]
struct Sums {
    values: Sum,
    weights: Sum,
}

impl Accumulator for Sums {
    fn update_batch(&mut self, arguments: &[ArrayRef]) -> Result<()> {
        let [values, weights] = [0, 1].map(|at| arguments[at].as_primitive::<Float64Type>());
        for row in 0..values.len() {
            if values.is_null(row) || weights.is_null(row) {
                continue;
            }
            let (value, weight) = (values.value(row), weights.value(row));
            if weight.is_nan() || weight < 0.0 {
                return exec_err!("{NAME}: {weight} is no weight, which is at least 0");
            }
            self.values.add(value * weight);
            self.weights.add(weight);
        }
        Ok(())
    }

    fn merge_batch(&mut self, states: &[ArrayRef]) -> Result<()> {
        let parts: Vec<&Float64Array> = states
            .iter()
            .map(AsArray::as_primitive::<Float64Type>)
            .collect();
        for row in 0..parts[0].len() {
            self.values.add(parts[0].value(row));
            self.values.rest += parts[1].value(row);
            self.weights.add(parts[2].value(row));
            self.weights.rest += parts[3].value(row);
        }
        Ok(())
    }

    fn state(&mut self) -> Result<Vec<ScalarValue>> {
        let parts = [
            self.values.sum,
            self.values.rest,
            self.weights.sum,
            self.weights.rest,
        ];
        Ok(parts.map(|part| ScalarValue::Float64(Some(part))).to_vec())
    }

    fn evaluate(&mut self) -> Result<ScalarValue> {
        let weight = self.weights.total();
        let mean = (weight > 0.0).then(|| self.values.total() / weight);
        Ok(ScalarValue::Float64(mean))
    }

    fn size(&self) -> usize {
        size_of_val(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mean(rows: &[(Option<f64>, f64)]) -> Option<f64> {
        let values: Float64Array = rows.iter().map(|(value, _)| *value).collect();
        let weights = Float64Array::from_iter_values(rows.iter().map(|(_, weight)| *weight));
        let mut sums = Sums::default();
        sums.update_batch(&[Arc::new(values), Arc::new(weights)])
            .unwrap();
        match sums.evaluate().unwrap() {
            ScalarValue::Float64(mean) => mean,
            other => panic!("{other}"),
        }
    }

    #[test]
    fn a_row_without_a_value_has_no_weight_and_small_numbers_are_not_lost() {
        assert_eq!(
            mean(&[(Some(2.0), 1.0), (None, 5.0), (Some(4.0), 3.0)]),
            Some(3.5)
        );
        assert_eq!(mean(&[(None, 5.0)]), None);
        assert_eq!(mean(&[(Some(1.0), 0.0)]), None);
        let many = [
            (Some(1e16), 1.0),
            (Some(1.0), 1.0),
            (Some(1.0), 1.0),
            (Some(-1e16), 1.0),
        ];
        assert_eq!(mean(&many), Some(0.5));
    }
}
