//! How long the expressions of a question become once columns are written out as what they are computed of: its plan in; a refusal out where one
//! would read more columns than is planned in time.
//!
//! The engine brings conditions to where values are read, and writes out what their columns are on the way. Where each query adds a column of the one
//! before to itself, a condition doubles with each, which no limit of memory counts and no limit of time ends. Wherever they stand, it writes
//! `a BETWEEN b AND c` as two comparisons of `a`, and its like, which doubles with each that stands in another.

use datafusion::arrow::datatypes::DataType;
use datafusion::common::DFSchema;
use datafusion::common::tree_node::{TreeNode as _, TreeNodeRecursion};
use datafusion::error::DataFusionError;
use datafusion::logical_expr::{Expr, ExprSchemable as _, LogicalPlan, Operator};

use super::told::told;
use crate::ComputeError;

/// Most columns that an expression may read once it is written out: a condition of 16,000 is planned in half a second, one of a million in longer
/// than 30 s.
const MAX_COLUMNS: f64 = 100_000.0;
/// Lists of so many are written out as comparisons.
const SHORT_LIST: usize = 3;
/// Functions that are written out as cases, which read their arguments twice.
const CASES: [&str; 5] = ["coalesce", "ifnull", "nullif", "nvl", "nvl2"];

/// # Errors
/// `Sql`: an expression would read more than [`MAX_COLUMNS`].
pub(super) fn check(plan: &LogicalPlan) -> Result<(), ComputeError> {
    let most = most_columns(plan).map_err(|error| told(error, None))?;
    if most <= MAX_COLUMNS {
        return Ok(());
    }
    let reason = format!(
        "it computes of what it computes so often that an expression or a condition, written out, reads more than {MAX_COLUMNS} columns: compute in fewer \
         steps, or read each column fewer times"
    );
    Err(ComputeError::Sql { reason })
}

fn most_columns(plan: &LogicalPlan) -> Result<f64, DataFusionError> {
    let mut most = 1.0f64;
    columns(plan, &mut most)?;
    plan.apply_with_subqueries(|node| {
        if let LogicalPlan::Subquery(within) = node {
            columns(&within.subquery, &mut most)?;
        }
        // By itself.
        let inputs = node.inputs();
        let schema = inputs.first().map_or(node.schema(), |input| input.schema());
        node.apply_expressions(|expr| {
            most = most.max(of_expression(expr, schema, &[])?);
            Ok(TreeNodeRecursion::Continue)
        })?;
        Ok(TreeNodeRecursion::Continue)
    })?;
    Ok(most)
}

/// How many columns each column of a node reads, written out; `most` becomes the most of any condition.
fn columns(node: &LogicalPlan, most: &mut f64) -> Result<Vec<f64>, DataFusionError> {
    let mut inputs = vec![];
    for input in node.inputs() {
        inputs.extend(columns(input, most)?);
    }
    let count = node.schema().fields().len();
    let largest = inputs.iter().copied().fold(1.0, f64::max);
    let own = match node {
        LogicalPlan::Projection(own) => {
            let schema = own.input.schema();
            let all = own.expr.iter();
            all.map(|expr| of_expression(expr, schema, &inputs))
                .collect::<Result<Vec<f64>, _>>()?
        }
        // What groups come first; no condition on a sum goes below it.
        LogicalPlan::Aggregate(own) if own.group_expr.len() + own.aggr_expr.len() == count => {
            let schema = own.input.schema();
            let groups = own.group_expr.iter();
            let mut all = groups
                .map(|expr| of_expression(expr, schema, &inputs))
                .collect::<Result<Vec<f64>, _>>()?;
            all.resize(count, 1.0);
            all
        }
        // Nor one on a window, whose columns come last.
        LogicalPlan::Window(_) => {
            inputs.resize(count, 1.0);
            inputs
        }
        // Those of all inputs, as they are.
        _ if inputs.len() == count && !matches!(node, LogicalPlan::Aggregate(_)) => inputs,
        _ => vec![largest; count],
    };
    if matches!(node, LogicalPlan::Filter(_) | LogicalPlan::Join(_)) {
        node.apply_expressions(|expr| {
            *most = most.max(of_expression(expr, node.schema(), &own)?);
            Ok(TreeNodeRecursion::Continue)
        })?;
    }
    Ok(own)
}

/// How many columns an expression reads where its inputs' columns read so many, one where that is not said.
fn of_expression(expr: &Expr, schema: &DFSchema, inputs: &[f64]) -> Result<f64, DataFusionError> {
    if let Expr::Column(column) = expr {
        let place = schema.maybe_index_of_column(column);
        // A column of the other side of a join may be as long as any.
        let longest = inputs.iter().copied().fold(1.0, f64::max);
        return Ok(place.map_or(longest, |at| inputs.get(at).copied().unwrap_or(1.0)));
    }
    let mut parts = vec![];
    expr.apply_children(|part| {
        parts.push(of_expression(part, schema, inputs)?);
        Ok(TreeNodeRecursion::Continue)
    })?;
    let sum: f64 = parts.iter().sum();
    let first = parts.first().copied().unwrap_or(0.0);
    let is_truth = || matches!(expr.get_type(schema), Ok(DataType::Boolean));
    let all = match expr {
        Expr::Between(_) => sum + first,
        Expr::InList(list) if list.list.len() <= SHORT_LIST => {
            sum + first * list.list.len().saturating_sub(1) as f64
        }
        Expr::BinaryExpr(both)
            if matches!(
                both.op,
                Operator::IsDistinctFrom | Operator::IsNotDistinctFrom
            ) =>
        {
            2.0 * sum
        }
        Expr::ScalarFunction(call) if CASES.contains(&call.func.name()) => 2.0 * sum,
        Expr::Case(_) if is_truth() => 2.0 * sum,
        _ => sum,
    };
    Ok(all.max(1.0))
}
