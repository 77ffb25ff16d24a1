//! The functions of numbers as functions of SQL: columns of `f64` in, one out, null where an argument is.

use std::hash::{Hash, Hasher};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use datafusion::arrow::array::{Array as _, AsArray, Float64Array};
use datafusion::arrow::datatypes::{DataType, Float64Type};
use datafusion::common::{Result, exec_err};
use datafusion::logical_expr::{
    ColumnarValue, ScalarFunctionArgs, ScalarUDF, ScalarUDFImpl, Signature, Volatility,
};

use super::function::{ALL, Function};

/// One of [`ALL`].
#[derive(Debug)]
pub(crate) struct NumberFunction {
    function: &'static Function,
    signature: Signature,
    /// Calls outside the range of its paper.
    outside: Option<Arc<AtomicU64>>,
}

impl NumberFunction {
    fn new(function: &'static Function, outside: Option<Arc<AtomicU64>>) -> Self {
        let types = vec![DataType::Float64; function.arguments.len()];
        let signature = if types.is_empty() {
            Signature::nullary(Volatility::Immutable)
        } else {
            Signature::exact(types, Volatility::Immutable)
        };
        Self {
            function,
            signature,
            outside,
        }
    }

    /// One that counts its calls outside the range of its paper.
    pub(super) fn counting(function: &'static Function, outside: Arc<AtomicU64>) -> Self {
        Self::new(function, Some(outside))
    }
}

impl PartialEq for NumberFunction {
    fn eq(&self, other: &Self) -> bool {
        self.function.name == other.function.name
    }
}

impl Eq for NumberFunction {}

impl Hash for NumberFunction {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.function.name.hash(state);
    }
}

impl ScalarUDFImpl for NumberFunction {
    fn name(&self) -> &str {
        self.function.name
    }

    fn signature(&self) -> &Signature {
        &self.signature
    }

    fn return_type(&self, _arguments: &[DataType]) -> Result<DataType> {
        Ok(DataType::Float64)
    }

    fn invoke_with_args(&self, args: ScalarFunctionArgs) -> Result<ColumnarValue> {
        let rows = args.number_rows;
        let mut columns = vec![];
        for argument in args.args {
            columns.push(argument.into_array(rows)?);
        }
        if columns
            .iter()
            .any(|it| *it.data_type() != DataType::Float64)
        {
            return exec_err!("{} takes numbers of 64 bits", self.function.name);
        }
        let columns: Vec<&Float64Array> = columns
            .iter()
            .map(AsArray::as_primitive::<Float64Type>)
            .collect();
        let (mut values, mut outside) = (vec![0.0; columns.len()], 0);
        let mut of_row = |row: usize| {
            if columns.iter().any(|column| column.is_null(row)) {
                return None;
            }
            for (value, column) in values.iter_mut().zip(&columns) {
                *value = column.value(row);
            }
            outside += u64::from(!self.function.holds_for(&values));
            Some((self.function.evaluate)(&values))
        };
        let out: Float64Array = (0..rows).map(&mut of_row).collect();
        if let Some(counter) = &self.outside {
            counter.fetch_add(outside, Ordering::Relaxed);
        }
        Ok(ColumnarValue::Array(Arc::new(out)))
    }
}

/// `unit(0.17, 'K')`: a number of some unit. Expressions resolve it as they are read; it is never called.
#[derive(Debug, PartialEq, Eq, Hash)]
pub(super) struct UnitFunction {
    signature: Signature,
}

impl UnitFunction {
    pub(super) fn new() -> Self {
        Self {
            signature: Signature::any(2, Volatility::Immutable),
        }
    }
}

impl ScalarUDFImpl for UnitFunction {
    fn name(&self) -> &'static str {
        "unit"
    }

    fn signature(&self) -> &Signature {
        &self.signature
    }

    fn return_type(&self, _arguments: &[DataType]) -> Result<DataType> {
        Ok(DataType::Float64)
    }

    fn invoke_with_args(&self, _args: ScalarFunctionArgs) -> Result<ColumnarValue> {
        exec_err!("unit belongs in expressions of products")
    }
}

/// What is compared: a number, and nothing where it is none, so that no comparison with it is true. By their bits numbers that are none
/// lie below or above all others, and 0 / 0 is either by the machine. Expressions put it about what they compare; it cannot be written.
#[derive(Debug, PartialEq, Eq, Hash)]
pub(super) struct ComparedFunction {
    signature: Signature,
}

impl ComparedFunction {
    pub(super) fn new() -> Self {
        Self {
            signature: Signature::exact(vec![DataType::Float64], Volatility::Immutable),
        }
    }
}

impl ScalarUDFImpl for ComparedFunction {
    fn name(&self) -> &'static str {
        "compared"
    }

    fn signature(&self) -> &Signature {
        &self.signature
    }

    fn return_type(&self, _arguments: &[DataType]) -> Result<DataType> {
        Ok(DataType::Float64)
    }

    fn invoke_with_args(&self, args: ScalarFunctionArgs) -> Result<ColumnarValue> {
        let rows = args.number_rows;
        let Some(argument) = args.args.into_iter().next() else {
            return exec_err!("nothing is compared");
        };
        let column = argument.into_array(rows)?;
        let Some(column) = column.as_primitive_opt::<Float64Type>() else {
            return exec_err!("numbers of 64 bits are compared");
        };
        let number = |value: Option<f64>| value.filter(|it| !it.is_nan());
        let out: Float64Array = column.iter().map(number).collect();
        Ok(ColumnarValue::Array(Arc::new(out)))
    }
}

/// All of them, for a session.
pub(crate) fn number_functions() -> impl Iterator<Item = ScalarUDF> {
    ALL.iter()
        .map(|function| ScalarUDF::from(NumberFunction::new(function, None)))
}
