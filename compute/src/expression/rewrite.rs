//! A parsed expression made ready: numbers are `f64`, `unit(...)` is the number that it stands for, `coalesce` is a CASE, what is
//! no number compares with nothing, and calls of our functions count where they leave the range of their paper.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::AtomicU64;

use datafusion::common::metadata::FieldMetadata;
use datafusion::common::tree_node::{Transformed, TreeNode as _, TreeNodeRecursion};
use datafusion::common::{DataFusionError, Result, ScalarValue, plan_err};
use datafusion::logical_expr::expr::{Case, ScalarFunction};
use datafusion::logical_expr::{Between, BinaryExpr, Expr, Operator, ScalarUDF, lit};

use super::function::Function;
use super::typed::{OFFSET_KEY, UNIT_KEY};
use super::udf::{ComparedFunction, NumberFunction};
use super::unit::Scaled;

/// Numbers as `f64`, so that `1/2` is a half; and those with a unit in SI, their unit beside them.
pub(super) fn numbers(expr: Expr) -> Result<Expr> {
    let number = |expr: Expr| {
        Ok(match expr {
            Expr::Literal(value, None) => Transformed::yes(Expr::Literal(as_f64(value)?, None)),
            Expr::ScalarFunction(call) if call.func.name() == "unit" => {
                Transformed::yes(with_unit(&call.args)?)
            }
            Expr::Negative(inner) => match *inner {
                Expr::Literal(ScalarValue::Float64(Some(value)), metadata)
                    if !counts_from_elsewhere(metadata.as_ref()) =>
                {
                    Transformed::yes(Expr::Literal(ScalarValue::from(-value), metadata))
                }
                inner => Transformed::no(Expr::Negative(Box::new(inner))),
            },
            other => Transformed::no(other),
        })
    };
    expr.transform_up(number).map(|done| done.data)
}

/// Is a number's unit one whose zero is no zero, so that its negative is none of the number that was written?
pub(super) fn counts_from_elsewhere(metadata: Option<&FieldMetadata>) -> bool {
    metadata.is_some_and(|metadata| metadata.inner().contains_key(OFFSET_KEY))
}

fn as_f64(value: ScalarValue) -> Result<ScalarValue> {
    Ok(match value {
        ScalarValue::Int64(Some(value)) => ScalarValue::from(value as f64),
        ScalarValue::UInt64(Some(value)) => ScalarValue::from(value as f64),
        // Of unit(...), which its call takes away.
        text @ (ScalarValue::Utf8(_) | ScalarValue::Float64(Some(_))) => text,
        other => return plan_err!("{other} is no number"),
    })
}

fn with_unit(arguments: &[Expr]) -> Result<Expr> {
    let (
        Some(Expr::Literal(ScalarValue::Float64(Some(value)), None)),
        Some(Expr::Literal(ScalarValue::Utf8(Some(unit)), None)),
        2,
    ) = (arguments.first(), arguments.get(1), arguments.len())
    else {
        return plan_err!("unit takes a number and a unit: unit(0.17, 'K')");
    };
    let Some(scaled) = Scaled::parse(unit) else {
        return plan_err!(
            "{unit:?} is no unit that is known here; symbols stand with blanks between and their powers behind, as in \
             unit(1, 'm s-1'), unit(20, 'mol m-2 year-1') or unit(5, 'hPa')"
        );
    };
    let mut metadata = BTreeMap::from([(UNIT_KEY.to_owned(), scaled.unit.to_string())]);
    if scaled.offset != 0.0 {
        metadata.insert(OFFSET_KEY.to_owned(), format!("unit({value}, '{unit}')"));
    }
    let si = value * scaled.factor + scaled.offset;
    Ok(Expr::Literal(
        ScalarValue::from(si),
        Some(FieldMetadata::from(metadata)),
    ))
}

/// How often each function was called outside the range of its paper.
pub(super) type Outside = BTreeMap<&'static str, Arc<AtomicU64>>;

