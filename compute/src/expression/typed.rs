//! What an expression comes to, a truth or a number of some unit, or why it makes no sense: other units are never joined.

use std::collections::BTreeMap;

use datafusion::common::ScalarValue;
use datafusion::logical_expr::expr::{Case, ScalarFunction};
use datafusion::logical_expr::{BinaryExpr, Expr, Operator};

use super::function::{ALL, Function};
use super::unit::Unit;

/// Of a part of an expression.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Typed {
    /// A number in a cell.
    Number(Unit),
    /// Zero, which is the same in any unit.
    Zero,
    /// Yes or no.
    Truth,
}

impl Typed {
    /// The unit of a number.
    fn unit(self, what: &str) -> Result<Unit, String> {
        match self {
            Self::Number(unit) => Ok(unit),
            Self::Zero => Ok(Unit::ONE),
            Self::Truth => Err(format!("{what} is a comparison where a number is wanted")),
        }
    }

    /// The unit of two that are added, compared or chosen between.
    fn alike(self, other: Self, what: impl Fn() -> String) -> Result<Self, String> {
        match (self, other) {
            (Self::Truth, _) | (_, Self::Truth) => {
                Err(format!("{}: a comparison is no number", what()))
            }
            (Self::Zero, other) => Ok(other),
            (own, Self::Zero) => Ok(own),
            (Self::Number(own), Self::Number(other)) if own == other => Ok(self),
            (Self::Number(own), Self::Number(other)) => Err(format!(
                "{}: one is in {own}, the other in {other}; a number with a unit is written unit(0.17, 'K')",
                what()
            )),
        }
    }
}

/// Units of the columns by name.
pub(super) type Units = BTreeMap<String, Unit>;

/// What an expression comes to. Numbers in it are of `f64` already, and `unit(...)` is resolved to one with its unit in
/// `literals`, by their place in the order of reading.
pub(super) fn typed(expr: &Expr, units: &Units) -> Result<Typed, String> {
    match expr {
        Expr::Column(column) => units
            .get(&column.name)
            .map(|unit| Typed::Number(*unit))
            .ok_or_else(|| format!("{:?} is not an input", column.name)),
        Expr::Literal(ScalarValue::Float64(Some(value)), metadata) => Ok(match metadata {
            Some(metadata) => Typed::Number(unit_in(metadata.inner())?),
            None if *value == 0.0 => Typed::Zero,
            None => Typed::Number(Unit::ONE),
        }),
        Expr::BinaryExpr(binary) => of_binary(binary, units),
        Expr::Negative(inner) => {
            refuse_offset(inner)?;
            typed(inner, units)?.unit("-").map(Typed::Number)
        }
        Expr::Not(inner) => truth(inner, units),
        Expr::Between(between) => {
            let middle = typed(&between.expr, units)?;
            for edge in [&between.low, &between.high] {
                refuse_offset_beside(edge, &between.expr)?;
                middle.alike(typed(edge, units)?, || format!("{expr}"))?;
            }
            Ok(Typed::Truth)
        }
        Expr::Case(case) => of_case(case, units),
        Expr::ScalarFunction(call) => of_call(call, units),
        other => Err(format!(
            "{other} is not understood here: there are + - * /, comparisons, AND, OR, NOT, BETWEEN, CASE WHEN, and functions"
        )),
    }
}

/// Key of a literal's unit in what is told beside its value.
pub(super) const UNIT_KEY: &str = "unit";

/// Key of a literal as it was written, where its unit counts from elsewhere than zero.
pub(super) const OFFSET_KEY: &str = "offset";

/// A number of degrees Celsius in arithmetic may be a temperature or a difference of two, which lie 273.15 K apart: it is
/// one beside temperatures that it is compared with or chosen from, where a function takes one, and nowhere else.
fn refuse_offset(expr: &Expr) -> Result<(), String> {
    match offset_in(expr) {
        Some(written) => Err(format!(
            "{written} in arithmetic may be a temperature or a difference of two: write it in K, as unit(0.17, 'K') for a difference"
        )),
        None => Ok(()),
    }
}

/// A number of degrees Celsius that an expression may come to, as it was written.
fn offset_in(expr: &Expr) -> Option<&String> {
    match expr {
        Expr::Literal(_, Some(metadata)) => metadata.inner().get(OFFSET_KEY),
        Expr::Negative(inner) => offset_in(inner),
        Expr::Case(case) => {
            let branches = case.when_then_expr.iter().map(|(_, then)| then);
            branches
                .chain(&case.else_expr)
                .find_map(|then| offset_in(then))
        }
        Expr::ScalarFunction(call) if Function::named(call.func.name()).is_none() => {
            call.args.iter().find_map(offset_in)
        }
        _ => None,
    }
}

/// Beside what is taken off from something else such a number may be either, too.
fn refuse_offset_beside(expr: &Expr, other: &Expr) -> Result<(), String> {
    if is_difference(other) {
        refuse_offset(expr)
    } else {
        Ok(())
    }
}

/// Is anything taken off from something else?
fn is_difference(expr: &Expr) -> bool {
    match expr {
        Expr::BinaryExpr(binary) => {
            binary.op == Operator::Minus
                || (binary.op == Operator::Plus
                    && (is_difference(&binary.left) || is_difference(&binary.right)))
        }
        Expr::Negative(inner) => is_difference(inner),
        Expr::Case(case) => {
            let branches = case.when_then_expr.iter().map(|(_, then)| then);
            branches
                .chain(&case.else_expr)
                .any(|then| is_difference(then))
        }
        Expr::ScalarFunction(call) if Function::named(call.func.name()).is_none() => {
            call.args.iter().any(is_difference)
        }
        _ => false,
    }
}

