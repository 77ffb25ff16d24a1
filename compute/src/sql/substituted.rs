//! How long the expressions of a question become once columns are written out as what they are computed of: its plan in; a refusal out where one
//! would read more columns than is planned in time.
//!
//! The engine brings conditions to where values are read, and writes out what their columns are on the way. Where each query adds a column of the one
//! before to itself, a condition doubles with each, which no limit of memory counts and no limit of time ends.

use datafusion::common::DFSchema;
use datafusion::common::tree_node::{TreeNode as _, TreeNodeRecursion};
use datafusion::error::DataFusionError;
use datafusion::logical_expr::{Expr, LogicalPlan};

use super::told::told;
use crate::ComputeError;

/// Most columns that an expression may read once it is written out: a condition of 16,000 is planned in half a second, one of a million in longer
/// than 30 s.
const MAX_COLUMNS: f64 = 100_000.0;

/// # Errors
/// `Sql`: an expression would read more than [`MAX_COLUMNS`].
pub(super) fn check(plan: &LogicalPlan) -> Result<(), ComputeError> {
    let most = most_columns(plan).map_err(|error| told(error, None))?;
    if most <= MAX_COLUMNS {
        return Ok(());
    }
    let reason = format!(
        "it computes columns of columns that it computes, so often that one of them, written out, reads more than {MAX_COLUMNS} columns: compute them in \
         fewer steps, or read each fewer times"
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
        Ok(TreeNodeRecursion::Continue)
    })?;
    Ok(most)
}

/// How many columns each column of a node reads, written out; `most` becomes the most of any.
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
    *most = own.iter().copied().fold(*most, f64::max);
    Ok(own)
}

fn of_expression(expr: &Expr, schema: &DFSchema, inputs: &[f64]) -> Result<f64, DataFusionError> {
    let mut sum = 0.0f64;
    expr.apply(|part| {
        if let Expr::Column(column) = part {
            let place = schema.maybe_index_of_column(column);
            sum += place.and_then(|at| inputs.get(at)).unwrap_or(&1.0);
        }
        Ok(TreeNodeRecursion::Continue)
    })?;
    Ok(sum.max(1.0))
}
