//! Sums, differences, products and opposites of whole numbers that a question computes: as the engine has them in, which goes on from the other end where a number
//! leaves its type; as functions that refuse that out.

use std::sync::Arc;

use datafusion::arrow::array::{ArrayRef, Datum};
use datafusion::arrow::compute::kernels::numeric::{add, mul, sub};
use datafusion::arrow::datatypes::{DataType, Field, FieldRef};
use datafusion::arrow::error::ArrowError;
use datafusion::common::config::ConfigOptions;
use datafusion::common::tree_node::Transformed;
use datafusion::common::{DFSchema, Result, ScalarValue, internal_err};
use datafusion::error::DataFusionError;
use datafusion::logical_expr::expr::ScalarFunction;
use datafusion::logical_expr::expr_rewriter::FunctionRewrite;
use datafusion::logical_expr::{
    BinaryExpr, ColumnarValue, Expr, ExprSchemable as _, Operator, ReturnFieldArgs,
    ScalarFunctionArgs, ScalarUDF, ScalarUDFImpl, Signature, Volatility,
};
use datafusion::optimizer::AnalyzerRule;
use datafusion::optimizer::analyzer::function_rewrite::ApplyFunctionRewrites;
use datafusion::physical_expr_common::datum::apply;

/// The rule that puts checked functions in the place of operators, once both sides have one type.
pub(super) fn rule() -> Arc<dyn AnalyzerRule + Send + Sync> {
    Arc::new(ApplyFunctionRewrites::new(vec![Arc::new(Checked)]))
}

#[derive(Debug)]
struct Checked;

impl FunctionRewrite for Checked {
    fn name(&self) -> &'static str {
        "checked"
    }

    fn rewrite(
        &self,
        expr: Expr,
        schema: &DFSchema,
        _settings: &ConfigOptions,
    ) -> Result<Transformed<Expr>> {
        let (left, op, right) = match expr {
            Expr::BinaryExpr(BinaryExpr { left, op, right }) => (left, op, right),
            Expr::Negative(number) if is_whole(&number, schema) => {
                let zero = ScalarValue::new_zero(&number.get_type(schema)?)?;
                let function = ScalarUDF::from(WholeNumbers::opposite());
                let call = function.call(vec![Expr::Literal(zero, None), *number]);
                return Ok(Transformed::yes(call));
            }
            other => return Ok(Transformed::no(other)),
        };
        let is_checked = matches!(op, Operator::Plus | Operator::Minus | Operator::Multiply);
        if !(is_checked && is_whole(&left, schema) && is_whole(&right, schema)) {
            let expr = BinaryExpr { left, op, right };
            return Ok(Transformed::no(Expr::BinaryExpr(expr)));
        }
        let (mut ops, mut numbers) = match *left {
            Expr::ScalarFunction(call) if chained(&call).is_some_and(|own| !own.is_opposite) => {
                let ops = chained(&call).map_or_else(Vec::new, |own| own.ops.clone());
                (ops, call.args)
            }
            other => (vec![], vec![other]),
        };
        ops.push(op);
        numbers.push(*right);
        let function = ScalarUDF::from(WholeNumbers::new(ops));
        Ok(Transformed::yes(function.call(numbers)))
    }
}

/// Is an expression a whole number? A chain of them is, whatever it is made of, and is not looked through at every link.
fn is_whole(expr: &Expr, schema: &DFSchema) -> bool {
    match expr {
        Expr::ScalarFunction(call) if chained(call).is_some() => true,
        other => other.get_type(schema).is_ok_and(|kind| kind.is_integer()),
    }
}

/// A call as one of [`WholeNumbers`].
fn chained(call: &ScalarFunction) -> Option<&WholeNumbers> {
    call.func.inner().downcast_ref::<WholeNumbers>()
}

/// Operators between whole numbers of one type, from the left to the right: a chain is one call, however long it is, and not a call in each other. Nobody can
/// call it by its name.
#[derive(Debug, PartialEq, Eq, Hash)]
struct WholeNumbers {
    /// One less than numbers.
    ops: Vec<Operator>,
    /// Is it a number with the sign turned: 0 less that?
    is_opposite: bool,
    signature: Signature,
}

impl WholeNumbers {
    fn new(ops: Vec<Operator>) -> Self {
        Self {
            signature: Signature::any(ops.len() + 1, Volatility::Immutable),
            ops,
            is_opposite: false,
        }
    }

    fn opposite() -> Self {
        Self {
            is_opposite: true,
            ..Self::new(vec![Operator::Minus])
        }
    }
}

impl ScalarUDFImpl for WholeNumbers {
    fn name(&self) -> &'static str {
        "whole_numbers"
    }

    /// What a column of the operators is called.
    fn schema_name(&self, numbers: &[Expr]) -> Result<String> {
        if let (true, [_zero, number]) = (self.is_opposite, numbers) {
            return Ok(format!("(- {})", number.schema_name()));
        }
        let names = numbers.iter().map(|own| own.schema_name().to_string());
        let ops = self.ops.iter().map(|op| format!(" {op} "));
        let parts = std::iter::once(String::new()).chain(ops).zip(names);
        Ok(parts.flat_map(|(op, name)| [op, name]).collect())
    }

    fn signature(&self) -> &Signature {
        &self.signature
    }

    fn return_type(&self, numbers: &[DataType]) -> Result<DataType> {
        let Some(kind) = numbers.first() else {
            return internal_err!("no whole numbers");
        };
        Ok(kind.clone())
    }

    fn return_field_from_args(&self, args: ReturnFieldArgs<'_>) -> Result<FieldRef> {
        let Some(first) = args.arg_fields.first() else {
            return internal_err!("no whole numbers");
        };
        // As that of the operators.
        let nullable = args.arg_fields.iter().any(|field| field.is_nullable());
        let field = Field::new(self.name(), first.data_type().clone(), nullable);
        Ok(Arc::new(field))
    }

    fn invoke_with_args(&self, args: ScalarFunctionArgs) -> Result<ColumnarValue> {
        let mut numbers = args.args.into_iter();
        let Some(mut found) = numbers.next() else {
            return internal_err!("no whole numbers");
        };
        for (op, number) in self.ops.iter().zip(numbers) {
            let kernel: fn(&dyn Datum, &dyn Datum) -> Result<ArrayRef, ArrowError> = match op {
                Operator::Plus => add,
                Operator::Minus => sub,
                _ => mul,
            };
            let kind = found.data_type();
            found = apply(&found, &number, kernel).map_err(|error| beyond(error, &kind))?;
        }
        Ok(found)
    }
}

/// A number that its type does not hold, in words.
fn beyond(error: DataFusionError, kind: &DataType) -> DataFusionError {
    match error.find_root() {
        DataFusionError::ArrowError(inner, _) => match &**inner {
            ArrowError::ArithmeticOverflow(what) => DataFusionError::Execution(format!(
                "whole numbers of the type {kind} do not hold what comes of this ({what}): CAST one side AS BIGINT, which holds less than 9.2e18 on either side \
                 of 0, or AS DOUBLE"
            )),
            _ => error,
        },
        _ => error,
    }
}