fn unit_in(metadata: &BTreeMap<String, String>) -> Result<Unit, String> {
    let text = metadata.get(UNIT_KEY).map_or("1", String::as_str);
    super::unit::Scaled::parse(text)
        .map(|scaled| scaled.unit)
        .ok_or_else(|| format!("{text:?} is no unit"))
}

fn truth(expr: &Expr, units: &Units) -> Result<Typed, String> {
    match typed(expr, units)? {
        Typed::Truth => Ok(Typed::Truth),
        Typed::Number(_) | Typed::Zero => Err(format!("{expr} is a number, not a comparison")),
    }
}

fn of_binary(binary: &BinaryExpr, units: &Units) -> Result<Typed, String> {
    let whole = || format!("{} {} {}", binary.left, binary.op, binary.right);
    let sides = || Ok::<_, String>((typed(&binary.left, units)?, typed(&binary.right, units)?));
    let too_high = || format!("{}: its unit has too high a power", whole());
    if matches!(
        binary.op,
        Operator::Plus | Operator::Minus | Operator::Multiply | Operator::Divide
    ) {
        refuse_offset(&binary.left)?;
        refuse_offset(&binary.right)?;
    }
    match binary.op {
        Operator::Plus | Operator::Minus => {
            let (left, right) = sides()?;
            left.alike(right, whole)
        }
        Operator::Multiply | Operator::Divide => {
            let (left, right) = sides()?;
            let (left, right) = (left.unit(&whole())?, right.unit(&whole())?);
            let joined = if binary.op == Operator::Multiply {
                left.times(right)
            } else {
                left.over(right)
            };
            joined.map(Typed::Number).ok_or_else(too_high)
        }
        Operator::Lt
        | Operator::LtEq
        | Operator::Gt
        | Operator::GtEq
        | Operator::Eq
        | Operator::NotEq => {
            refuse_offset_beside(&binary.left, &binary.right)?;
            refuse_offset_beside(&binary.right, &binary.left)?;
            let (left, right) = sides()?;
            left.alike(right, whole).map(|_unit| Typed::Truth)
        }
        Operator::And | Operator::Or => {
            truth(&binary.left, units)?;
            truth(&binary.right, units)
        }
        other => Err(format!("the operator {other} is not understood here")),
    }
}

fn of_case(case: &Case, units: &Units) -> Result<Typed, String> {
    if case.expr.is_some() {
        return Err("CASE takes WHEN with a comparison: CASE WHEN a > b THEN".to_owned());
    }
    let mut all = Typed::Zero;
    for (when, then) in &case.when_then_expr {
        truth(when, units)?;
        all = all.alike(typed(then, units)?, || "the branches of CASE".to_owned())?;
    }
    if let Some(otherwise) = &case.else_expr {
        all = all.alike(typed(otherwise, units)?, || {
            "the branches of CASE".to_owned()
        })?;
    }
    Ok(all)
}

fn of_call(call: &ScalarFunction, units: &Units) -> Result<Typed, String> {
    let (name, arguments) = (call.func.name(), &call.args);
    if let Some(function) = Function::named(name) {
        return of_function(function, arguments, units);
    }
    let of = |index: usize| {
        let argument = arguments
            .get(index)
            .ok_or_else(|| format!("{name} lacks an argument"))?;
        typed(argument, units)
    };
    let count = |wanted: usize| {
        if arguments.len() == wanted {
            Ok(())
        } else {
            Err(format!(
                "{name} takes {wanted} arguments, not {}",
                arguments.len()
            ))
        }
    };
    match name {
        "abs" => {
            count(1)?;
            of(0)?.unit(name).map(Typed::Number)
        }
        "sqrt" => {
            count(1)?;
            raised(of(0)?.unit(name)?, 0.5, name)
        }
        "power" => {
            count(2)?;
            let Some(Expr::Literal(ScalarValue::Float64(Some(exponent)), None)) = arguments.get(1)
            else {
                return Err("the second argument of power is a number".to_owned());
            };
            raised(of(0)?.unit(name)?, *exponent, name)
        }
        "exp" | "ln" => {
            count(1)?;
            match of(0)?.unit(name)? {
                Unit::ONE => Ok(Typed::Number(Unit::ONE)),
                other => Err(format!("{name} takes a pure number, not one in {other}")),
            }
        }
        "coalesce" | "greatest" | "least" => {
            let mut all = of(0)?;
            for index in 1..arguments.len() {
                all = all.alike(of(index)?, || format!("the arguments of {name}"))?;
            }
            Ok(all)
        }
        _ => Err(format!(
            "the function {name} is not one of abs, sqrt, power, exp, ln, coalesce, greatest, least, unit, {}",
            ALL.iter().map(|it| it.name).collect::<Vec<_>>().join(", ")
        )),
    }
}

fn raised(unit: Unit, exponent: f64, name: &str) -> Result<Typed, String> {
    unit.to(exponent)
        .map(Typed::Number)
        .ok_or_else(|| format!("{name} of something in {unit} has no whole powers in its unit"))
}

fn of_function(function: &Function, arguments: &[Expr], units: &Units) -> Result<Typed, String> {
    let signature = || function.signature();
    if arguments.len() != function.arguments.len() {
        let given = arguments.len();
        return Err(format!("{given} arguments are given to {}", signature()));
    }
    for (argument, given) in function.arguments.iter().zip(arguments) {
        let is_right = match typed(given, units)? {
            Typed::Number(unit) => unit == argument.unit,
            Typed::Zero => true,
            Typed::Truth => false,
        };
        if !is_right {
            let unit = typed(given, units)?.unit(&given.to_string())?;
            return Err(format!("{given} is in {unit}, but {}", signature()));
        }
    }
    Ok(Typed::Number(function.gives))
}