/// Calls that count, comparisons of numbers alone, and CASE for `coalesce`, which the engine evaluates in this shape alone.
pub(super) fn runnable(expr: Expr, outside: &mut Outside) -> Result<Expr> {
    let compared = Arc::new(ScalarUDF::from(ComparedFunction::new()));
    let run = |expr: Expr| {
        Ok(match expr {
            Expr::Literal(value, Some(_)) => Transformed::yes(Expr::Literal(value, None)),
            Expr::ScalarFunction(call) if call.func.name() == "coalesce" => {
                Transformed::yes(first_there(call.args)?)
            }
            // The engine's root of a negative number ends the query; its power is no number, which is counted in its cell.
            Expr::ScalarFunction(call) if call.func.name() == "sqrt" => {
                let args = call.args.into_iter().chain([lit(0.5)]).collect();
                let func = datafusion::functions::math::power();
                Transformed::yes(Expr::ScalarFunction(ScalarFunction { func, args }))
            }
            Expr::ScalarFunction(call) if call.func.name() == "power" => of_no_zero(call),
            Expr::ScalarFunction(call) => match Function::named(call.func.name()) {
                Some(function) => {
                    let counter = outside.entry(function.name).or_default();
                    let counting = NumberFunction::counting(function, Arc::clone(counter));
                    let func = Arc::new(ScalarUDF::from(counting));
                    let args = call.args;
                    Transformed::yes(Expr::ScalarFunction(ScalarFunction { func, args }))
                }
                None => Transformed::no(Expr::ScalarFunction(call)),
            },
            Expr::BinaryExpr(both) if is_comparison(both.op) => {
                let [left, right] = [*both.left, *both.right]
                    .map(|side| Box::new(number_or_nothing(side, &compared)));
                Transformed::yes(Expr::BinaryExpr(BinaryExpr::new(left, both.op, right)))
            }
            Expr::Between(Between {
                expr,
                negated,
                low,
                high,
            }) => {
                let [expr, low, high] =
                    [*expr, *low, *high].map(|part| Box::new(number_or_nothing(part, &compared)));
                Transformed::yes(Expr::Between(Between::new(expr, negated, low, high)))
            }
            other => Transformed::no(other),
        })
    };
    expr.transform_up(run).map(|done| done.data)
}

/// A power below zero as one over that above: the engine's of 0 ends the query, and one over 0 is no number, which is counted in its cell.
fn of_no_zero(power: ScalarFunction) -> Transformed<Expr> {
    let inverse = match power.args.as_slice() {
        [base, Expr::Literal(ScalarValue::Float64(Some(exponent)), _)] if *exponent < 0.0 => {
            vec![base.clone(), lit(-*exponent)]
        }
        _ => return Transformed::no(Expr::ScalarFunction(power)),
    };
    let power = Expr::ScalarFunction(ScalarFunction {
        func: power.func,
        args: inverse,
    });
    let (one, power) = (Box::new(lit(1.0)), Box::new(power));
    Transformed::yes(Expr::BinaryExpr(BinaryExpr::new(
        one,
        Operator::Divide,
        power,
    )))
}

fn is_comparison(operator: Operator) -> bool {
    matches!(
        operator,
        Operator::Lt
            | Operator::LtEq
            | Operator::Gt
            | Operator::GtEq
            | Operator::Eq
            | Operator::NotEq
    )
}

/// What is compared, as [`ComparedFunction`] has it; inputs and numbers that are written are numbers, or nothing, as they are.
fn number_or_nothing(expr: Expr, compared: &Arc<ScalarUDF>) -> Expr {
    if matches!(expr, Expr::Column(_) | Expr::Literal(..)) {
        return expr;
    }
    let (func, args) = (Arc::clone(compared), vec![expr]);
    Expr::ScalarFunction(ScalarFunction { func, args })
}

fn first_there(mut arguments: Vec<Expr>) -> Result<Expr> {
    let last = arguments
        .pop()
        .ok_or_else(|| DataFusionError::Plan("coalesce lacks arguments".to_owned()))?;
    let when = |argument: Expr| {
        let is_there = Expr::IsNotNull(Box::new(argument.clone()));
        (Box::new(is_there), Box::new(argument))
    };
    let whens: Vec<_> = arguments.into_iter().map(when).collect();
    if whens.is_empty() {
        return Ok(last);
    }
    Ok(Expr::Case(Case::new(None, whens, Some(Box::new(last)))))
}

/// Columns that must hold data for a cell to have a result: all but those that stand in `coalesce` alone.
pub(super) fn required(expr: &Expr) -> Result<std::collections::BTreeSet<String>> {
    let mut found = std::collections::BTreeSet::new();
    expr.apply(|expr| {
        match expr {
            Expr::Column(column) => {
                found.insert(column.name.clone());
            }
            Expr::ScalarFunction(call) if call.func.name() == "coalesce" => {
                for argument in &call.args {
                    if !matches!(argument, Expr::Column(_)) {
                        found.extend(required(argument)?);
                    }
                }
                return Ok(TreeNodeRecursion::Jump);
            }
            _ => {}
        }
        Ok(TreeNodeRecursion::Continue)
    })?;
    Ok(found)
}

/// Columns whose values the result is computed with: all but those that are compared alone.
pub(super) fn computed_with(expr: &Expr) -> Result<std::collections::BTreeSet<String>> {
    let mut found = std::collections::BTreeSet::new();
    expr.apply(|expr| {
        match expr {
            Expr::Column(column) => {
                found.insert(column.name.clone());
            }
            Expr::Case(case) => {
                let branches = case.when_then_expr.iter().map(|(_, then)| then);
                for then in branches.chain(&case.else_expr) {
                    found.extend(computed_with(then)?);
                }
                return Ok(TreeNodeRecursion::Jump);
            }
            _ => {}
        }
        Ok(TreeNodeRecursion::Continue)
    })?;
    Ok(found)
}
